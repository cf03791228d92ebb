//! Solves for the final motion of a trial at constant speeds, without simulating its transient.
//!
//! ```
//! use sim::{body::closure::Closure, params::Robot, steady::{self, Problem}};
//!
//! let problem = Problem {
//!     robot: &Robot::default(),
//!     closure: Closure::Full,
//!     rpm: [50.0, 10.0],
//!     start_rad: [0.0; 2],
//!     longest_s: 120.0,
//!     output: None,
//!     at_rest: None,
//! };
//! let found = steady::solve(&problem, &|_| true)?;
//! println!("{:?} after {:.0} s: {:?}", found.kind, found.simulated_s, found.summary.steady.attitude);
//! # Ok::<(), steady::SolveError>(())
//! ```
//!
//! The unknown is the state at the start of a common period of both motors. The motion repeats if the state is the same after
//! the period: this is shooting, as for any periodic orbit. Only the attitude and the bend of each flagellum decay in more
//! than a second (`slow`); the rest of the state follows them within the period. So a period maps seven coordinates y. With
//! its derivative M and the change F(y) over a period, a Newton step is (I - M)⁻¹ F. M is estimated from the periods
//! themselves (`modes`), and Anderson acceleration over the last periods corrects its error. A step moves the state and its
//! past in the slow coordinates; the ordinary solver continues from there. Where the steps with and without acceleration
//! differ, half a step is made. Where they differ much, or M has a growing direction, a period passes without a step.
//!
//! The motion is found when the step is below [`TOLERANCE`], with and without the acceleration. Where the flagella have
//! touched, a path without steps must also lead to it (`witness`); if it does not, that path is simulated on. The results are
//! means over the last period, by the ordinary solver and the ordinary steady window. If no motion is found, or if the motors
//! have no common period of 12 s or less, the trial is simulated from rest until its means over both motor angles are known
//! ([`crate::trial::means`]). `sim/docs/steady.md` has the comparison with trials.

pub mod effort;
mod modes;
mod over_phases;
mod period;
pub mod phase;
mod shooting;
mod slow;
mod witness;

use crate::functions::exp;
use crate::params::{Closure, ParamError, Robot};
use crate::step::{InversesAtRest, Solver, StepError};
use crate::trial::means::{Level, Steady, SteadyCollector, whole_turns};
use crate::trial::profile::{ProfileError, SpeedProfile};
use crate::trial::sample::Sample;
use crate::trial::{Options, Summary, Trial};
pub use over_phases::{Method, Phases, SteadyState};
use serde::{Deserialize, Serialize};
use shooting::{Found, Outcome, SLOWEST_S, shoot};
use std::f64::consts::PI;

/// Largest difference of yaw, pitch and roll from those of the repeating motion, estimated from the last period, rad.
pub const TOLERANCE: f64 = 0.05 * PI / 180.0;

/// Number of successive windows whose means must be known before a simulation ends early: of many checks, one may pass by
/// chance.
const AGREEING: u32 = 2;

/// A remainder below this share of a window is rounding.
const ROUNDING: f64 = 1e-6;

/// Kind of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// It repeats with the common period of the motors.
    Steady,
    /// No repeating motion was found, but the means over both motor angles are known.
    Beating,
    /// No repeating motion was found, and the means are not known well enough.
    NotFound,
    /// The base turned over. Parts of sweeps store the number of a kind: new kinds come last.
    Overturned,
}

impl Kind {
    /// Returns the kind of a motion that is not found to repeat, from the means of its trial.
    pub fn of_trial(steady: &Steady) -> Self {
        match steady.settled {
            _ if steady.is_overturned() => Self::Overturned,
            true => Self::Beating,
            false => Self::NotFound,
        }
    }

    /// Returns its name, as in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Steady => "steady",
            Self::Beating => "beating",
            Self::NotFound => "not_found",
            Self::Overturned => "overturned",
        }
    }
}

/// A robot whose motors turn at constant speeds.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// How the flagella act on the base.
    pub closure: Closure,
    /// Speeds of the motors, rpm.
    pub rpm: [f64; 2],
    /// Angles of the motors at the start, rad. They select one of several steady states ([`crate::steady::phase`]).
    pub start_rad: [f64; 2],
    /// Duration of the simulation from rest if no repeating motion is found, s.
    pub longest_s: f64,
    /// Output of the samples; `None` for no samples.
    pub output: Option<Options>,
    /// Inverses that trials of this robot share; `None` for its own.
    pub at_rest: Option<&'a InversesAtRest>,
}

impl Problem<'_> {
    fn solver(&self) -> Result<Solver, ParamError> {
        match self.at_rest {
            Some(at_rest) => Solver::sharing(self.robot, self.closure, at_rest),
            None => Solver::new(self.robot, self.closure),
        }
    }
}

/// The result of [`solve`].
#[derive(Clone, Debug)]
pub struct Periodic {
    /// Kind of the motion.
    pub kind: Kind,
    /// Results of the period, or of the last window if no repeating motion was found; steady values are then means over
    /// both motor angles. They do not include the transient: the settling time is 0 s.
    pub summary: Summary,
    /// Samples of the period or of the last window, with times from 0.
    pub samples: Vec<Sample>,
    /// Duration of the period or of the last window, s.
    pub duration_s: f64,
    /// Total simulated time, including the search, s.
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
    /// A step of the trial failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// `watch` returned `false`.
    #[error("interrupted")]
    Interrupted,
}

/// Called with the simulated time (s) during the computation; `false` ends it.
pub type Watch<'a> = &'a dyn Fn(f64) -> bool;

/// Solves for the steady state.
///
/// # Errors
/// Impossible parameters, speeds or duration, a trial that fails, and [`SolveError::Interrupted`]. A failing step of the
/// search is not an error: the trial is run from its start.
pub fn solve(problem: &Problem, watch: Watch) -> Result<Periodic, SolveError> {
    let Problem { rpm, start_rad, longest_s, output, .. } = *problem;
    let whole = SpeedProfile::constant(rpm, longest_s)?.from_angles(start_rad);
    let from_rest = |searched: Option<&Trial>, searched_s: f64| {
        let mut trial = Trial::with_solver(problem.solver()?, whole.clone(), output.unwrap_or_default())?;
        if let Some(searched) = searched {
            trial = trial.with_spent(searched.totals());
        }
        follow(trial, &whole, problem, searched_s, watch)
    };
    match shoot(problem, watch)? {
        Outcome::Found(found) => {
            let Found { trial, before, distance, samples, unmoved, coarse, ordinary } = *found;
            let mut simulated_s = trial.state().time;
            let mut summary = trial.window_summary();
            set_errors(&mut summary.steady, &before, distance);
            // Contact of a flagellum with itself counts, too.
            summary.steady.raise_errors(summary.largest_contact_n > 0.0);
            if let Some(unmoved) = unmoved {
                let before_s = simulated_s - unmoved.time;
                let watch_witness = |time: f64| watch(before_s + time);
                let (witness, agrees) =
                    witness::agrees(problem, &trial, [&coarse, &ordinary], unmoved, &summary.steady, &watch_witness)?;
                simulated_s = before_s + witness.state().time;
                if !agrees {
                    // No step has moved the witness, so it is the trial's own path. The remaining time must hold some
                    // windows.
                    let left_s = whole.end() - witness.state().time;
                    return match left_s >= f64::from(AGREEING + 1) * whole_turns(whole.target(), whole.end()) {
                        true => follow(witness, &whole, problem, simulated_s, watch),
                        false => from_rest(Some(&witness), simulated_s),
                    };
                }
                let spent = witness.window_summary();
                (summary.steps, summary.sweeps) = (spent.steps, spent.sweeps);
            }
            Ok(periodic(Kind::Steady, summary, &trial, samples, simulated_s))
        }
        // The search may have moved the state to another motion: the trial starts again from rest.
        Outcome::Lost(searched) => from_rest(Some(&searched), searched.state().time),
        Outcome::None => from_rest(None, 0.0),
    }
}

/// Sets the standard errors of the means over a period to half of their differences from those over the period before.
///
/// After a period without a step, a difference is the part of a slow approach that one period covers; after a step, it is the
/// whole step. So the differences are scaled to the remaining distance of the attitude, `distance` (rad). A difference may
/// also be small by chance, where two modes cancel: [`Steady::raise_errors`] then applies the solver's lower bounds.
fn set_errors(steady: &mut Steady, before: &Steady, distance: f64) {
    let slowest = 1.0 / (1.0 - exp(-steady.window_s / SLOWEST_S));
    // The means of a settled motion differ by rounding alone: the scale is at most that of the slowest approach.
    let scale = (distance / self::distance(steady, before)).min(slowest);
    let set = |(now, before): (&mut Level, &Level)| {
        // A period in which the robot turned over gives no error.
        now.standard_error = Some(0.5 * scale * (now.mean - before.mean).abs()).filter(|error| error.is_finite());
    };
    steady.attitude.iter_mut().zip(&before.attitude).for_each(set);
    steady.force.as_flattened_mut().iter_mut().zip(before.force.as_flattened()).for_each(set);
    steady.axial_torque.iter_mut().zip(&before.axial_torque).for_each(set);
}

/// Returns the largest difference of the angles of two motions, rad.
fn distance(one: &Steady, other: &Steady) -> f64 {
    one.attitude.iter().zip(&other.attitude).map(|(one, other)| (one.mean - other.mean).abs()).fold(0.0, f64::max)
}

/// Continues a simulation to the end of a profile, or until the means of [`AGREEING`] successive windows are known.
/// `searched_s`: total simulated time so far.
fn follow(
    mut trial: Trial,
    whole: &SpeedProfile,
    problem: &Problem,
    searched_s: f64,
    watch: Watch,
) -> Result<Periodic, SolveError> {
    let window = whole_turns(whole.target(), whole.end());
    let before_s = searched_s - trial.state().time;
    let watch = |time: f64| watch(before_s + time);
    let mut collected = SteadyCollector::new(trial.state().time, whole.end(), whole.target())
        .meshing(problem.robot.flagellum.mesh(whole.target()));
    let left = whole.end() - trial.state().time;
    let mut windows = (left / window + ROUNDING).floor();
    if left - windows * window > ROUNDING * window {
        // The remainder comes first, so that the last window is whole.
        trial = continued(trial, whole, windows * window)?.with_collected(collected);
        run(&mut trial, f64::INFINITY, None, &watch)??;
        collected = trial.collected().clone();
    }
    let mut known = 0;
    loop {
        windows -= 1.0;
        trial = continued(trial, whole, windows * window)?.with_collected(collected);
        let mut samples = Vec::new();
        run(&mut trial, f64::INFINITY, problem.output.is_some().then_some(&mut samples), &watch)??;
        let summary = trial.summary();
        let kind = Kind::of_trial(&summary.steady);
        known = if kind == Kind::Beating { known + 1 } else { 0 };
        if known == AGREEING || windows < 0.5 {
            return Ok(periodic(kind, summary, &trial, samples, before_s + trial.state().time));
        }
        collected = trial.collected().clone();
    }
}

/// Returns the trial, continued up to `left_s` seconds before the end of a profile.
fn continued(trial: Trial, whole: &SpeedProfile, left_s: f64) -> Result<Trial, ProfileError> {
    let state = trial.state().clone();
    Ok(trial.followed_by(whole.between(state.time, whole.end() - left_s)?, state))
}

/// Returns the result whose last period or window is this trial.
fn periodic(kind: Kind, mut summary: Summary, trial: &Trial, mut samples: Vec<Sample>, simulated_s: f64) -> Periodic {
    let kind = if summary.steady.is_overturned() { Kind::Overturned } else { kind };
    let duration_s = std::mem::replace(&mut summary.simulated_s, simulated_s);
    (summary.steady.settled, summary.steady.settle_s) = (kind < Kind::NotFound, 0.0);
    let start_s = trial.state().time - duration_s;
    summary.first_contact_s = summary.first_contact_s.map(|time| time - start_s);
    for sample in &mut samples {
        sample.time_s -= start_s;
    }
    Periodic { kind, summary, samples, duration_s, simulated_s }
}

/// Runs a trial up to a time (s) and collects its samples if `samples` is given.
fn run(
    trial: &mut Trial,
    until: f64,
    mut samples: Option<&mut Vec<Sample>>,
    watch: Watch,
) -> Result<Result<(), StepError>, SolveError> {
    let until = until.min(trial.profile.end());
    loop {
        if let Some(samples) = &mut samples {
            samples.extend(std::iter::from_fn(|| trial.passed()));
        }
        if trial.state().time >= until {
            return Ok(Ok(()));
        }
        if !watch(trial.state().time) {
            return Err(SolveError::Interrupted);
        }
        if let Err(error) = trial.advance_towards(until) {
            return Ok(Err(error));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn searched(rpm: [f64; 2]) -> Outcome {
        let problem = Problem {
            robot: &Robot::default(),
            closure: Closure::Full,
            rpm,
            start_rad: [0.0; 2],
            longest_s: 120.0,
            output: None,
            at_rest: None,
        };
        shoot(&problem, &|_| true).expect("no failure")
    }

    /// At (0, 80) rpm the last period covers a seventh of the remaining approach.
    #[test]
    fn stated_errors_hold_what_is_left_of_an_approach() {
        for rpm in [[0.0, 80.0], [0.0, 76.45], [51.66, -51.66]] {
            let outcome = searched(rpm);
            let Outcome::Found(found) = outcome else { panic!("no motion that repeats") };
            let Found { trial, before, distance, .. } = *found;
            let mut stated = trial.window_summary().steady;
            set_errors(&mut stated, &before, distance);
            stated.raise_errors(false);
            // With the same steps, so that the approach is the only difference.
            let (from_s, state) = (trial.state().time, trial.state().clone());
            let periods = (120.0 / stated.window_s).round();
            let whole = SpeedProfile::constant(rpm, from_s + periods * stated.window_s).expect("a profile");
            let rest = whole.between(from_s, whole.end()).expect("a profile");
            let mut rest = trial.followed_by(rest, state);
            rest.finish().expect("a run");
            let after = rest.window_summary().steady;
            let levels = |steady: &Steady| {
                let forces = steady.force.as_flattened().to_vec();
                [steady.attitude.to_vec(), forces, steady.axial_torque.to_vec()].concat()
            };
            for (i, (stated, after)) in levels(&stated).iter().zip(&levels(&after)).enumerate() {
                let off = (after.mean - stated.mean).abs();
                println!("{rpm:?}: quantity {i} off by {:.2} of its ±", off / stated.uncertainty());
                assert!(off < stated.uncertainty(), "{rpm:?}: quantity {i} off by {off}: {stated:?}");
            }
        }
    }
}
