//! A target: quantities and their desired values.

use super::error::AimError;
use super::quantity::{Attitude, Quantity};
use crate::attitude::wrapped;
use crate::text::word;
use serde::Serialize;
use std::fmt;

/// Desired values of at least two quantities.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Target {
    /// The quantities and their values, degrees or N.
    pub wanted: Vec<(Quantity, f64)>,
}

impl Target {
    /// Returns the target of these quantities and their values, degrees or N. Quantities without a value are left out.
    ///
    /// # Errors
    /// [`AimError::TooFew`] and [`AimError::OutOfRange`].
    pub fn new(asked: impl IntoIterator<Item = (Quantity, Option<f64>)>) -> Result<Self, AimError> {
        let wanted: Vec<_> = asked.into_iter().filter_map(|(quantity, value)| Some((quantity, value?))).collect();
        if wanted.len() < 2 {
            return Err(AimError::TooFew { named: wanted.len() });
        }
        match wanted.iter().find(|(quantity, value)| !quantity.range().contains(value)) {
            Some(&(quantity, value)) => Err(AimError::OutOfRange { quantity, value, range: quantity.range() }),
            None => Ok(Self { wanted }),
        }
    }

    /// Returns the target of yaw, pitch, roll, tilt (degrees) and thrust (N); `None` for a quantity that is not part of it.
    ///
    /// # Errors
    /// As [`Target::new`].
    pub fn of([yaw, pitch, roll, tilt, thrust]: [Option<f64>; 5]) -> Result<Self, AimError> {
        use Quantity::{Pitch, Roll, Thrust, Tilt, Yaw};
        Self::new([(Yaw, yaw), (Pitch, pitch), (Roll, roll), (Tilt, tilt), (Thrust, thrust)])
    }

    /// Returns the target's quantities of an attitude: degrees, and the thrust in steps of `thrust_step_n`.
    pub fn values(&self, attitude: &Attitude, thrust_step_n: f64) -> Vec<f64> {
        let scaled = |quantity: Quantity| match quantity {
            Quantity::Thrust => attitude.thrust_n / thrust_step_n,
            _ => quantity.of(attitude),
        };
        self.wanted.iter().map(|(quantity, _)| scaled(*quantity)).collect()
    }

    /// Returns the error of each value; the yaw's error goes the shorter way round.
    pub fn misses(&self, attitude: &Attitude, thrust_step_n: f64) -> Vec<f64> {
        let values = self.values(attitude, thrust_step_n);
        let miss = |((quantity, wanted), value): (&(Quantity, f64), f64)| match quantity {
            Quantity::Yaw => wrapped(wanted - value),
            Quantity::Thrust => wanted / thrust_step_n - value,
            _ => wanted - value,
        };
        self.wanted.iter().zip(values).map(miss).collect()
    }

    /// Returns the largest error of an angle, degrees.
    pub fn error_deg(&self, attitude: &Attitude) -> f64 {
        let angles = Self { wanted: self.wanted.iter().copied().filter(|(q, _)| *q != Quantity::Thrust).collect() };
        largest(&angles.misses(attitude, 1.0))
    }

    /// Returns the error of the thrust, N; `None` if it is not in the target.
    pub fn error_n(&self, attitude: &Attitude) -> Option<f64> {
        let (_, wanted) = self.wanted.iter().find(|(quantity, _)| *quantity == Quantity::Thrust)?;
        Some((wanted - attitude.thrust_n).abs())
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = self.wanted.iter().map(|(quantity, value)| match quantity {
            Quantity::Thrust => format!("thrust {value} N"),
            _ => format!("{} {value}°", word(quantity)),
        });
        f.write_str(&parts.collect::<Vec<_>>().join(", "))
    }
}

/// Returns the largest absolute value.
pub fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| largest.max(value.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_has_two_possible_values() {
        let target = |pitch, thrust| {
            Target::new([(Quantity::Yaw, Some(-67.0)), (Quantity::Pitch, pitch), (Quantity::Thrust, thrust)])
        };
        assert_eq!(target(Some(-4.0), Some(0.01)).unwrap().to_string(), "yaw -67°, pitch -4°, thrust 0.01 N");
        assert!(matches!(target(None, None), Err(AimError::TooFew { named: 1 })));
        for value in [90.5, f64::NAN] {
            let error = target(Some(value), None).unwrap_err();
            assert_eq!(error.to_string(), format!("pitch cannot be {value}"));
        }
    }

    #[test]
    fn a_yaw_is_met_by_any_number_of_turns_more() {
        let target = Target { wanted: vec![(Quantity::Yaw, 175.0), (Quantity::Tilt, 5.0)] };
        let attitude = Attitude { yaw_deg: -184.0, pitch_deg: 3.0, roll_deg: -4.0, thrust_n: 0.01 };
        let misses = target.misses(&attitude, 1.0);
        assert!((misses[0] + 1.0).abs() < 1e-9, "{misses:?}");
        // Pitch and roll of a small tilt add in quadrature.
        assert!(misses[1].abs() < 0.01, "{misses:?}");
        assert!((target.error_deg(&attitude) - 1.0).abs() < 1e-9);
        assert_eq!(target.error_n(&attitude), None);
    }
}
