//! Speeds for an attitude by a table alone, without the model: the start of a search, and the feed-forward of a controller.

use super::error::AimError;
use super::improve::{Goal, VALUES};
use super::quantity::Attitude;
use super::table::Table;
use super::target::Target;
use super::{CLOSE, propose};
use nalgebra::DMatrix;

/// The speeds of a table that come nearest to a target.
#[derive(Clone, PartialEq, Debug)]
pub struct Nearest {
    /// The speeds.
    pub rpm: [f64; 2],
    /// The attitude at these speeds by the table.
    pub attitude: Attitude,
    /// Largest error of a wanted angle, degrees.
    pub error_deg: f64,
    /// Derivatives of the wanted values with respect to the speeds, 1/rpm, one row a quantity.
    pub derivatives: DMatrix<f64>,
}

/// Returns the speeds that come nearest to a target by the table; flagella that are apart come first.
///
/// # Errors
/// [`AimError::TooSmall`].
pub fn nearest(table: &Table, target: &Target) -> Result<Nearest, AimError> {
    let thrust_step_n = table.thrust_step_n();
    let starts = propose(table, Goal { target, thrust_step_n, close: CLOSE, values: VALUES })?;
    let Some(start) = starts.first() else { return Err(AimError::TooSmall { rows: table.rows().len() }) };
    let about = table.about(start.rpm);
    let attitude = about.at(start.rpm);
    Ok(Nearest {
        rpm: start.rpm,
        attitude,
        error_deg: target.error_deg(&attitude),
        derivatives: about.derivatives(target, thrust_step_n),
    })
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
}
