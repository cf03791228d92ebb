//! The errors of a trial's blocks: the errors of the sensor, the solver and the clocks, and the remaining error.

use super::Blocks;
use crate::sensor::index::MOUNTING_YAW;
use crate::trial::{Data, OverTime};
use crate::twin::sensor_key::SensorKey;
use nalgebra::{DMatrix, DVector};
use sim::functions::{cos, powi};
use std::f64::consts::TAU;

/// Standard deviation of the difference between the clocks of attitude and motors, s: about the error of the delay of
/// the sensor's filter.
const TIMING_S: f64 = 0.002;

/// The same of an import whose run is told and not measured: to about a tenth of a second (95 %).
const TIMING_OF_RUN_S: f64 = 0.05;

/// Relative standard deviation of the solver's error of an angle: mean forces have an error of some tenths of a per
/// cent from tolerance and steps.
const SOLVER_ERROR: f64 = 0.005;

/// The stated errors of yaw, pitch and roll of a trial's blocks.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct TrialErrors {
    /// The sensor; `None` for a model.
    pub sensor: Option<SensorKey>,
    /// Covariance of the trial's own errors, degrees².
    pub own: [DMatrix<f64>; 3],
    /// Effects of the sensor's errors: see [`OverTime::effects`].
    pub of_sensor: [DMatrix<f64>; 3],
}

impl TrialErrors {
    /// Adds the errors of solver and clocks to the sensor's. `block_s`: length of a block.
    pub fn new(data: &Data, errors: [OverTime; 3], measured: &Blocks, block_s: f64) -> Self {
        let sensor = SensorKey::of(data);
        let is_told = data.records.import.as_ref().is_some_and(|import| !import.has_motors);
        let timing_s = if is_told { TIMING_OF_RUN_S } else { TIMING_S };
        // A model counts as a sensor with little noise.
        let quiet_deg2 = if sensor.is_none() { 1e-8 } else { 0.0 };
        let own = [0, 1, 2].map(|k| {
            let (turned, last) = (&measured[k], measured[k].len().saturating_sub(1));
            let rate = |i: usize| (turned[(i + 1).min(last)] - turned[i.saturating_sub(1)]) / (2.0 * block_s);
            let of_model = |i: usize, j: usize| {
                powi(SOLVER_ERROR, 2) * turned[i] * turned[j] + powi(timing_s, 2) * rate(i) * rate(j)
            };
            DMatrix::from_fn(turned.len(), turned.len(), |i, j| errors[k].own[(i, j)] + quiet_deg2 + of_model(i, j))
        });
        let errors = Self { sensor, own, of_sensor: errors.map(|errors| errors.effects) };
        if is_told || data.is_blind() { errors.with_swing(data, measured, block_s) } else { errors }
    }

    /// Adds the swing in its blocks: if the turns of the motors were not measured, the model's flagella stand at other angles than the
    /// robot's, so each motor leaves a line of unknown phase. Where blocks are short beside a turn, the differences of neighbours are
    /// about as large as those of two swings.
    fn with_swing(mut self, data: &Data, measured: &Blocks, block_s: f64) -> Self {
        let turns = data.speeds().map(|speed| speed.rpm() / 60.0 * block_s);
        let line = |lag: usize| turns.iter().map(|turns| cos(TAU * turns * lag as f64)).sum();
        let lines: Vec<f64> = (0..measured[0].len()).map(line).collect();
        for (own, blocks) in self.own.iter_mut().zip(measured) {
            let squares = blocks.as_slice().windows(2).map(|pair| powi(pair[1] - pair[0], 2));
            let swing_deg2 = squares.sum::<f64>() / blocks.len().max(1) as f64;
            *own += DMatrix::from_fn(blocks.len(), blocks.len(), |i, j| {
                swing_deg2 * (lines[i.abs_diff(j)] + if i == j { 1.0 } else { 0.0 })
            });
        }
        self
    }

    /// Leaves out the mounting of the sensor about the vertical, which is fitted instead.
    pub fn without_mounting_yaw(&mut self) {
        for effects in self.of_sensor.iter_mut().filter(|effects| effects.ncols() > MOUNTING_YAW) {
            effects.column_mut(MOUNTING_YAW).fill(0.0);
        }
    }
}

/// Correlated errors of successive blocks: a first-order autoregressive process.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correlated {
    /// Variance, degrees².
    pub variance: f64,
    /// Correlation from one block to the next.
    pub step: f64,
}

impl Correlated {
    /// Returns the scatter of the residuals of each angle, over all trials.
    pub fn of_angles(residuals: &[Blocks]) -> [Self; 3] {
        [0, 1, 2].map(|k| Self::of(residuals.iter().map(move |blocks| &blocks[k])))
    }

    /// Estimates variance and correlation from the residuals of trials.
    fn of<'a>(residuals: impl Iterator<Item = &'a DVector<f64>> + Clone) -> Self {
        let sum = |of: &dyn Fn(&[f64]) -> f64| residuals.clone().map(|residual| of(residual.as_slice())).sum::<f64>();
        let count = sum(&|residual| residual.len() as f64);
        let squares = sum(&|residual| residual.iter().map(|value| value * value).sum());
        let products = sum(&|residual| residual.windows(2).map(|pair| pair[0] * pair[1]).sum());
        // The rounding of the attitude, 1/32768, is the smallest error.
        let variance = (squares / count.max(1.0)).max(1e-6);
        let step = if squares > 0.0 { (products / squares).clamp(0.0, 0.995) } else { 0.0 };
        Self { variance, step }
    }

    /// Returns the number of independent blocks with the same information as `count` correlated ones.
    pub fn independent(&self, count: usize) -> f64 {
        count as f64 * (1.0 - self.step) / (1.0 + self.step)
    }

    /// Returns the covariance of two weighted sums of the errors of successive blocks, degrees².
    pub fn covariance(&self, one: &[f64], other: &[f64]) -> f64 {
        // The products with the earlier blocks, then with the later ones.
        let pass = |weights: &mut dyn Iterator<Item = (f64, f64)>| {
            let (mut before, mut sum) = (0.0, 0.0);
            for (a, b) in weights {
                sum += a * before;
                before = self.step * (before + b);
            }
            sum
        };
        let pairs = || one.iter().copied().zip(other.iter().copied());
        let same: f64 = pairs().map(|(a, b)| a * b).sum();
        self.variance * (same + pass(&mut pairs()) + pass(&mut pairs().rev()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_of_residuals_is_estimated() {
        // A first-order process with a step of 0.9 and a standard deviation of 0.3, from a fixed generator.
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let mut value = 0.0;
        let residuals = DVector::from_fn(20_000, |_, _| {
            value = 0.9 * value + 0.3 * (1.0f64 - 0.81).sqrt() * normal();
            value
        });
        let found = Correlated::of([residuals].iter());
        assert!((found.step - 0.9).abs() < 0.01 && (found.variance.sqrt() - 0.3).abs() < 0.02, "{found:?}");
        assert!((found.independent(1900) - 100.0).abs() < 15.0);
    }

    #[test]
    fn weighted_sums_have_the_covariance_of_all_pairs() {
        let scatter = Correlated { variance: 0.49, step: 0.83 };
        let one: Vec<f64> = (0..7).map(|i| f64::from(i).sin()).collect();
        let other: Vec<f64> = (0..7).map(|i| (2.3 * f64::from(i)).cos()).collect();
        let mut expected = 0.0;
        for (i, a) in one.iter().enumerate() {
            for (j, b) in other.iter().enumerate() {
                expected += 0.49 * 0.83f64.powi(i.abs_diff(j) as i32) * a * b;
            }
        }
        assert!((scatter.covariance(&one, &other) - expected).abs() < 1e-12);
    }
}
