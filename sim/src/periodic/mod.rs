//! Solves for the final motion of a trial at constant speeds, without simulating its transient.
//!
//! ```
//! use sim::{body::closure::Closure, params::Robot, periodic};
//!
//! let found = periodic::solve(&Robot::default(), Closure::Full, [50.0, 10.0], [0.0; 2], 120.0, &|_| true)?;
//! println!("{:?} after {:.0} s: {:?}", found.kind, found.simulated_s, found.summary.steady.attitude);
//! # Ok::<(), periodic::SolveError>(())
//! ```
//!
//! The unknown is the state at the start of a common period of both motors. The motion repeats if the state is the same
//! after the period: this is shooting, as for any periodic orbit. Only the attitude and the bend of each flagellum
//! decay in more than a second (`slow`); the rest of the state follows them within the period. So a period maps seven
//! coordinates y. With its derivative M and the change F(y) over a period, a Newton step is (I - M)⁻¹ F. M is estimated
//! from the periods themselves (`modes`), and Anderson acceleration over the last periods corrects its error. A step
//! moves the state and its past in the slow coordinates; the ordinary solver continues from there. Where the two
//! estimates of a step differ much, or M has a direction that grows, a period passes without a step.
//!
//! The motion is found when the step is below [`TOLERANCE`], with and without the acceleration. The results are means
//! over the last period, by the ordinary solver and the ordinary steady window. If no motion is found, or if the motors
//! have no common period of 12 s or less, the ordinary simulation continues until the means over two windows agree.
//! `sim/docs/steady.md` has the comparison with trials.

mod modes;
mod period;
mod shooting;
mod slow;

use crate::body::closure::Closure;
use crate::params::{ParamError, Robot};
use crate::profile::{ProfileError, SpeedProfile};
use crate::steady::{Level, Steady, whole_turns};
use crate::step::StepError;
use crate::trial::{Checkpoint, Options, Summary, Trial};
use serde::{Deserialize, Serialize};
use shooting::{Outcome, shoot};
use std::f64::consts::PI;

/// Largest difference of yaw, pitch and roll from those of the repeating motion, estimated from the last period, rad.
pub const TOLERANCE: f64 = 0.05 * PI / 180.0;

/// Largest difference of yaw, pitch and roll between the means of two windows that agree, rad.
const AGREEMENT: f64 = 0.1 * PI / 180.0;

/// Kind of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// It repeats with the common period of the motors.
    Steady,
    /// No repeating motion was found, but the means over the last two windows agree.
    Beating,
    /// No repeating motion was found, and the means do not agree.
    NotFound,
}

impl Kind {
    /// Returns the kind of a motion that does not repeat, from whether its trial has settled.
    pub fn of_trial(settled: bool) -> Self {
        if settled { Self::Beating } else { Self::NotFound }
    }

    /// Returns its name, as in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Steady => "steady",
            Self::Beating => "beating",
            Self::NotFound => "not_found",
        }
    }
}

/// The result of [`solve`].
#[derive(Clone, Debug)]
pub struct Periodic {
    /// Kind of the motion.
    pub kind: Kind,
    /// Results of the period, or of the last window if no repeating motion was found. They do not include the
    /// transient: the settling time is 0 s.
    pub summary: Summary,
    /// The period, s.
    pub period_s: Option<f64>,
    /// Everything that was simulated, s.
    pub simulated_s: f64,
}

/// Why there is no steady state.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// An impossible parameter.
    #[error(transparent)]
    Parameter(#[from] ParamError),
    /// Impossible speeds or duration.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// A step of the trial that fails.
    #[error(transparent)]
    Step(#[from] StepError),
    /// `watch` has ended it.
    #[error("interrupted")]
    Interrupted,
}

/// Called with the simulated time (s) as it goes on; `false` ends it.
pub type Watch<'a> = &'a dyn Fn(f64) -> bool;

/// Solves for the steady state of a robot whose motors turn at constant speeds.
///
/// `rpm`: speeds of the motors; `start_rad`: their angles at the start, which select one of several steady states
/// ([`crate::phase`]); `longest_s`: duration of the simulation if no repeating motion is found; a search that ends late
/// is followed by at least two windows.
///
/// # Errors
/// Impossible parameters, speeds or duration, a trial that fails, and [`SolveError::Interrupted`]. A failing step of the
/// search is not an error: the trial is run from its start.
pub fn solve(
    robot: &Robot,
    closure: Closure,
    rpm: [f64; 2],
    start_rad: [f64; 2],
    longest_s: f64,
    watch: Watch,
) -> Result<Periodic, SolveError> {
    let whole = SpeedProfile::constant(rpm, longest_s)?.from_angles(start_rad);
    match shoot(robot, closure, rpm, start_rad, longest_s, watch)? {
        Outcome::Found { orbit, simulated_s } => {
            let Orbit { summary, period_s, .. } = *orbit;
            Ok(Periodic { kind: Kind::Steady, summary, period_s: Some(period_s), simulated_s })
        }
        Outcome::Lost { trial, simulated_s } if simulated_s < longest_s => {
            // At least two windows: it takes as many to see whether their means agree.
            let window = whole_turns(whole.target(), longest_s);
            let end = longest_s.max(simulated_s + 2.0 * window);
            let whole = SpeedProfile::constant(rpm, end)?.from_angles(start_rad);
            follow(*trial, &whole, simulated_s, simulated_s, watch)
        }
        Outcome::Lost { simulated_s, .. } | Outcome::Failed { simulated_s } => {
            let trial = Trial::new(robot, closure, whole.clone(), Options::default())?;
            follow(trial, &whole, 0.0, simulated_s, watch)
        }
    }
}

/// Returns whether the mean yaw, pitch and roll of two windows differ by less than 0.1 degrees: the motion has settled.
pub fn agree(one: &Steady, other: &Steady) -> bool {
    one.attitude.iter().zip(&other.attitude).all(|(a, b)| (a.mean - b.mean).abs() <= AGREEMENT)
}

/// Simulates on, window by window, to the end of a profile or until the means of two windows agree. `from_s`: time that the
/// trial has come to, s; `simulated_s`: all that was simulated.
fn follow(
    mut trial: Trial,
    whole: &SpeedProfile,
    mut from_s: f64,
    mut simulated_s: f64,
    watch: Watch,
) -> Result<Periodic, SolveError> {
    let window = whole_turns(whole.target(), whole.end());
    let mut before: Option<Steady> = None;
    loop {
        let left = whole.end() - from_s;
        let duration = if left < 1.5 * window { left } else { window };
        let state = trial.state().clone();
        trial = trial.followed_by(whole.between(from_s, from_s + duration)?, state);
        run(&mut trial, f64::INFINITY, &|time| watch(simulated_s + time - from_s))??;
        simulated_s += trial.state().time - from_s;
        from_s = trial.state().time;
        let mut summary = trial.summary();
        let has_settled = before.as_ref().is_some_and(|before| agree(before, &summary.steady));
        if has_settled || from_s >= whole.end() - window * 1e-6 {
            // As for a trial: half a degree or 1 %.
            let near = |a: Level, b: Level| (a.mean - b.mean).abs() <= 0.5f64.to_radians().max(0.01 * a.mean.abs());
            let levels = |before: &Steady| (0..3).all(|i| near(summary.steady.attitude[i], before.attitude[i]));
            summary.steady.settled = before.as_ref().is_some_and(levels);
            summary.steady.settle_s = 0.0;
            summary.simulated_s = simulated_s;
            let kind = Kind::of_trial(summary.steady.settled);
            return Ok(Periodic { kind, summary, period_s: None, simulated_s });
        }
        before = Some(summary.steady);
    }
}

/// Result of a search for a motion that repeats.
#[derive(Clone, Debug)]
pub struct Search {
    /// The motion, if it was found.
    pub orbit: Option<Orbit>,
    /// Simulated time, s.
    pub simulated_s: f64,
}

/// A motion that repeats.
#[derive(Clone, Debug)]
pub struct Orbit {
    trial: Trial,
    /// The start of the period.
    start: Checkpoint,
    /// Results of the period.
    pub summary: Summary,
    /// The period, s.
    pub period_s: f64,
}

impl Orbit {
    /// Returns a trial over the period, at its start. It gives samples as set by `options`. Its results differ from
    /// `summary` by the solver's error, because the search also ends a step at each of its own samples.
    pub fn into_trial(mut self, options: Options) -> Trial {
        self.trial.restore(self.start);
        self.trial.set_options(options);
        self.trial
    }
}

/// Searches for the repeating motion, for 54 s or four fifths of `longest_s`. [`solve`] also simulates on if there is none.
///
/// # Errors
/// Impossible parameters or speeds, and [`SolveError::Interrupted`].
pub fn search(
    robot: &Robot,
    closure: Closure,
    rpm: [f64; 2],
    start_rad: [f64; 2],
    longest_s: f64,
    watch: Watch,
) -> Result<Search, SolveError> {
    Ok(match shoot(robot, closure, rpm, start_rad, longest_s, watch)? {
        Outcome::Found { orbit, simulated_s } => Search { orbit: Some(*orbit), simulated_s },
        Outcome::Lost { simulated_s, .. } | Outcome::Failed { simulated_s } => Search { orbit: None, simulated_s },
    })
}

/// Runs a trial up to a time (s).
fn run(trial: &mut Trial, until: f64, watch: Watch) -> Result<Result<(), StepError>, SolveError> {
    let until = until.min(trial.profile().end());
    while trial.state().time < until {
        if !watch(trial.state().time) {
            return Err(SolveError::Interrupted);
        }
        if let Err(error) = trial.advance_towards(until) {
            return Ok(Err(error));
        }
    }
    Ok(Ok(()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Near (70, 10) rpm there are two stable motions and one between them that is not stable, with a yaw of -85.05 degrees.
    #[test]
    fn a_motion_that_is_steady_is_stable() {
        let rpm = [70.0, 10.0];
        let search = search(&Robot::default(), Closure::Full, rpm, [0.0; 2], 120.0, &|_| true).expect("no failure");
        let Orbit { trial, summary, .. } = search.orbit.expect("a motion that repeats");
        let [before, ..] = summary.steady.attitude;
        assert!((before.mean.to_degrees() + 85.05).abs() > 0.5, "{before:?}");
        // A difference from what is not stable would have grown by a factor of 50 after ten periods.
        let (from_s, state) = (trial.state().time, trial.state().clone());
        let whole = SpeedProfile::constant(rpm, from_s + 60.0).expect("a profile");
        let rest = whole.between(from_s, from_s + 60.0).expect("a profile");
        let after = trial.followed_by(rest, state).finish().expect("a run").steady.attitude;
        for (before, after) in summary.steady.attitude.iter().zip(&after) {
            assert!((after.mean - before.mean).to_degrees().abs() < 0.1, "{before:?} {after:?}");
        }
    }
}
