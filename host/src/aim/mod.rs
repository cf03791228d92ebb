//! Finds motor speeds for an attitude: the inverse of a robot's map.
//!
//! A [`Table`] gives initial speeds: the built-in map of the robot `physical`, or that of a sweep. The model of the
//! robot refines them (`improve`). Every returned attitude is a steady state of the model at the returned speeds, never
//! a value of the table. So the table of another robot costs time, but not accuracy.

mod contact;
mod error;
mod improve;
mod interval;
mod model;
mod plan;
mod quantity;
mod read;
mod table;
mod target;

pub use contact::ContactChange;
pub use error::AimError;
pub use interval::Interval;
pub use model::{Model, State};
pub use plan::plan;
pub use quantity::{Attitude, Quantity};
pub use read::{Columns, load, of_columns, shipped};
pub use table::Table;
pub use target::Target;

use crate::twin::calibrate::StdError;
use improve::{Best, Goal, improve};
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;
use sim::accuracy::ModelError;
use table::distance;

/// Largest error of a solution, degrees.
pub const REACHED: f64 = 0.3;

/// Speeds of the table whose error is below this, degrees, are refined with the model.
const WORTH: f64 = 5.0;
/// Largest number of initial speeds to refine.
const STARTS: usize = 4;
/// Speeds closer than this count as the same, rpm.
const APART: f64 = 4.0;
/// Difference of speeds for derivatives of the model, rpm.
const DIFFERENCE: f64 = 2.0;

/// Speeds and their steady state in the model.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Solution {
    /// The steady state.
    #[serde(flatten)]
    pub state: State,
    /// Angle between the robot's axis and the vertical.
    pub tilt_deg: f64,
    /// 95 % intervals.
    #[serde(flatten)]
    pub interval: Interval,
    /// Error of the model in yaw, pitch and roll; it is not in the intervals ([`sim::accuracy`]).
    pub model_error_deg: [f64; 3],
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
    /// Whether there are solutions.
    pub reachable: bool,
    /// Speeds at which the target is met, the nearest first.
    pub solutions: Vec<Solution>,
    /// The nearest attitude that was found, if there is no solution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest: Option<Solution>,
}

/// Finds speeds for a target. `errors`: standard errors of the robot's parameters.
///
/// # Errors
/// [`AimError::Model`] if the model fails wherever it was tried, and [`AimError::Interrupted`].
pub fn aim(model: &Model, errors: &[StdError], table: &Table, target: &Target) -> Result<Aimed, AimError> {
    let goal = Goal { target, thrust_step_n: table.thrust_step_n() };
    let starts = propose(table, goal)?;
    let by_model = |start: [f64; 2], derivatives: DMatrix<f64>| {
        improve(goal, start, derivatives, |rpm| model.at(rpm, [0.0; 2]).map(|state| (state.attitude, state)))
    };
    let from_table = |start: &[f64; 2]| {
        let derivatives = table.about(*start).derivatives(target, goal.thrust_step_n);
        by_model(*start, derivatives)
    };
    let mut found: Vec<Best<State>> = Vec::new();
    let mut failed = None;
    for result in starts.par_iter().map(from_table).collect::<Vec<_>>() {
        match result {
            Ok(best) => found.push(best),
            Err(AimError::Interrupted) => return Err(AimError::Interrupted),
            Err(error) => failed = Some(error),
        }
    }
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    let Some(mut best) = found.first().cloned() else {
        return Err(failed.unwrap_or(AimError::TooSmall { rows: table.rows().len() }));
    };
    if best.error > REACHED {
        // The derivatives of the table may be those of another robot.
        let again = by_model(best.rpm, derivatives(model, goal, &best.state)?)?;
        if again.error < best.error {
            best = again;
        }
        found = vec![best.clone()];
    }
    let mut solutions: Vec<Best<State>> = Vec::new();
    for candidate in found.into_iter().filter(|candidate| candidate.error <= REACHED) {
        if solutions.iter().all(|other| distance(other.rpm, candidate.rpm) > APART) {
            solutions.push(candidate);
        }
    }
    let describe = |best: &Best<State>| describe(model, errors, table, target, &best.state);
    let solutions: Vec<Solution> = solutions.par_iter().map(describe).collect::<Result<_, _>>()?;
    let reachable = !solutions.is_empty();
    let nearest = if reachable { None } else { Some(describe(&best)?) };
    Ok(Aimed { reachable, solutions, nearest })
}

/// Returns speeds that meet the target in the table, or come near, the best first.
fn propose(table: &Table, goal: Goal) -> Result<Vec<[f64; 2]>, AimError> {
    let in_table = |row: [f64; 2]| {
        let derivatives = table.about(row).derivatives(goal.target, goal.thrust_step_n);
        improve(goal, row, derivatives, |rpm| Ok((table.about(rpm).at(rpm), ())))
    };
    let rows = table.nearest(goal.target);
    let mut found: Vec<Best<()>> = rows.into_par_iter().map(|row| in_table(row.rpm)).collect::<Result<_, _>>()?;
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    let mut starts: Vec<[f64; 2]> = Vec::new();
    for best in found {
        let is_worth = starts.is_empty() || best.error < WORTH;
        if is_worth && starts.len() < STARTS && starts.iter().all(|start| distance(*start, best.rpm) > APART) {
            starts.push(best.rpm);
        }
    }
    Ok(starts)
}

/// Returns the model's own derivatives of the values with respect to the speeds, 1/rpm.
fn derivatives(model: &Model, goal: Goal, state: &State) -> Result<DMatrix<f64>, AimError> {
    let values = |state: &State| goal.target.values(&state.attitude, goal.thrust_step_n);
    let own = values(state);
    let columns: Vec<(f64, Vec<f64>)> = [0, 1]
        .into_par_iter()
        .map(|k| {
            let mut rpm = state.rpm();
            let change = if rpm[k] > 0.0 { -DIFFERENCE } else { DIFFERENCE };
            rpm[k] += change;
            Ok((change, values(&model.at(rpm, [0.0; 2])?)))
        })
        .collect::<Result<_, AimError>>()?;
    Ok(DMatrix::from_fn(own.len(), 2, |i, k| (columns[k].1[i] - own[i]) / columns[k].0))
}

fn describe(
    model: &Model,
    errors: &[StdError],
    table: &Table,
    target: &Target,
    state: &State,
) -> Result<Solution, AimError> {
    let (interval, contact_change) =
        rayon::join(|| Interval::about(model, errors, state), || contact::nearest_change(model, table, state));
    let Attitude { yaw_deg, pitch_deg, roll_deg, .. } = state.attitude;
    Ok(Solution {
        state: *state,
        tilt_deg: state.attitude.tilt_deg(),
        interval: interval?,
        model_error_deg: ModelError::of(model.robot).of_angles_deg([yaw_deg, pitch_deg, roll_deg]),
        error_deg: target.error_deg(&state.attitude),
        error_n: target.error_n(&state.attitude),
        contact_change: contact_change?,
    })
}
