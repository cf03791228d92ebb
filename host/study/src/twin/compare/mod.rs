//! Compares measured and modelled attitude over a trial.
//!
//! Both are put on a common clock, which is zero when the motors start, and expressed relative to the still phase
//! before the run ([`crate::trial::Zeroed`]). Errors are modelled minus measured values. Steady states and transients are
//! judged separately.

mod aligned;
mod comparison;
mod compatibility;
mod frame;
mod json;
mod pair;
mod shift;
mod sides;
mod steady;
mod transient;
mod verdict;

pub use comparison::{
    AngleComparison, Comparison, Difference, Limit, Point, Settling, Transient, Uncertainty, Unjudged,
};
pub use compatibility::Maker;
pub use pair::is_replay_of;
pub use sides::Sides;

use super::TwinError;
use crate::trial::Judged;
use aligned::Aligned;
use compatibility::difference;
use pair::{Pair, Side};
use sim::accuracy::ModelError;
use std::path::Path;
use steady::SteadyPair;
use transient::{Blocks, settling};

const ANGLES: [&str; 3] = ["yaw", "pitch", "roll"];

/// How to handle trials of different robots or closures.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum OnMismatch {
    /// Refuse to compare them.
    #[default]
    Reject,
    /// Compare them with a warning.
    Warn,
    /// Compare them without a warning: the user named the other robot or closure.
    Accept,
}

impl OnMismatch {
    /// Returns what follows from the user's choices: another robot or closure, or `--anyway`.
    pub fn of(is_chosen: bool, anyway: bool) -> Self {
        match (is_chosen, anyway) {
            (true, _) => Self::Accept,
            (false, true) => Self::Warn,
            (false, false) => Self::Reject,
        }
    }

    /// Returns the warning about two logs or sessions that are shown together despite this difference, if there is one.
    ///
    /// # Errors
    /// [`TwinError::Incomparable`] if they must not be.
    pub fn warning(self, difference: Option<String>, paths: [&Path; 2]) -> Result<Option<String>, TwinError> {
        match (self, difference) {
            (Self::Reject, Some(reason)) => {
                Err(TwinError::incomparable(paths, reason, "compare them anyway with --anyway"))
            }
            (Self::Warn, difference) => Ok(difference),
            _ => Ok(None),
        }
    }
}

/// A comparison, with the data shown on the page.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The results.
    pub comparison: Comparison,
    /// Both attitudes over time, 20 points per second, from the still phase to the end of their common time.
    pub points: Vec<Point>,
}

/// Compares a trial with another modelled or measured trial.
///
/// # Errors
/// [`TwinError::Incomparable`] if the trials do not match or overlap, [`TwinError::Unusable`] if one of them has no
/// run.
pub fn compare(a: &Judged, b: &Judged, on_mismatch: OnMismatch) -> Result<Compared, TwinError> {
    let pair = Pair::new(a, b)?;
    let (a, b) = (&a.data, &b.data);
    let mut warnings = Vec::from_iter(on_mismatch.warning(difference(a, b)?, [&a.path, &b.path])?);
    let apart = || {
        let reason = "their runs do not overlap".to_owned();
        TwinError::incomparable([&a.path, &b.path], reason, "name logs whose runs overlap")
    };
    let mut aligned = Aligned::new(&pair).ok_or_else(apart)?;
    if let Some([one, other]) = aligned.lengths_s {
        let common_s = aligned.common_s;
        warnings.push(format!("the runs last {one:.1} s and {other:.1} s; the first {common_s:.1} s are compared"));
    }
    let mut steady = SteadyPair::new(&pair, &aligned);
    let turns = steady.missing_turns(&pair);
    if turns != 0.0 {
        warnings.push(format!("the yaw is assumed to have made {turns} full turns in a gap of the log"));
        steady.modelled_deg[0] -= 360.0 * turns;
        aligned.modelled_deg.iter_mut().for_each(|deg| deg[0] -= 360.0 * turns);
    }
    warnings.extend(frame::cause(&pair, &aligned));
    let points = points(&pair.measured, &aligned);
    let comparison = result(&pair, &aligned, &steady, warnings);
    Ok(Compared { comparison, points })
}

/// Collects the result of a comparison.
fn result(pair: &Pair, aligned: &Aligned, steady: &SteadyPair, warnings: Vec<String>) -> Comparison {
    let Pair { measured, modelled } = pair;
    let (a, b) = (measured.data, modelled.data);
    let model = (a.is_real() && b.is_model()).then(|| b.robot().ok()).flatten().map(|robot| ModelError::of(&robot));
    let model_error_deg = model.as_ref().map(|model| model.of_modelled_deg(steady.modelled_deg));
    let blocks = Blocks::new(pair, aligned, &steady.window);
    let budgets = steady.budgets(pair);
    let angle = |k: usize| {
        let uncertainty = budgets[k].as_ref().map(|(budget, _)| Uncertainty::of(budget));
        let (budget, other_u_deg) = budgets[k].clone().unwrap_or_default();
        let transient = blocks.as_ref().ok().zip(uncertainty);
        AngleComparison {
            angle: ANGLES[k],
            measured_deg: steady.measured_deg[k],
            modelled_deg: steady.modelled_deg[k],
            error_deg: steady.error_deg()[k],
            uncertainty,
            model_error_deg: model_error_deg.map(|deg| deg[k]),
            rmse_deg: aligned.rmse_deg(k),
            transient: transient.and_then(|(blocks, uncertainty)| blocks.transient(k, uncertainty, model.as_ref())),
            budget,
            other_u_deg,
            ..AngleComparison::default()
        }
        .judged()
    };
    let angles = [0, 1, 2].map(angle);
    let differences = angles.iter().filter_map(AngleComparison::difference).collect();
    let budget = angles.iter().flat_map(|angle| angle.budget.terms_of(angle.angle)).collect();
    let trial = a.trial();
    let middle_s = measured.start_s + 0.5 * (steady.window.start + steady.window.end);
    let comparison = Comparison {
        name: trial.name,
        w1_rpm: trial.w1_rpm,
        w2_rpm: trial.w2_rpm,
        measured: a.path.clone(),
        modelled: b.path.clone(),
        angles,
        unjudged: blocks.as_ref().err().copied(),
        settling: settling(pair, aligned, blocks.as_ref().ok()),
        compared_share: aligned.share(),
        yaw_drift_deg: measured.zeroed.yaw_drift(middle_s),
        measured_zero_deg: measured.zeroed.zero_deg,
        modelled_zero_deg: modelled.zeroed.zero_deg,
        time_shift_s: aligned.shift_s,
        run_start_s: [measured.start_s, modelled.start_s],
        budget,
        differences,
        is_beyond_chance: false,
        findings: [&measured.findings[..], &modelled.findings].concat(),
        sides: Sides::of(a, b),
        other: if pair.is_replay() { "replay" } else { Sides::of(a, b).names()[1] },
        origin: [a, b].map(|data| data.origin().name()),
        verdict: String::new(),
        warnings,
        sensors: pair.sensors(),
    };
    Comparison { verdict: verdict::verdict(&comparison), ..comparison }
}

fn points(measured: &Side, aligned: &Aligned) -> Vec<Point> {
    let Side { zeroed, start_s, .. } = measured;
    let point = |i: usize| Point {
        time_s: aligned.times_s[i],
        measured_deg: aligned.measured_deg[i],
        modelled_deg: aligned.modelled_deg[i],
        yaw_uncertainty_deg: zeroed.yaw_uncertainty(start_s + aligned.times_s[i]).unwrap_or(f64::NAN),
    };
    (0..aligned.times_s.len()).map(point).collect()
}
