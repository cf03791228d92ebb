//! Choice of the step's length: by the motors' speeds, by contact, and by halving what fails.
//!
//! Flagella that mesh (both motors pull them in) snap past each other once a beat, and means converge slowly
//! with the step. Error of the mean thrust over 48 to 60 s against a run with steps a twelfth as long and an
//! eightieth of the tolerance, as `cargo bench -p sim --bench trials -- steps` prints it:
//!
//! | speeds rpm | `contact_step_rad` | error | steps | sweeps a step |
//! | --- | --- | --- | --- | --- |
//! | (-90, -80) | 0.5 | 4.41 % | 4740 | 7.81 |
//! | (-90, -80) | 0.25 | 0.48 % | 7246 | 5.60 |
//! | (-90, -80) | 0.125 | 0.13 % | 13035 | 3.96 |
//! | (-50, -30) | 0.5 | 1.51 % | 1966 | 5.59 |
//! | (-50, -30) | 0.25 | 1.72 % | 2965 | 4.40 |
//! | (-50, -30) | 0.125 | 0.97 % | 5083 | 3.40 |
//!
//! At (-50, -30) the means of so short a window scatter by 1 to 2 % at any step. Shorter steps during the snaps
//! alone, chosen by how far the prediction was off, need as many sweeps for the same error.

use super::{Solver, StepFailure, StepReport};
use crate::robot::clamp::Motor;
use crate::rod::helix::Handedness;
use crate::state::State;

/// A step that failed at every length allowed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "no step from {time:.4} s, down to {step:.1e} s: {failure}; allow more `solver.halvings` or shorter `solver.step_rad`, or make the flagella stiffer or slower"
)]
pub struct StepError {
    /// Time of the last good state, s.
    pub time: f64,
    /// Length of the last attempt, s.
    pub step: f64,
    /// Why it failed.
    pub failure: StepFailure,
}

/// Halvings of the first step: it starts from rest with a formula of first order.
const FIRST_LEVEL: u32 = 3;
/// Good steps before the next one may be longer.
const GOOD_STEPS: u32 = 4;
/// A step with more sweeps than this does not make the next one longer.
const EASY_SWEEPS: u32 = 9;
/// Steps that get inverses of their own once one has needed it.
const OWN_INVERSES: u32 = 12;
/// Halvings after which steps in contact, too, are tried with inverses of their own.
const DEEP: u32 = 4;
/// Steps after contact during which steps stay short.
const WATCHFUL: u32 = 40;

/// Steps in contact of meshing flagella, over other steps in contact.
const MESHING_STEP: f64 = 1.0 / 3.0;

impl Solver {
    /// Whether both flagella press against their clamps' thrust: where they touch then, they cross and mesh
    /// like gears.
    pub(super) fn meshing(&self, speeds: [f64; 2]) -> bool {
        (0..2).all(|k| {
            let sign = match self.robot.flagellum.handedness[k] {
                Handedness::Right => 1.0,
                Handedness::Left => -1.0,
            };
            sign * speeds[k] <= 0.0
        })
    }

    /// Length in s of a full step from this state with these speeds (rad/s). Where the flagella turn in opposite senses, steps
    /// that are measured by the faster motor alone leave the tilt wrong by up to a degree.
    fn full_step(&self, state: &State, speeds: [f64; 2]) -> f64 {
        let settings = &self.robot.solver;
        let mut angle = settings.step_rad;
        if state.steps_since_contact < WATCHFUL || !state.pairs.is_empty() {
            angle = angle.min(settings.contact_step_rad);
            if self.meshing(speeds) {
                angle = angle.min(MESHING_STEP * settings.contact_step_rad);
            }
        }
        // What one flagellum does to the other, and both to the body, beats with the difference of their speeds.
        let fastest = speeds[0].abs().max(speeds[1].abs()).max((speeds[0] - speeds[1]).abs());
        settings.longest_step_s.min(angle / fastest.max(1e-9))
    }

    /// One accepted step, not beyond `until` (s), with the motors' angles and speeds as functions of time.
    pub fn advance(
        &mut self,
        state: &mut State,
        until: f64,
        motors: &dyn Fn(f64) -> [Motor; 2],
    ) -> Result<StepReport, StepError> {
        if state.past.is_empty() {
            state.level = FIRST_LEVEL.min(self.robot.solver.halvings);
            state.steps_at_level = 0;
        }
        loop {
            let now = motors(state.time);
            let guess = self.full_step(state, now.map(|m| m.speed));
            let ahead = motors((state.time + guess).min(until));
            let faster = [0, 1].map(|k| {
                let (a, b) = (now[k].speed, ahead[k].speed);
                if b.abs() > a.abs() { b } else { a }
            });
            let wanted = self.full_step(state, faster) / f64::powi(2.0, state.level as i32);
            let left = until - state.time;
            // No sliver of a step before the end.
            let step = if left <= 1.01 * wanted {
                left
            } else if left < 2.0 * wanted {
                0.5 * left
            } else {
                wanted
            };
            let own = state.own_inverses > 0;
            match self.step(state, step, motors(state.time + step), own) {
                Ok(report) => {
                    state.own_inverses = state.own_inverses.saturating_sub(1);
                    if step >= left {
                        // A sum of steps may miss the end by a rounding error, and leave a sliver.
                        state.time = until;
                    }
                    state.steps_at_level += 1;
                    if state.level > 0 && state.steps_at_level >= GOOD_STEPS && report.sweeps < EASY_SWEEPS {
                        state.level -= 1;
                        state.steps_at_level = 0;
                    }
                    return Ok(report);
                }
                Err(StepFailure::Stalled { .. } | StepFailure::Diverged)
                    if !own && (state.pairs.is_empty() || state.level >= DEEP) =>
                {
                    state.own_inverses = OWN_INVERSES;
                }
                Err(failure) => {
                    if state.level >= self.robot.solver.halvings {
                        return Err(StepError { time: state.time, step, failure });
                    }
                    state.level += 1;
                    state.steps_at_level = 0;
                }
            }
        }
    }
}
