//! Finds motor speeds for an attitude: the inverse of a robot's map.
//!
//! A [`Table`] gives initial speeds: the built-in map of the robot `physical`, or the table of a sweep. The model of
//! the robot refines them (`improve`), first by its steady states and then by whole trials. Every returned attitude is
//! the final attitude of a whole trial of the model at the returned speeds, never a value of the table. So the table of
//! another robot costs time, but not accuracy.
//!
//! All pairs of speeds that the table gives for the attitude are refined. Where the flagella touch, a trial takes up to a
//! hundred times as long as elsewhere, and the attitude may depend on the speeds irregularly: these pairs come last. A
//! search has a time limit. After it, the result is partial, and lists the missing parts ([`Aimed::unfinished`],
//! [`Solution::unknown`]).

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
pub use nearest::{Nearest, STEEPEST_RPM, nearest};
pub use plan::plan;
pub use quantity::{Attitude, Quantity};
pub use read::{Columns, MAP, load, of_columns, shipped};
pub use table::Table;
pub use target::Target;

use improve::{Best, Goal, VALUES, improve};
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;
use sim::steady::Kind;
use std::time::{Duration, Instant};
use table::distance;

/// Largest error of a solution in a whole trial, degrees.
pub const REACHED: f64 = 0.5;

/// Error of a whole trial below which speeds are not refined further, degrees.
const GOOD: f64 = 0.3;
/// Error of steady states below which they are near enough for whole trials, degrees.
const CLOSE: f64 = 0.1;
/// The model refines speeds of the table with an error below this, degrees.
const WORTH: f64 = 5.0;
/// Speeds are refined after the others if their error in the table exceeds the smallest one by more than this, degrees.
const LIKELY: f64 = 1.0;
/// Largest number of initial speeds to refine.
const STARTS: usize = 4;
/// Most trials from the same initial speeds if the flagella touch.
const TRIALS: usize = 5;
/// Speeds closer than this count as the same, rpm.
const APART: f64 = 4.0;
/// Difference of speeds for derivatives of the model, rpm.
const DIFFERENCE: f64 = 2.0;
/// Share of the time limit for the speeds. The rest is for the intervals and the changes of contact.
const FOR_SPEEDS: f64 = 0.75;

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
    /// Largest error of the target's angles.
    pub error_deg: f64,
    /// Error of the thrust, if it is a target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_n: Option<f64>,
    /// Where the flagella begin or cease to touch.
    pub contact_change: Option<ContactChange>,
    /// Parts that the model has not computed in time; their values are `None`.
    pub unknown: Vec<Unknown>,
}

/// A part of a [`Solution`] that may be unknown.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "snake_case")]
pub enum Unknown {
    /// The intervals of the angles.
    Intervals,
    /// The nearest change of contact.
    ContactChange,
}

/// Speeds from the table, with the table's attitude there.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct Proposal {
    /// Speed of flagellum 1.
    pub w1_rpm: f64,
    /// Speed of flagellum 2.
    pub w2_rpm: f64,
    /// The attitude and the thrust by the table.
    #[serde(flatten)]
    pub attitude: Attitude,
}

/// Result of [`aim()`].
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Aimed {
    /// Whether solutions were found. A search from a table may miss some, so even without solutions, speeds may exist.
    pub reachable: bool,
    /// Confidence of the intervals; `None` if it cannot be stated.
    pub confidence: Option<f64>,
    /// Reasons for no confidence.
    pub doubts: Vec<Doubt>,
    /// Speeds at which the target is met, the nearest first. The means of each are known.
    pub solutions: Vec<Solution>,
    /// The nearest attitude of a whole trial, if there is no solution; its means need not be known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest: Option<Solution>,
    /// Speeds that were not refined in time: the target may or may not be met near them.
    pub unfinished: Vec<Proposal>,
}

impl Aimed {
    /// Returns whether everything was computed in time.
    pub fn is_complete(&self) -> bool {
        let described = self.solutions.iter().chain(&self.nearest);
        self.unfinished.is_empty() && described.into_iter().all(|solution| solution.unknown.is_empty())
    }
}

/// Speeds to refine.
struct Start {
    rpm: [f64; 2],
    /// Whether the error in the table exceeds the smallest one by more than [`LIKELY`].
    is_unlikely: bool,
    /// Share of the time in which the flagella touch, from the table.
    contact_share: f64,
}

impl Start {
    fn touches(&self) -> bool {
        self.contact_share > 0.0
    }

    /// Starts of a later rank are refined after all earlier ones.
    fn rank(&self) -> [bool; 2] {
        [self.touches(), self.is_unlikely]
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

/// Finds speeds for a target within the time `longest`. `known`: what is known about the robot's parameters.
///
/// # Errors
/// [`AimError::Model`] if the model fails at all speeds tried, and [`AimError::Interrupted`].
pub fn aim(model: &Model, known: &Known, table: &Table, target: &Target, longest: Duration) -> Result<Aimed, AimError> {
    let begun = Instant::now();
    let until = |share: f64| Model { until: begun.checked_add(longest.mul_f64(share)), ..*model };
    let (model, whole) = (until(FOR_SPEEDS), until(1.0));
    let describe = |found: &Found| describe(&whole, known, table, target, found);
    let goal = Goal { target, thrust_step_n: table.thrust_step_n, close: GOOD, values: VALUES };
    let starts = propose(table, goal)?;
    let mut nearest: Option<Found> = None;
    let mut solutions: Vec<(f64, Solution)> = Vec::new();
    let mut unfinished = Vec::new();
    let mut failed = None;
    for group in starts.chunk_by(|a, b| a.rank() == b.rank()) {
        let refined: Vec<_> = group.par_iter().map(|start| refine(&model, table, goal, start)).collect();
        let mut found: Vec<Found> = Vec::new();
        for (start, result) in group.iter().zip(refined) {
            let is_finished = |found: &Found| found.trial.error <= REACHED || !found.trial.is_cut_short;
            if !result.as_ref().map_or_else(|error| !matches!(error, AimError::TimeOver), is_finished) {
                let [w1_rpm, w2_rpm] = start.rpm;
                unfinished.push(Proposal { w1_rpm, w2_rpm, attitude: table.about(start.rpm).at(start.rpm) });
            }
            match result {
                Ok(refined) => found.push(refined),
                Err(AimError::Interrupted) => return Err(AimError::Interrupted),
                Err(AimError::TimeOver) => {}
                Err(error) => failed = Some(error),
            }
        }
        found.sort_by(|a, b| a.trial.error.total_cmp(&b.trial.error));
        let is_nearer = |best: &&Found| nearest.as_ref().is_none_or(|other| best.trial.error < other.trial.error);
        nearest = found.first().filter(is_nearer).cloned().or(nearest);
        let mut new: Vec<Found> = Vec::new();
        for candidate in found.into_iter().filter(|candidate| candidate.trial.error <= REACHED) {
            let of_new = new.iter().map(|other| other.trial.rpm);
            let mut others = solutions.iter().map(|(_, solution)| solution.state.rpm()).chain(of_new);
            if others.all(|rpm| distance(rpm, candidate.trial.rpm) > APART) {
                new.push(candidate);
            }
        }
        let described = new.par_iter().map(|found| Ok((found.trial.error, describe(found)?)));
        solutions.extend(described.collect::<Result<Vec<_>, AimError>>()?);
    }
    solutions.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A state whose means are not known does not meet the target.
    let solutions = solutions.into_iter().map(|(_, solution)| solution);
    let (solutions, unknown): (Vec<_>, Vec<_>) = solutions.partition(|found| found.state.kind < Kind::NotFound);
    let nearest = match nearest {
        Some(nearest) if solutions.is_empty() => {
            Some(unknown.into_iter().next().map_or_else(|| describe(&nearest), Ok)?)
        }
        None if unfinished.is_empty() => {
            return Err(failed.unwrap_or(AimError::TooSmall { rows: table.rows.len() }));
        }
        _ => None,
    };
    let reachable = !solutions.is_empty();
    let (confidence, doubts) = (known.confidence(), known.doubts.clone());
    Ok(Aimed { reachable, confidence, doubts, solutions, nearest, unfinished })
}

/// Returns speeds that meet the target in the table, or come near it, in the order in which to refine them.
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
            let contact_share = table.contact_share(rpm);
            starts.push(Start { rpm, is_unlikely: error > least + LIKELY, contact_share });
        }
    }
    starts.sort_by_key(Start::rank);
    Ok(starts)
}

/// Refines speeds.
fn refine(model: &Model, table: &Table, goal: Goal, start: &Start) -> Result<Found, AimError> {
    let derivatives = table.about(start.rpm).derivatives(goal.target, goal.thrust_step_n);
    let by_trial = |rpm: [f64; 2]| model.trial(rpm).map(|state| (state.attitude, state));
    if start.touches() {
        // Only by trials, because steady states often take as long there. The attitude scatters from one pair of speeds
        // to the next, so a solution is not improved further.
        let goal = Goal { close: REACHED, values: TRIALS, ..goal };
        return Ok(Found { trial: improve(goal, start.rpm, derivatives, by_trial)?, steady: None });
    }
    let by_steady = |rpm: [f64; 2]| model.at(rpm, [0.0; 2]).map(|state| (state.attitude, state));
    let steady = improve(Goal { close: CLOSE, ..goal }, start.rpm, derivatives, by_steady)?;
    let mut trial = improve(goal, steady.rpm, steady.derivatives, by_trial)?;
    if trial.error > REACHED && !trial.state.touches() && !trial.is_cut_short {
        // The table's derivatives may belong to another robot.
        let by_own = own_derivatives(model, goal, &trial.state).and_then(|own| improve(goal, trial.rpm, own, by_trial));
        match by_own {
            Ok(again) if again.error < trial.error => trial = again,
            Ok(again) => trial.is_cut_short = again.is_cut_short,
            Err(AimError::TimeOver) => trial.is_cut_short = true,
            Err(error) => return Err(error),
        }
    }
    let steady = Some(steady.state).filter(|steady| steady.rpm() == trial.rpm);
    Ok(Found { trial, steady })
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
    let mut unknown = Vec::new();
    let (state, interval) = match about {
        // At another phase, or with another value of a fitted parameter, the robot may turn over.
        Err(AimError::TimeOver | AimError::Overturned(_)) => {
            unknown.push(Unknown::Intervals);
            (*trial, Interval::unknown(known, &trial.attitude))
        }
        about => about?,
    };
    let contact_change = match contact_change {
        Err(AimError::TimeOver) => {
            unknown.push(Unknown::ContactChange);
            None
        }
        contact_change => contact_change?,
    };
    let attitude = state.attitude;
    Ok(Solution {
        state,
        tilt_deg: attitude.tilt_deg(),
        interval,
        error_deg: target.error_deg(&attitude),
        error_n: target.error_n(&attitude),
        contact_change,
        unknown,
    })
}
