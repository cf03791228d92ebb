//! The uncertainty of an angle over times, with the sign of each sensor error, as in a [`super::Budget`].

use crate::sensor::{GROUPS, PARAMETERS};
use nalgebra::DMatrix;

/// Number of errors shared by all trials of a sensor: [`crate::sensor::Sensor::parameters`], and the rate of the
/// board's clock.
pub const SENSOR_ERRORS: usize = PARAMETERS + 1;

/// Returns the name of one of these errors, as in budgets.
pub fn sensor_error(index: usize) -> &'static str {
    GROUPS.iter().find(|group| group.range.contains(&index)).map_or("clock", |group| group.name)
}

/// The uncertainty of an angle over times.
#[derive(Clone, PartialEq, Debug)]
pub struct OverTime {
    /// Covariance between the times due to the trial's own errors, degrees².
    pub own: DMatrix<f64>,
    /// Effect of one standard uncertainty of each error of the sensor at each time, degrees.
    pub effects: DMatrix<f64>,
    /// Variance of the noise of a mean over [`super::BLOCK_S`] that the covariance does not contain, degrees².
    pub block_variance: f64,
}

impl OverTime {
    /// Returns the uncertainty of an exact angle.
    pub fn exact(times: usize) -> Self {
        let zeros = |columns: usize| DMatrix::zeros(times, columns);
        Self { own: zeros(times), effects: zeros(SENSOR_ERRORS), block_variance: 0.0 }
    }

    /// Returns the covariance of the difference between two angles' means over blocks around the times, degrees².
    /// `noise`: the share of [`Self::block_variance`] in the mean of a block, smaller for longer blocks.
    pub fn of_difference(one: &Self, other: &Self, is_same_sensor: bool, noise: f64) -> DMatrix<f64> {
        let common = if is_same_sensor {
            let effects = &other.effects - &one.effects;
            &effects * effects.transpose()
        } else {
            &one.effects * one.effects.transpose() + &other.effects * other.effects.transpose()
        };
        let count = one.own.nrows();
        let noise = DMatrix::from_diagonal_element(count, count, noise * (one.block_variance + other.block_variance));
        &one.own + &other.own + common + noise
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariance_over_time_cancels_as_the_budget_does() {
        let at = |scale: [f64; 2]| OverTime {
            own: DMatrix::from_element(2, 2, 0.09),
            effects: DMatrix::from_fn(2, SENSOR_ERRORS, |i, k| if k == 2 { scale[i] } else { 0.0 }),
            block_variance: 0.01,
        };
        let (one, other) = (at([1.0, 2.0]), at([1.0, 2.2]));
        let same = OverTime::of_difference(&one, &other, true, 1.0);
        assert!((same[(0, 0)] - 0.20).abs() < 1e-12 && (same[(1, 1)] - 0.24).abs() < 1e-12, "{same}");
        let model = OverTime::of_difference(&one, &OverTime::exact(2), false, 0.5);
        assert!((model[(0, 1)] - (&one.own + &one.effects * one.effects.transpose())[(0, 1)]).abs() < 1e-12);
    }
}
