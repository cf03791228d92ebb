//! The nearest speeds at which contact of the flagella begins or ends. The table proposes candidates, and the model
//! verifies them.

use super::error::AimError;
use super::improve::on_board;
use super::model::{Model, State, starts};
use super::table::{Table, distance};
use rayon::prelude::*;
use serde::Serialize;

/// Final bracket width of a change of contact, rpm.
const RESOLUTION: f64 = 4.0;

/// The nearest change of contact.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct ContactChange {
    /// Distance in the plane of both speeds, to within 2 rpm.
    pub rpm: f64,
    /// The speeds of the change.
    pub at_rpm: [f64; 2],
}

/// Returns the nearest change of contact; `None` if the table has none, or if the model does not confirm it.
///
/// # Errors
/// [`AimError::Interrupted`] and [`AimError::TimeOver`].
pub fn nearest_change(model: &Model, table: &Table, state: &State) -> Result<Option<ContactChange>, AimError> {
    let rpm = state.rpm();
    let others = table.rows.iter().filter(|row| row.touches().is_some_and(|touches| touches != state.touches()));
    let Some(other) = others.min_by(|a, b| distance(a.rpm, rpm).total_cmp(&distance(b.rpm, rpm))) else {
        return Ok(None);
    };
    let away = distance(other.rpm, rpm);
    let along = |far: f64| on_board([0, 1].map(|k| rpm[k] + (other.rpm[k] - rpm[k]) * far / away));
    let differs = |far: f64| differs(model, along(far), state.touches());
    // No row nearer than `other` differs. The model verifies this at the end, unless the search has already confirmed a
    // nearer bound.
    let mut same = (away - 1.5 * table.spacing_rpm).max(0.0);
    let mut is_verified = same == 0.0;
    let mut changed = away;
    let mut next = 0.5 * (same + changed);
    let (far, middle) = rayon::join(|| differs(changed), || differs(next));
    if !far? {
        return Ok(None);
    }
    let mut is_changed = middle?;
    loop {
        match (is_changed, next == same) {
            (true, true) => (same, is_verified, changed) = (0.0, true, next),
            (true, false) => changed = next,
            (false, _) => (same, is_verified) = (next, true),
        }
        let is_narrow = changed - same <= RESOLUTION;
        if is_narrow && is_verified {
            break;
        }
        next = if is_narrow { same } else { 0.5 * (same + changed) };
        is_changed = differs(next)?;
    }
    let far = 0.5 * (same + changed);
    Ok(Some(ContactChange { rpm: far, at_rpm: along(far) }))
}

/// Returns whether contact at these speeds, at any of the tried starting phases, differs from `touches`. A failure of
/// the model does not count as a difference.
fn differs(model: &Model, rpm: [f64; 2], touches: bool) -> Result<bool, AimError> {
    let different = |start: &[f64; 2]| match model.touches(rpm, *start) {
        Ok(other) if other != touches => Some(Ok(true)),
        Err(error @ (AimError::Interrupted | AimError::TimeOver)) => Some(Err(error)),
        _ => None,
    };
    starts(rpm).par_iter().find_map_any(different).unwrap_or(Ok(false))
}
