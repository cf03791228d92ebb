//! Speeds for an attitude from a table, without the model: the start of a search, and the feed-forward of a controller.

use super::error::AimError;
use super::improve::{Goal, VALUES};
use super::quantity::Attitude;
use super::table::Table;
use super::target::Target;
use super::{CLOSE, Start, propose};
use nalgebra::DMatrix;

/// Largest change of the speeds with which a controller corrects an attitude by one degree, rpm.
pub const STEEPEST_RPM: f64 = 40.0;

/// The speeds of a table that come nearest to a target.
#[derive(Clone, PartialEq, Debug)]
pub struct Nearest {
    /// The speeds.
    pub rpm: [f64; 2],
    /// The table's attitude at these speeds.
    pub attitude: Attitude,
    /// Largest error of the target's angles, degrees.
    pub error_deg: f64,
    /// Share of the time in which the flagella touch at the nearest speeds of the table.
    pub contact_share: f64,
    /// Derivatives of the target's quantities with respect to the speeds, 1/rpm, one row per quantity.
    pub derivatives: DMatrix<f64>,
}

/// Returns the speeds that come nearest to a target in the table.
///
/// It prefers candidates where every quantity of the target responds to the speeds, and of these the one with the least
/// contact: in contact the attitude depends irregularly on the speeds.
///
/// # Errors
/// [`AimError::TooSmall`].
pub fn nearest(table: &Table, target: &Target) -> Result<Nearest, AimError> {
    let thrust_step_n = table.thrust_step_n;
    let starts = propose(table, Goal { target, thrust_step_n, close: CLOSE, values: VALUES })?;
    let found = starts.iter().map(|start| {
        let about = table.about(start.rpm);
        let attitude = about.at(start.rpm);
        let error_deg = target.error_deg(&attitude);
        let derivatives = about.derivatives(target, thrust_step_n);
        Nearest { rpm: start.rpm, attitude, error_deg, contact_share: start.contact_share, derivatives }
    });
    let by_rank = |(start, found): &(&Start, Nearest)| (start.is_unlikely, !found.answers());
    let first = (starts.iter().zip(found))
        .min_by(|a, b| by_rank(a).cmp(&by_rank(b)).then(a.1.contact_share.total_cmp(&b.1.contact_share)));
    first.map(|(_, found)| found).ok_or(AimError::TooSmall { rows: table.rows.len() })
}

impl Nearest {
    /// Returns whether a change of the speeds by [`STEEPEST_RPM`] or less corrects each quantity of the target by one
    /// degree.
    fn answers(&self) -> bool {
        self.derivatives.singular_values().iter().all(|value| value * STEEPEST_RPM >= 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Quantity, shipped};
    use super::*;

    #[test]
    fn table_gives_speeds_and_derivatives_of_a_reachable_attitude() {
        let target = Target::new([(Quantity::Yaw, Some(-67.0)), (Quantity::Pitch, Some(-4.0))]).unwrap();
        let found = nearest(&shipped().unwrap(), &target).unwrap();
        assert!(found.error_deg < CLOSE, "{found:?}");
        // Both motors turn the base the other way; the faster one tilts it.
        let of = |quantity: usize, motor: usize| found.derivatives[(quantity, motor)];
        assert!(of(0, 0) < -0.5 && of(0, 1) < -0.5 && of(1, 0) < -0.03 && of(1, 1) > 0.03, "{found:?}");
    }

    #[test]
    fn of_several_speeds_those_come_first_about_which_yaw_and_pitch_answer() {
        // At other speeds that the table gives for this target, (54.63, -83.83) rpm, a degree of pitch needs 1000 rpm.
        let target = Target::new([(Quantity::Yaw, Some(61.4)), (Quantity::Pitch, Some(3.3))]).unwrap();
        let table = shipped().unwrap();
        let found = nearest(&table, &target).unwrap();
        assert!(found.error_deg < CLOSE && found.answers(), "{found:?}");
        assert!(found.contact_share < 0.2, "{found:?}");
    }
}
