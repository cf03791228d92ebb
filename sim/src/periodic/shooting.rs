//! Shooting: periods of the ordinary solver, and steps between them in the slow coordinates.

use super::modes::{Map, Modes};
use super::slow::{self, COORDINATES, Slow};
use super::{Orbit, SolveError, TOLERANCE, Watch, period, run};
use crate::anderson::Anderson;
use crate::body::closure::Closure;
use crate::params::Robot;
use crate::profile::{ProfileError, SpeedProfile};
use crate::state::State;
use crate::step::Solver;
use crate::trial::{Options, Trial};
use std::f64::consts::PI;

/// Simulated time in which the motion decays by itself before the first step, s, at least.
const DECAY_S: f64 = 6.0;
/// Simulated time of a search, s.
const PATIENCE_S: f64 = 54.0;
/// Time between samples of the slow coordinates, s, about.
const SAMPLE_S: f64 = 0.5;
/// Samples that are left out after a start from rest or a move: fast modes are still in them.
const SKIPPED: usize = 2;
/// Periods that a step is made from.
const COMBINED: usize = 5;
/// Longest time constant that is believed, s: it bounds the steps.
const SLOWEST_S: f64 = 60.0;
/// Halvings of a move that would make the flagella overlap.
const HALVINGS: i32 = 5;

/// How a search ends.
pub enum Outcome {
    /// With a motion that repeats.
    Found { orbit: Box<Orbit>, simulated_s: f64 },
    /// Without one, at the end of a trial.
    Lost { trial: Box<Trial>, simulated_s: f64 },
    /// Where there is nothing to search for, or a step failed.
    Failed { simulated_s: f64 },
}

/// Searches for the motion that repeats.
///
/// # Errors
/// Impossible parameters or speeds, and [`SolveError::Interrupted`].
pub fn shoot(
    robot: &Robot,
    closure: Closure,
    rpm: [f64; 2],
    start_rad: [f64; 2],
    watch: Watch,
) -> Result<Outcome, SolveError> {
    let speeds = rpm.map(|rpm| rpm * PI / 30.0);
    let Some(period) = period::common(speeds) else {
        // What is impossible is an error here, too.
        SpeedProfile::constant(rpm, 1.0)?;
        robot.validate()?;
        return Ok(Outcome::Failed { simulated_s: 0.0 });
    };
    let samples = (period / SAMPLE_S).round() as usize;
    let interval = period / samples as f64;
    let profile = |time: f64| -> Result<SpeedProfile, ProfileError> {
        let angles = [0, 1].map(|k| start_rad[k] + speeds[k] * time);
        Ok(SpeedProfile::from_points(&[(time, rpm), (time + period, rpm)])?.from_angles(angles))
    };
    let solver = Solver::new(&with_even_steps(robot, speeds, interval), closure)?;
    let mut trial = Trial::with_solver(solver, profile(0.0)?, Options::default())?;
    let mut modes = Modes::new(interval);
    let mut paths: Vec<Vec<Slow>> = Vec::new();
    let mut last_distance = f64::INFINITY;
    loop {
        let start = trial.checkpoint();
        let began_s = trial.state().time;
        let mut path = vec![slow::coordinates(trial.solver(), trial.state())];
        for sample in 1..=samples {
            // The last one ends with the profile: rounding must not leave a sliver of time.
            let until = if sample < samples { began_s + interval * sample as f64 } else { f64::INFINITY };
            if run(&mut trial, until, watch)?.is_err() {
                return Ok(Outcome::Failed { simulated_s: trial.state().time });
            }
            path.push(slow::coordinates(trial.solver(), trial.state()));
        }
        let simulated_s = trial.state().time;
        let end = path[samples];
        if let Some(before) = paths.last() {
            modes.record(&before[SKIPPED..], &path[SKIPPED..]);
        }
        paths.push(path);
        let mut state = trial.state().clone();
        if simulated_s >= DECAY_S.max(1.5 * period) {
            let from = paths[paths.len() - 1][0];
            let [newton, step] = steps(&paths, modes.newton(samples));
            let distance = attitude(&newton).max(attitude(&step));
            let is_near = distance < TOLERANCE;
            if is_near && !modes.grow() {
                let mut summary = trial.summary();
                (summary.steady.settled, summary.steady.settle_s) = (true, 0.0);
                let orbit = Box::new(Orbit { trial, start, summary, period_s: period });
                return Ok(Outcome::Found { orbit, simulated_s });
            }
            if simulated_s + period > PATIENCE_S {
                return Ok(Outcome::Lost { trial: Box::new(trial), simulated_s });
            }
            // After a step that did not help, before one that cannot be true, and near a motion that seems not to be stable, a
            // period passes without a step: the motion decays by itself, or leaves what is not stable.
            let longest = (end - from).amax() / (1.0 - (-period / SLOWEST_S).exp());
            if !is_near && distance < last_distance.min(longest) {
                state = moved_apart(&mut trial, &(from + step - end));
                last_distance = distance;
            } else {
                last_distance = f64::INFINITY;
            }
        }
        trial = trial.followed_by(profile(simulated_s)?, state);
    }
}

/// Returns the step from the start of the last period to the motion that repeats, by that period alone and by the last
/// ones; not finite where a direction does not decay. `newton`: what makes a step of the change of a period.
fn steps(paths: &[Vec<Slow>], newton: Option<Map>) -> [Slow; 2] {
    let Some(newton) = newton else { return [Slow::repeat(f64::NAN); 2] };
    let ends = |path: &Vec<Slow>| (path[0], path[path.len() - 1]);
    let mut anderson = Anderson::default();
    // The first period has the start from rest.
    for (from, to) in paths.iter().skip(1).rev().take(COMBINED).rev().map(ends) {
        let target = from + newton * (to - from);
        anderson.record(from.as_slice(), target.as_slice().to_vec(), &[1.0; COORDINATES]);
    }
    let (from, to) = ends(&paths[paths.len() - 1]);
    let alone = newton * (to - from);
    [alone, anderson.combine().map_or(alone, |target| Slow::from_column_slice(&target) - from)]
}

/// Returns the largest of the attitude's angles, rad.
fn attitude(step: &Slow) -> f64 {
    step.fixed_rows::<3>(0).amax()
}

/// Returns the state of a trial moved in its slow coordinates, by less where its flagella would overlap.
fn moved_apart(trial: &mut Trial, change: &Slow) -> State {
    let touching = 2.0 * trial.solver().model().robot.flagellum.rod_radius_m;
    let state = trial.state().clone();
    let least = trial.least_distance(&state).min(touching);
    for halvings in 0..HALVINGS {
        let moved = slow::moved(&state, &(change * 0.5f64.powi(halvings)), trial.profile());
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
