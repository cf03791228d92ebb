//! The phases of the flagella: the conditions for fitting them, and the start of their fit.
//!
//! The encoders count from the angles at which the board started, so each helix angle is known up to a constant. The
//! steady state of a trial at a simple ratio of speeds depends periodically on one combination of these constants
//! ([`sim::steady::phase`]), so least squares could end in a local minimum. Therefore each trial is first simulated at
//! phases around the full turn. Trials of one ratio determine the phase of that ratio; the other combination only
//! affects the start of the motion.

use super::data::FitTrial;
use super::problem::Problem;
use super::{Parameter, TwinError, failed};
use crate::attitude::wrapped;
use biflag_log::Origin;
use rayon::prelude::*;
use sim::params::Robot;
use sim::steady::phase::Ratio;
use std::collections::BTreeSet;

/// Number of phases per turn at which each trial is simulated.
const STEPS: i32 = 24;

/// Returns the parameters with both phases in place of [`Parameter::Phase`].
///
/// # Errors
/// [`TwinError::Fit`] if no steady state depends on the phases, or if the trials have different ones.
pub(super) fn with_both(requested: &[Parameter], trials: &[FitTrial]) -> Result<Vec<Parameter>, TwinError> {
    if !requested.contains(&Parameter::Phase) {
        return Ok(requested.to_vec());
    }
    if trials.iter().all(|trial| trial.ratio.is_none()) {
        let help = "add trials with encoders at equal speeds, or with a flagellum that stands";
        return Err(failed("the phase of the flagella does not matter at the speeds of these trials", help));
    }
    let starts: BTreeSet<_> = trials.iter().map(|trial| trial.board_start).collect();
    if trials.len() > 1
        && let Some(trial) = trials.iter().find(|trial| trial.origin == Origin::Imported)
    {
        let reason = format!("{} was imported: how its flagella stood has nothing to do with other trials", trial.name);
        return Err(failed(&reason, "fit the phase to one imported trial alone"));
    }
    if starts.len() > 1 {
        let reason =
            format!("the logs come from {} starts of the board, from which the encoders count anew", starts.len());
        return Err(failed(&reason, "fit the phase to the logs of one start; `biflag info LOG` shows the start"));
    }
    let others = requested.iter().copied().filter(|parameter| !parameter.is_phase());
    Ok(others.chain([Parameter::Phase, Parameter::PhaseBoth]).collect())
}

/// Returns a note if trials of a rig depend on phases that are neither known nor fitted.
pub(super) fn unknown(trials: &[FitTrial], start: &Robot, parameters: &[Parameter]) -> Option<String> {
    let is_known = start.flagellum.phase_deg != [0.0; 2] || parameters.iter().any(|parameter| parameter.is_phase());
    let depending = trials.iter().filter(|trial| trial.is_of_rig && trial.ratio.is_some()).count();
    (!is_known && depending > 0).then(|| {
        let cure = match trials.len() > 1 && trials.iter().any(|trial| trial.origin == Origin::Imported) {
            true => "fit it to each imported trial alone, with --fit phase",
            false => "fit it too, with `phase` in --fit",
        };
        let trials = crate::text::count(depending, "trial");
        format!("the results of {trials} depend on how the flagella stood when the board started: {cure}")
    })
}

/// Returns the initial values of a fit, with the phases around the turn at which the trials fit best; `None` if no
/// phase is fitted.
pub(super) fn nearest(problem: &Problem) -> Option<Robot> {
    if !problem.given.parameters.contains(&Parameter::Phase) {
        return None;
    }
    let trials: Vec<(usize, Ratio)> =
        (0..problem.given.trials.len()).filter_map(|i| Some((i, problem.given.trials[i].ratio?))).collect();
    let misfits = |(i, ratio): &(usize, Ratio)| -> Vec<f64> {
        let at = |step: i32| problem.misfit(*i, &turned(problem.start, alone(*ratio, step)));
        (0..STEPS).into_par_iter().map(at).collect()
    };
    let misfits: Vec<Vec<f64>> = trials.par_iter().map(misfits).collect();
    let steady = |[one, two]: &[i32; 2]| -> f64 {
        let kept = |ratio: &Ratio| (ratio.turns[1] * one - ratio.turns[0] * two).rem_euclid(STEPS);
        trials.iter().zip(&misfits).map(|((_, ratio), misfit)| misfit[kept(ratio) as usize]).sum()
    };
    let grid = (0..STEPS).flat_map(|one| (0..STEPS).map(move |two| [one, two]));
    let [one, two] = grid.min_by(|a, b| steady(a).total_cmp(&steady(b)))?;
    // With a single ratio, these turns of the motors do not change the steady phase.
    let (_, Ratio { turns: [p, q] }) = trials.first()?;
    let is_only = trials.iter().all(|(_, ratio)| ratio.turns[0] * q == ratio.turns[1] * p);
    let later = if is_only { 0..STEPS } else { 0..1 };
    let starts: Vec<Robot> =
        later.map(|step| turned(problem.start, [one + p * step, two + q * step].map(f64::from))).collect();
    let total = |robot: &Robot| (0..problem.given.trials.len()).map(|i| problem.misfit(i, robot)).sum::<f64>();
    let totals: Vec<f64> = starts.par_iter().map(total).collect();
    starts.into_iter().zip(totals).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(robot, _)| robot)
}

/// Returns the angles by which to turn the flagella to change the phase of a ratio by `step`.
fn alone(ratio: Ratio, step: i32) -> [f64; 2] {
    match ratio.turns {
        [0, q] => [f64::from(step) / f64::from(q), 0.0],
        [p, _] => [0.0, -f64::from(step) / f64::from(p)],
    }
}

/// Returns a robot whose flagella are turned by steps.
fn turned(robot: &Robot, steps: [f64; 2]) -> Robot {
    let mut robot = robot.clone();
    for (phase, steps) in robot.flagellum.phase_deg.iter_mut().zip(steps) {
        *phase = wrapped(*phase + steps * 360.0 / f64::from(STEPS));
    }
    robot
}
