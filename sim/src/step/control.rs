//! Choice of a step's length: by the motors' speeds, by contact, and by halving a step that fails.

use super::formula::POINTS;
use super::report::{StepFailure, StepReport};
use super::solver::Solver;
use super::time_step::Attempt;
use crate::body::shaft::MotorState;
use crate::state::State;
use serde::{Deserialize, Serialize};

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
/// A step with this many sweeps or more does not make the next one longer.
const EASY_SWEEPS: u32 = 9;
/// Steps after contact during which steps stay short, as it mostly comes back.
const POST_CONTACT_STEPS: u32 = 40;
/// Steps after contact in which the prediction takes one point less: the motion had a kink.
const KINK_STEPS: u32 = 4;
/// Length of steps in contact of meshing flagella over that of other steps in contact.
const MESHING_STEP: f64 = 1.0 / 3.0;
/// Motors slower than this, rad/s, do not limit the step.
const LEAST_SPEED: f64 = 1e-9;
/// A rest of the time that is longer than the step by no more than this factor is taken in one step: no sliver remains.
const STRETCH: f64 = 1.01;

/// Chooses the length of each step by the outcome of the last ones.
///
/// Flagella that mesh (both pull at their clamps) snap past each other once a beat, and means converge slowly
/// with the step. Error of the mean thrust over 48 to 60 s against a run with steps a twelfth as long and an
/// eightieth of the tolerance, printed by `cargo bench -p sim --bench trials -- steps`:
///
/// | speeds rpm | `contact_step_rad` | error | steps | sweeps a step |
/// | --- | --- | --- | --- | --- |
/// | (-90, -80) | 0.5 | 4.41 % | 4740 | 7.81 |
/// | (-90, -80) | 0.25 | 0.48 % | 7246 | 5.60 |
/// | (-90, -80) | 0.125 | 0.13 % | 13035 | 3.96 |
/// | (-50, -30) | 0.5 | 1.51 % | 1966 | 5.59 |
/// | (-50, -30) | 0.25 | 1.72 % | 2965 | 4.40 |
/// | (-50, -30) | 0.125 | 0.97 % | 5083 | 3.40 |
///
/// At (-50, -30) the means of so short a window scatter by 1 to 2 % at any step. Shorter steps during the snaps
/// alone, chosen by how far the prediction was off, need as many sweeps for the same error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepControl {
    /// How often the present step is halved.
    level: u32,
    /// Steps since the level last changed.
    steps_at_level: u32,
    /// Whether the next attempt gets inverses of its own: with those kept, one has failed.
    own_inverses: bool,
    /// Steps since rods last pressed on each other.
    steps_since_contact: u32,
}

impl Default for StepControl {
    fn default() -> Self {
        Self { level: 0, steps_at_level: 0, own_inverses: false, steps_since_contact: u32::MAX }
    }
}

impl StepControl {
    /// Takes one step of `solver` that counts, not beyond `until` (s). `motors`: the motors as a function of time.
    ///
    /// # Errors
    /// [`StepError`] when the step fails however short it is.
    pub fn advance(
        &mut self,
        solver: &mut Solver,
        state: &mut State,
        until: f64,
        motors: &dyn Fn(f64) -> [MotorState; 2],
    ) -> Result<StepReport, StepError> {
        let halvings = solver.model().robot.solver.halvings;
        if state.past.is_empty() {
            self.set_level(FIRST_LEVEL.min(halvings));
        }
        loop {
            let length = self.length(solver, state, until, motors);
            let kink = self.steps_since_contact < KINK_STEPS;
            let attempt = Attempt {
                length,
                motors: motors(state.time + length),
                prediction_points: if kink { POINTS - 1 } else { POINTS },
                own_inverses: self.own_inverses,
            };
            let left = until - state.time;
            match solver.step(state, &attempt) {
                Ok(report) => {
                    if length >= left {
                        // A sum of steps may miss the end by a rounding error, and leave a sliver.
                        state.time = until;
                    }
                    self.succeeded(&report);
                    return Ok(report);
                }
                Err(StepFailure::Stalled { .. } | StepFailure::Diverged) if !self.own_inverses => {
                    self.own_inverses = true;
                }
                Err(failure) if self.level >= halvings => {
                    return Err(StepError { time: state.time, step: length, failure });
                }
                Err(_) => self.set_level(self.level + 1),
            }
        }
    }

    fn set_level(&mut self, level: u32) {
        (self.level, self.steps_at_level) = (level, 0);
    }

    fn succeeded(&mut self, report: &StepReport) {
        self.own_inverses = false;
        self.steps_since_contact = if report.touching > 0 { 0 } else { self.steps_since_contact.saturating_add(1) };
        self.steps_at_level += 1;
        if self.level > 0 && self.steps_at_level >= GOOD_STEPS && report.sweeps < EASY_SWEEPS {
            self.set_level(self.level - 1);
        }
    }

    /// Returns the length of the next attempt, s.
    fn length(&self, solver: &Solver, state: &State, until: f64, motors: &dyn Fn(f64) -> [MotorState; 2]) -> f64 {
        let now = motors(state.time);
        let guess = self.full_length(solver, state, now.map(|m| m.speed));
        let ahead = motors((state.time + guess).min(until));
        let faster = [0, 1].map(|k| {
            let (a, b) = (now[k].speed, ahead[k].speed);
            if b.abs() > a.abs() { b } else { a }
        });
        let wanted = self.full_length(solver, state, faster) / f64::powi(2.0, self.level as i32);
        let left = until - state.time;
        if left <= STRETCH * wanted {
            left
        } else if left < 2.0 * wanted {
            0.5 * left
        } else {
            wanted
        }
    }

    /// Returns the length (s) of a step that is not halved, at these speeds of the motors (rad/s).
    fn full_length(&self, solver: &Solver, state: &State, speeds: [f64; 2]) -> f64 {
        let model = solver.model();
        let settings = &model.robot.solver;
        let mut angle = settings.step_rad;
        if self.steps_since_contact < POST_CONTACT_STEPS || !state.pairs.is_empty() {
            angle = angle.min(settings.contact_step_rad);
            if model.meshing(speeds) {
                angle = angle.min(MESHING_STEP * settings.contact_step_rad);
            }
        }
        // What one flagellum does to the other, and both to the body, beats with the difference of their speeds: steps
        // measured by the faster motor alone leave the tilt wrong by up to a degree where the motors turn against each
        // other.
        let fastest = speeds[0].abs().max(speeds[1].abs()).max((speeds[0] - speeds[1]).abs());
        settings.longest_step_s.min(angle / fastest.max(LEAST_SPEED))
    }
}
