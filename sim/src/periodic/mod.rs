//! The motion that a trial at constant speeds ends in, solved for instead of waited for.
//!
//! ```
//! use sim::{body::closure::Closure, params::Robot, periodic};
//!
//! let found = periodic::solve(&Robot::default(), Closure::Full, [50.0, 10.0], [0.0; 2], 120.0, &|_| true)?;
//! println!("{:?} after {:.0} s: {:?}", found.kind, found.simulated_s, found.summary.steady.attitude);
//! # Ok::<(), periodic::SolveError>(())
//! ```
//!
//! The unknown is the state at the start of a common period of both motors, and the motion repeats where the period leaves
//! it as it was: shooting, as for any periodic orbit. Of the state only the attitude and the bend of each flagellum decay in
//! more than a second (`slow`); the rest follows them within the period. So a period is a map of these seven coordinates y,
//! and with its derivative M its change F(y) gives a Newton step, (I - M)⁻¹ F. M comes from the periods themselves
//! (`modes`). A step moves the state and its past in the slow coordinates, and the ordinary solver goes on from there.
//!
//! The motion is found when Newton's step is below [`TOLERANCE`]: the results are those of the period, by the ordinary solver and the ordinary steady window. Where that does not happen, or the motors have no common
//! period of 12 s or less, the trial itself is run.

mod modes;
mod period;
mod slow;

use crate::body::closure::Closure;
use crate::params::{ParamError, Robot};
use crate::profile::{ProfileError, SpeedProfile};
use crate::state::State;
use crate::step::{Solver, StepError};
use crate::trial::{Checkpoint, Options, Summary, Trial};
use modes::Modes;
use serde::{Deserialize, Serialize};
use slow::Slow;
use std::f64::consts::PI;

/// Largest distance of yaw, pitch and roll from those of the motion that repeats, as the last period tells it, rad.
pub const TOLERANCE: f64 = 0.05 * PI / 180.0;

/// Simulated time in which the motion decays by itself before the first step, s, at least.
const DECAY_S: f64 = 6.0;
/// Simulated time of a search, s; after that the trial is run.
const PATIENCE_S: f64 = 60.0;
/// Time between samples of the slow coordinates, s, about.
const SAMPLE_S: f64 = 0.5;
/// Halvings of a move that would make the flagella overlap.
const HALVINGS: usize = 5;

/// What a motion is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// It repeats with the common period of the motors.
    Steady,
    /// It was not found to repeat, but the means of the trial's last two windows agree.
    Beating,
    /// Not even its means agree.
    NotFound,
}

/// A steady state that was solved for.
#[derive(Clone, Debug)]
pub struct Periodic {
    /// What it is.
    pub kind: Kind,
    /// Results of the period, or of the trial where the motion was not found to repeat. Of a period: times are from its
    /// start, and its steady state counts as settled, after 0 s.
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
/// `rpm`: speeds of the motors; `start_rad`: their angles at the start, on which it depends which of several steady states
/// is found ([`crate::phase`]); `longest_s`: duration of the trial that is run where the motion is not found to repeat.
///
/// # Errors
/// Impossible parameters, speeds or duration, a trial that fails, and [`SolveError::Interrupted`]. A failing step of the
/// search is not an error: the trial is run.
pub fn solve(
    robot: &Robot,
    closure: Closure,
    rpm: [f64; 2],
    start_rad: [f64; 2],
    longest_s: f64,
    watch: Watch,
) -> Result<Periodic, SolveError> {
    let Search { orbit, simulated_s } = search(robot, closure, rpm, start_rad, watch)?;
    if let Some(Orbit { summary, period_s, .. }) = orbit {
        return Ok(Periodic { kind: Kind::Steady, summary, period_s: Some(period_s), simulated_s });
    }
    let profile = SpeedProfile::constant(rpm, longest_s)?.from_angles(start_rad);
    let mut trial = Trial::new(robot, closure, profile, Options::default())?;
    run(&mut trial, longest_s, &|time| watch(simulated_s + time))??;
    let summary = trial.summary();
    let kind = if summary.steady.settled { Kind::Beating } else { Kind::NotFound };
    let simulated_s = simulated_s + summary.simulated_s;
    Ok(Periodic { kind, summary, period_s: None, simulated_s })
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
    /// Returns the trial of the period at its start. Run, it gives samples, and the summary again.
    pub fn into_trial(mut self) -> Trial {
        self.trial.restore(self.start);
        self.trial
    }
}

/// Searches for the motion that repeats; see [`solve`], which runs the trial where there is none.
///
/// # Errors
/// Impossible parameters or speeds, and [`SolveError::Interrupted`].
pub fn search(
    robot: &Robot,
    closure: Closure,
    rpm: [f64; 2],
    start_rad: [f64; 2],
    watch: Watch,
) -> Result<Search, SolveError> {
    let speeds = rpm.map(|rpm| rpm * PI / 30.0);
    let none = |simulated_s| Ok(Search { orbit: None, simulated_s });
    let Some(period) = period::common(speeds) else {
        // What is impossible is an error here, too.
        SpeedProfile::constant(rpm, 1.0)?;
        robot.validate()?;
        return none(0.0);
    };
    let samples = (period / SAMPLE_S).round().max(2.0);
    let robot = with_even_steps(robot, speeds, period / samples);
    let profile = |time: f64| -> Result<SpeedProfile, ProfileError> {
        let angles = [0, 1].map(|k| start_rad[k] + speeds[k] * time);
        Ok(SpeedProfile::from_points(&[(time, rpm), (time + period, rpm)])?.from_angles(angles))
    };
    let mut trial = Trial::with_solver(Solver::new(&robot, closure)?, profile(0.0)?, Options::default())?;
    let mut modes = Modes::new(period / samples);
    let mut before: Option<Vec<Slow>> = None;
    let mut last_distance = f64::INFINITY;
    let mut simulated_s = 0.0;
    loop {
        let start = trial.checkpoint();
        let mut path = vec![slow::coordinates(trial.solver(), trial.state())];
        for sample in 1..=samples as usize {
            let time = simulated_s + period * sample as f64 / samples;
            if run(&mut trial, time, watch)?.is_err() {
                return none(simulated_s);
            }
            path.push(slow::coordinates(trial.solver(), trial.state()));
        }
        simulated_s += period;
        if let Some(before) = &before {
            // What a start from rest or a move leaves in the first interval is not slow.
            modes.record(&before[1..], &path[1..]);
        }
        let (first, last) = (path[0], path[path.len() - 1]);
        let step = modes.newton(samples as usize, last - first);
        before = Some(path);
        let distance = attitude(&step);
        if simulated_s < DECAY_S.max(1.5 * period) {
            let next = profile(simulated_s)?;
            let state = trial.state().clone();
            trial = trial.followed_by(next, state);
            continue;
        }
        if distance < TOLERANCE {
            let mut summary = trial.summary();
            (summary.steady.settled, summary.steady.settle_s) = (true, 0.0);
            let orbit = Orbit { trial, start, summary, period_s: period };
            return Ok(Search { orbit: Some(orbit), simulated_s });
        }
        if simulated_s + period > PATIENCE_S || !distance.is_finite() {
            return none(simulated_s);
        }
        // Where the last step did not help, the motion decays by itself for a period.
        let state = if distance < last_distance {
            move_apart(&mut trial, &(first + step - last))
        } else {
            trial.state().clone()
        };
        last_distance = if distance < last_distance { distance } else { f64::INFINITY };
        let next = profile(simulated_s)?;
        trial = trial.followed_by(next, state);
    }
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

/// Returns the largest of the attitude's angles, rad.
fn attitude(step: &Slow) -> f64 {
    step.fixed_rows::<3>(0).amax()
}

/// Returns the state of a trial moved in its slow coordinates, by less where its flagella would overlap.
fn move_apart(trial: &mut Trial, change: &Slow) -> State {
    let touching = 2.0 * trial.solver().model().robot.flagellum.rod_radius_m;
    let state = trial.state().clone();
    let least = trial.least_distance(&state).min(touching);
    for halvings in 0..HALVINGS {
        let moved = slow::moved(&state, &(change * 0.5f64.powi(halvings as i32)), trial.profile());
        if trial.least_distance(&moved) >= least {
            return moved;
        }
    }
    state
}

/// Returns the robot with steps of which a whole number makes this time (s): they need no step of another length at its end.
fn with_even_steps(robot: &Robot, speeds: [f64; 2], time: f64) -> Robot {
    let mut robot = robot.clone();
    let fastest = speeds[0].abs().max(speeds[1].abs()).max((speeds[0] - speeds[1]).abs());
    let settings = &mut robot.solver;
    let longest = settings.longest_step_s.min(settings.step_rad / fastest.max(1e-9));
    settings.longest_step_s = time / (time / longest - 1e-9).ceil();
    robot
}
