//! Choice of a step's length by its estimated error, and by halving a step that fails.

use super::formula::POINTS;
use super::report::{StepFailure, StepReport};
use super::solver::Solver;
use super::state::State;
use super::time_step::Attempt;
use crate::body::shaft::MotorState;
use crate::functions::powi;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

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
/// Largest error of a step of any length, in helix radii.
const RESOLVED: f64 = 0.05;
/// After a step with an error below this share of the bound, the next one may be longer. Twice the length has up to 32
/// times the error, but less while a contact decays; a step that is too long is repeated.
const EASY: f64 = 1.0 / 5.0;
/// The same in free motion, whose errors rise and fall with each turn.
const EASY_FREE: f64 = 1.0 / 8.0;
/// A step with an error above this many times the bound is repeated; one with a smaller error above the bound only makes
/// the next one shorter.
const HARD: f64 = 1.5;
/// A step whose error is above this many times the allowed one after two sweeps is repeated without the others.
const HOPELESS: f64 = 1.2;
/// After a step with this many sweeps or more, the next one is not longer.
const EASY_SWEEPS: u32 = 9;
/// Easy steps before the next one is longer.
const EASY_STEPS: u32 = 2;
/// Angle of easy steps before the next one is longer, rad, after free motion has needed shorter steps: two turns.
const EASY_ANGLE: f64 = 4.0 * PI;
/// Number of halvings from which steps in contact are also tried with inverses of their own. Before that, shorter steps
/// help more.
const CONTACT_LEVEL: u32 = 4;
/// Steps after contact in which motion is not yet free.
const POST_CONTACT_STEPS: u32 = 40;
/// Steps after contact in which formulas take one point less, and predictions two: the motion had a kink.
const KINK_STEPS: u32 = 4;
/// Steps below this angle, rad, take one point less, and so do all steps with clamps that do not move, which need one sweep.
/// Their error is small, and formulas of all points amplify the errors that iterations leave, even for a robot at rest.
const LEAST_ANGLE: f64 = 0.1;
/// Motors slower than this, rad/s, do not limit the step.
const LEAST_SPEED: f64 = 1e-9;
/// A remaining time of up to this many steps is taken in one step, so that no sliver remains.
const STRETCH: f64 = 1.01;

/// Chooses the length of each step by the outcome of the last ones.
///
/// Lengths are the longest one, `solver.step_rad`, and its repeated halves: few lengths need few frozen inverses. A step
/// whose estimated error is above `solver.step_error` makes the next one half as long, and is itself repeated if the error is
/// much larger; small errors let later steps grow again. The error is a displacement. Errors of mean loads are smallest if all
/// steps have the same error, see `truncation`.
///
/// Flagella that mesh (both pull at their clamps) snap past each other once a beat, within some hundredths of a second, and
/// their steps grow again as soon as errors allow. In free motion errors rise and fall with each turn, but steps do not
/// follow them: the formula's errors cancel over a turn of even steps, but not of uneven ones. Uneven steps would be more
/// steps with less accurate means. `sim/docs/cost.md` has the errors of means.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepControl {
    /// Number of halvings of the present step.
    level: u32,
    /// Steps since the last one that was not easy or changed the level.
    easy_steps: u32,
    /// Remaining angle of easy steps before steps may grow, rad; zero if they may grow at once.
    held: f64,
    /// Whether the next attempt gets inverses of its own, because an attempt with the kept ones has failed.
    own_inverses: bool,
    /// Steps since rods last pressed on each other.
    steps_since_contact: u32,
}

impl Default for StepControl {
    fn default() -> Self {
        Self { level: 0, easy_steps: 0, held: 0.0, own_inverses: false, steps_since_contact: u32::MAX }
    }
}

impl StepControl {
    /// Takes one accepted step of `solver`, not beyond `until` (s). `motors`: the motors as a function of time.
    ///
    /// # Errors
    /// [`StepError`] if the step fails at every length allowed.
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
            self.held = 0.0;
        }
        loop {
            let length = self.length(solver, state, until, motors);
            let kink = self.steps_since_contact < KINK_STEPS;
            let end = motors(state.time + length);
            let angle = length * fastest(end.map(|m| m.speed));
            let lower = kink || angle < LEAST_ANGLE || !solver.model().two_way();
            let points = if lower { POINTS - 1 } else { POINTS };
            let allowed_error = self.allowed_error(solver);
            let attempt = Attempt {
                length,
                motors: end,
                points,
                prediction_points: if kink { points - 1 } else { points },
                own_inverses: self.own_inverses,
                allowed_error,
                hopeless_error: if self.level < halvings { HOPELESS * allowed_error } else { f64::INFINITY },
            };
            let left = until - state.time;
            let has_estimate = attempt.has_estimate(state);
            match solver.step(state, &attempt) {
                Ok(report) => {
                    if length >= left {
                        // A sum of steps may miss the end by a rounding error, and leave a sliver.
                        state.time = until;
                    }
                    self.succeeded(solver, &report, has_estimate, angle);
                    return Ok(report);
                }
                Err(StepFailure::Stalled { .. } | StepFailure::Diverged)
                    if !self.own_inverses && (state.pairs.is_empty() || self.level >= CONTACT_LEVEL) =>
                {
                    self.own_inverses = true;
                }
                Err(failure) if self.level >= halvings => {
                    return Err(StepError { time: state.time, step: length, failure });
                }
                Err(failure) => {
                    self.shorten(matches!(failure, StepFailure::Unresolved { .. }));
                }
            }
        }
    }

    /// Returns the error (m) above which a step is repeated.
    fn allowed_error(&self, solver: &Solver) -> f64 {
        let model = solver.model();
        let settings = &model.robot.solver;
        let share = if self.level < settings.halvings { settings.step_error } else { RESOLVED };
        (HARD * share).min(RESOLVED) * model.radius()
    }

    /// Returns whether the last contact is long past.
    fn free(&self) -> bool {
        self.steps_since_contact >= POST_CONTACT_STEPS
    }

    /// Halves the next step. `unresolved`: because of the estimated error.
    fn shorten(&mut self, unresolved: bool) {
        self.held = if unresolved && self.free() { EASY_ANGLE } else { 0.0 };
        self.set_level(self.level + 1);
    }

    fn set_level(&mut self, level: u32) {
        (self.level, self.easy_steps) = (level, 0);
    }

    /// Adapts the level to an accepted step. `has_estimate`: whether its error is known; if not, the next step is not longer;
    /// `angle`: angle of the step, rad.
    fn succeeded(&mut self, solver: &Solver, report: &StepReport, has_estimate: bool, angle: f64) {
        let model = solver.model();
        let settings = &model.robot.solver;
        let error = report.error / (settings.step_error * model.radius());
        self.own_inverses = false;
        self.steps_since_contact = if report.touching > 0 { 0 } else { self.steps_since_contact.saturating_add(1) };
        if !self.free() {
            self.held = 0.0;
        }
        let easy = if self.free() { EASY_FREE } else { EASY };
        if error > 1.0 && self.level < settings.halvings {
            self.shorten(true);
        } else if error > easy || report.sweeps >= EASY_SWEEPS {
            self.easy_steps = 0;
            self.held = if self.held > 0.0 { EASY_ANGLE } else { 0.0 };
        } else if has_estimate {
            self.easy_steps += 1;
            self.held = (self.held - angle).max(0.0);
            if self.level > 0 && self.easy_steps >= EASY_STEPS && self.held == 0.0 {
                self.set_level(self.level - 1);
            }
        }
    }

    /// Returns the length of the next attempt, s.
    fn length(&self, solver: &Solver, state: &State, until: f64, motors: &dyn Fn(f64) -> [MotorState; 2]) -> f64 {
        let settings = &solver.model().robot.solver;
        let longest = |speeds| settings.longest_step_s.min(settings.step_rad / fastest(speeds).max(LEAST_SPEED));
        let now = motors(state.time).map(|m| m.speed);
        let ahead = motors((state.time + longest(now)).min(until)).map(|m| m.speed);
        let faster = [0, 1].map(|k| if ahead[k].abs() > now[k].abs() { ahead[k] } else { now[k] });
        let wanted = longest(faster) / powi(2.0, self.level as i32);
        let left = until - state.time;
        if left <= STRETCH * wanted {
            left
        } else if left < 2.0 * wanted {
            0.5 * left
        } else {
            wanted
        }
    }
}

/// Returns the speed that limits the angle of steps, for motors at these speeds, rad/s.
///
/// The forces of one flagellum on the other, and of both on the body, beat with the difference of their speeds. With steps
/// limited by the faster motor alone, the tilt is wrong by up to a degree for motors that turn in opposite directions.
fn fastest(speeds: [f64; 2]) -> f64 {
    speeds[0].abs().max(speeds[1].abs()).max((speeds[0] - speeds[1]).abs())
}
