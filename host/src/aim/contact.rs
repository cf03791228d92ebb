//! The nearest speeds at which contact of the flagella begins or ends. The table proposes candidates, and the model
//! verifies them.

use super::error::AimError;
use super::improve::on_board;
use super::model::{Model, State};
use super::table::{Table, distance};
use serde::Serialize;
use sim::phase::{self, Ratio};

/// Number of starting phases to try at speeds where the phase matters.
const PHASES: usize = 4;
/// Accuracy of the speeds of a change of contact, rpm.
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
/// [`AimError::Interrupted`].
pub fn nearest_change(model: &Model, table: &Table, state: &State) -> Result<Option<ContactChange>, AimError> {
    let rpm = state.rpm();
    let others = table.rows().iter().filter(|row| row.touches.is_some_and(|touches| touches != state.touches()));
    let Some(other) = others.min_by(|a, b| distance(a.rpm, rpm).total_cmp(&distance(b.rpm, rpm))) else {
        return Ok(None);
    };
    let away = distance(other.rpm, rpm);
    let along = |far: f64| on_board([0, 1].map(|k| rpm[k] + (other.rpm[k] - rpm[k]) * far / away));
    let differs = |far: f64| differs(model, along(far), state.touches());
    // In the table nothing nearer than a row differs.
    let mut same = (away - 1.5 * table.spacing_rpm()).max(0.0);
    let mut changed = away;
    let (far, near) = rayon::join(|| differs(changed), || if same > 0.0 { differs(same) } else { Ok(false) });
    if !far? {
        return Ok(None);
    }
    if near? {
        (same, changed) = (0.0, same);
    }
    while changed - same > RESOLUTION {
        let middle = 0.5 * (same + changed);
        if differs(middle)? { changed = middle } else { same = middle }
    }
    let far = 0.5 * (same + changed);
    Ok(Some(ContactChange { rpm: far, at_rpm: along(far) }))
}

/// Returns whether contact at these speeds, at any of the tried starting phases, differs from `touches`. A failure of
/// the model does not count as a difference.
fn differs(model: &Model, rpm: [f64; 2], touches: bool) -> Result<bool, AimError> {
    let starts = if Ratio::of(rpm).is_some() { phase::starts(rpm, PHASES) } else { vec![[0.0; 2]] };
    for start in starts {
        match model.touches(rpm, start) {
            Ok(other) if other != touches => return Ok(true),
            Err(AimError::Interrupted) => return Err(AimError::Interrupted),
            _ => {}
        }
    }
    Ok(false)
}
