//! Finds motor speeds for an attitude: the inverse of a robot's map.
//!
//! A [`Table`] gives initial speeds: the built-in map of the robot `physical`, or that of a sweep. The model of the
//! robot refines them (`improve`), first by its steady states and then by whole trials. Every returned attitude is that at
//! the end of a whole trial of the model at the returned speeds, never a value of the table. So the table of another robot
//! costs time, but not accuracy.
//!
//! Where the flagella touch, a trial takes several times as long as elsewhere, and the attitude may depend on the speeds
//! irregularly. Speeds at which they touch are tried if there is no solution at others.

mod contact;
mod error;
mod improve;
mod interval;
mod known;
mod model;
mod nearest;
mod plan;
mod quantity;
mod read;
mod table;
mod target;

pub use contact::ContactChange;
pub use error::AimError;
pub use interval::Interval;
pub use known::{Doubt, Known};
pub use model::{Model, State};
pub use nearest::{Nearest, nearest};
pub use plan::plan;
pub use quantity::{Attitude, Quantity};
pub use read::{Columns, MAP, load, of_columns, shipped};
pub use table::Table;
pub use target::Target;

use improve::{Best, Goal, VALUES, improve};
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::{AtomicUsize, Ordering};
use table::distance;

/// Largest error of a solution in a whole trial, degrees.
pub const REACHED: f64 = 0.5;

/// Error of a whole trial below which speeds are not refined further, degrees.
const GOOD: f64 = 0.3;
/// Error of steady states below which they are near enough for whole trials, degrees.
const CLOSE: f64 = 0.1;
/// Speeds of the table whose error is below this, degrees, are refined with the model.
const WORTH: f64 = 5.0;
/// Speeds whose error in the table exceeds the least one by this, degrees, are refined after the others.
const LIKELY: f64 = 1.0;
/// Largest number of initial speeds to refine.
const STARTS: usize = 4;
/// Most trials from the same initial speeds where the flagella touch.
const TRIALS: usize = 5;
/// Speeds closer than this count as the same, rpm.
const APART: f64 = 4.0;
/// Difference of speeds for derivatives of the model, rpm.
const DIFFERENCE: f64 = 2.0;

/// Speeds and their steady state in the model.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Solution {
    /// The steady state, with the attitude of the trial.
    #[serde(flatten)]
    pub state: State,
    /// Angle between the robot's axis and the vertical.
    pub tilt_deg: f64,
    /// Intervals of the angles.
    #[serde(flatten)]
    pub interval: Interval,
    /// Largest error of the wanted angles.
    pub error_deg: f64,
    /// Error of the thrust, if it is wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_n: Option<f64>,
    /// Where the flagella begin or cease to touch.
    pub contact_change: Option<ContactChange>,
}

/// Result of [`aim()`].
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Aimed {
    /// Whether solutions were found. A search from a table may miss some.
    pub reachable: bool,
    /// Confidence of the intervals; `None` where it cannot be stated.
    pub confidence: Option<f64>,
    /// Why it cannot.
    pub doubts: Vec<Doubt>,
    /// Speeds at which the target is met, the nearest first.
    pub solutions: Vec<Solution>,
    /// The nearest attitude that was found, if there is no solution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest: Option<Solution>,
}

/// Speeds to refine.
struct Start {
    rpm: [f64; 2],
    /// Whether the error in the table is more than the least one by more than [`LIKELY`].
    is_unlikely: bool,
    /// Whether the flagella touch in the table.
    touches: bool,
}

impl Start {
    /// Starts of a later rank are refined if none of the earlier ones meet the target.
    fn rank(&self) -> [bool; 2] {
        [self.is_unlikely, self.touches]
    }
}

/// Refined speeds.
#[derive(Clone)]
struct Found {
    /// The whole trial.
    trial: Best<State>,
    /// The steady state at the same speeds, if it was solved for.
    steady: Option<State>,
}

/// Finds speeds for a target. `known`: what is known about the robot's parameters.
///
/// # Errors
/// [`AimError::Model`] if the model fails wherever it was tried, and [`AimError::Interrupted`].
pub fn aim(model: &Model, known: &Known, table: &Table, target: &Target) -> Result<Aimed, AimError> {
    let goal = Goal { target, thrust_step_n: table.thrust_step_n(), close: GOOD, values: VALUES };
    let starts = propose(table, goal)?;
    let mut found: Vec<Found> = Vec::new();
    let mut failed = None;
    for group in starts.chunk_by(|a, b| a.rank() == b.rank()) {
        let refined = if group[0].touches {
            refine_touching(model, table, goal, group)?
        } else {
            group.par_iter().map(|start| refine(model, table, goal, start)).collect()
        };
        for result in refined {
            match result {
                Ok(refined) => found.push(refined),
                Err(AimError::Interrupted) => return Err(AimError::Interrupted),
                Err(error) => failed = Some(error),
            }
        }
        if found.iter().any(|found| found.trial.error <= REACHED) {
            break;
        }
    }
    found.sort_by(|a, b| a.trial.error.total_cmp(&b.trial.error));
    let Some(best) = found.first().cloned() else {
        return Err(failed.unwrap_or(AimError::TooSmall { rows: table.rows().len() }));
    };
    let mut solutions: Vec<Found> = Vec::new();
    for candidate in found.into_iter().filter(|candidate| candidate.trial.error <= REACHED) {
        if solutions.iter().all(|other| distance(other.trial.rpm, candidate.trial.rpm) > APART) {
            solutions.push(candidate);
        }
    }
    let describe = |found: &Found| describe(model, known, table, target, found);
    let solutions: Vec<Solution> = solutions.par_iter().map(describe).collect::<Result<_, _>>()?;
    let reachable = !solutions.is_empty();
    let nearest = if reachable { None } else { Some(describe(&best)?) };
    let (confidence, doubts) = (known.confidence(), known.doubts.clone());
    Ok(Aimed { reachable, confidence, doubts, solutions, nearest })
}

/// Returns speeds that meet the target in the table, or come near, those to refine first at the front.
fn propose(table: &Table, goal: Goal) -> Result<Vec<Start>, AimError> {
    let goal = Goal { close: CLOSE, ..goal };
    let in_table = |row: [f64; 2]| {
        let derivatives = table.about(row).derivatives(goal.target, goal.thrust_step_n);
        improve(goal, row, derivatives, |rpm| Ok((table.about(rpm).at(rpm), ())))
    };
    let rows = table.nearest(goal.target);
    let mut found: Vec<Best<()>> = rows.into_par_iter().map(|row| in_table(row.rpm)).collect::<Result<_, _>>()?;
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    let least = found.first().map_or(0.0, |best| best.error);
    let mut starts: Vec<Start> = Vec::new();
    for Best { rpm, error, .. } in found {
        let is_worth = starts.is_empty() || error < WORTH;
        if is_worth && starts.len() < STARTS && starts.iter().all(|start| distance(start.rpm, rpm) > APART) {
            starts.push(Start { rpm, is_unlikely: error > least + LIKELY, touches: table.touches(rpm) });
        }
    }
    starts.sort_by_key(Start::rank);
    Ok(starts)
}

/// Refines speeds at which the flagella are apart, by steady states and then by whole trials.
fn refine(model: &Model, table: &Table, goal: Goal, start: &Start) -> Result<Found, AimError> {
    let derivatives = table.about(start.rpm).derivatives(goal.target, goal.thrust_step_n);
    let by_steady = |rpm: [f64; 2]| model.at(rpm, [0.0; 2]).map(|state| (state.attitude, state));
    let steady = improve(Goal { close: CLOSE, ..goal }, start.rpm, derivatives, by_steady)?;
    let by_trial = |rpm: [f64; 2]| model.trial(rpm).map(|state| (state.attitude, state));
    let mut trial = improve(goal, steady.rpm, steady.derivatives, by_trial)?;
    if trial.error > REACHED && !trial.state.touches() {
        // The derivatives of the table may be those of another robot.
        let again = improve(goal, trial.rpm, own_derivatives(model, goal, &trial.state)?, by_trial)?;
        if again.error < trial.error {
            trial = again;
        }
    }
    let steady = Some(steady.state).filter(|steady| steady.rpm() == trial.rpm);
    Ok(Found { trial, steady })
}

/// Refines speeds at which the flagella touch, up to the first ones that meet the target; those after them are interrupted.
/// By trials alone: steady states often take as long there.
///
/// # Errors
/// [`AimError::Interrupted`] by the user.
fn refine_touching(
    model: &Model,
    table: &Table,
    goal: Goal,
    starts: &[Start],
) -> Result<Vec<Result<Found, AimError>>, AimError> {
    // The attitude scatters there from one pair of speeds to the next, so a solution is not improved further.
    let goal = Goal { close: REACHED, values: TRIALS, ..goal };
    let first = AtomicUsize::new(starts.len());
    let refine = |(i, start): (usize, &Start)| {
        let goes_on = || (model.goes_on)() && i <= first.load(Ordering::Relaxed);
        let model = Model { goes_on: &goes_on, ..*model };
        let derivatives = table.about(start.rpm).derivatives(goal.target, goal.thrust_step_n);
        let trial = improve(goal, start.rpm, derivatives, |rpm| model.trial(rpm).map(|state| (state.attitude, state)))?;
        if trial.error <= REACHED {
            first.fetch_min(i, Ordering::Relaxed);
        }
        Ok(Found { trial, steady: None })
    };
    let mut refined: Vec<_> = starts.par_iter().enumerate().map(refine).collect();
    if !(model.goes_on)() {
        return Err(AimError::Interrupted);
    }
    // Whether a later one has come to its end is chance.
    refined.truncate(first.into_inner() + 1);
    Ok(refined)
}

/// Returns the model's own derivatives of the values with respect to the speeds, 1/rpm.
fn own_derivatives(model: &Model, goal: Goal, state: &State) -> Result<DMatrix<f64>, AimError> {
    let values = |state: &State| goal.target.values(&state.attitude, goal.thrust_step_n);
    let own = values(state);
    let columns: Vec<(f64, Vec<f64>)> = [0, 1]
        .into_par_iter()
        .map(|k| {
            let mut rpm = state.rpm();
            let change = if rpm[k] > 0.0 { -DIFFERENCE } else { DIFFERENCE };
            rpm[k] += change;
            Ok((change, values(&model.trial(rpm)?)))
        })
        .collect::<Result<_, AimError>>()?;
    Ok(DMatrix::from_fn(own.len(), 2, |i, k| (columns[k].1[i] - own[i]) / columns[k].0))
}

fn describe(model: &Model, known: &Known, table: &Table, target: &Target, found: &Found) -> Result<Solution, AimError> {
    let trial = &found.trial.state;
    let about = || -> Result<(State, Interval), AimError> {
        let steady = found.steady.map_or_else(|| model.at(trial.rpm(), [0.0; 2]), Ok)?;
        Ok((State { attitude: trial.attitude, ..steady }, Interval::about(model, known, &steady, &trial.attitude)?))
    };
    let (about, contact_change) = rayon::join(about, || contact::nearest_change(model, table, trial));
    let (state, interval) = about?;
    let attitude = state.attitude;
    Ok(Solution {
        state,
        tilt_deg: attitude.tilt_deg(),
        interval,
        error_deg: target.error_deg(&attitude),
        error_n: target.error_n(&attitude),
        contact_change: contact_change?,
    })
}
