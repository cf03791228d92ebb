//! A trial as the fit sees it: means of yaw, pitch and roll over short blocks, and the speeds that made them.

use super::super::curve::Curve;
use super::super::{Recording, TwinError, hash, speeds};
use nalgebra::{DMatrix, DVector, Dyn, linalg::Cholesky};
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::path::PathBuf;

/// Length of the blocks, s. Yaw and pitch take seconds to move, and a block holds most of a turn of a slow motor.
pub(super) const BLOCK_S: f64 = 0.5;

/// Samples of the model in a block.
const SAMPLES: usize = 10;

/// Standard deviation that is taken for the error of a block in the weights of the fit, degrees.
const GUESS_DEG: f64 = 0.1;

/// Standard deviation of what the clocks of attitude and motors are apart, s: about what the sensor's filter leaves of its delay.
const TIMING_S: f64 = 0.002;

/// Standard deviation of what a trial's model turns too far by its numbers alone, over what it turns: its mean forces carry
/// some tenths of a per cent from tolerance and steps.
const NUMBERS: f64 = 0.005;

/// Yaw, pitch and roll of every block, degrees.
pub(super) type Blocks = [Vec<f64>; 3];

/// A trial to fit to.
pub(super) struct Data {
    pub name: String,
    pub path: PathBuf,
    pub sha256: String,
    pub temperature_c: f64,
    /// How askew the sensor sits: pitch and roll at rest, degrees.
    pub askew_deg: [f64; 2],
    pub warnings: Vec<String>,
    pub measured: Blocks,
    profile: SpeedProfile,
    /// Middles of the blocks, s after the zero of the yaw.
    times: Vec<f64>,
    /// Angle random walk of the yaw, °/√s; length of the still phase that told the gyroscope's bias, s.
    yaw_walk: f64,
    still_s: f64,
    /// Standard deviation of what the levelling may have done to the yaw, block by block, one with all others, degrees.
    levelling: Vec<f64>,
    /// The same of the sensor's warming.
    warming: Vec<f64>,
    /// Variance of the zeros of pitch and roll.
    zero_variance: [f64; 2],
}

impl Data {
    pub fn new(recording: &Recording) -> Result<Self, TwinError> {
        let unusable = |reason: &str| TwinError::Unusable {
            path: recording.path.clone(),
            reason: reason.to_owned(),
            help: "calibrate with trials that begin with a still phase of 10 s or more",
        };
        // The decay moves the robot, and the fit explains how: the drift is that of the still phase before.
        let curve = Curve::from_rest(recording).ok_or_else(|| unusable("holds no attitude in its run"))?;
        let run = &curve.run;
        let end = curve.span().end.min(recording.end_s);
        let count = ((end - run.start) / BLOCK_S).floor() as usize;
        let block = |i: usize| run.start + i as f64 * BLOCK_S..run.start + (i + 1) as f64 * BLOCK_S;
        let middle = |i: usize| run.start + (i as f64 + 0.5) * BLOCK_S;
        let measured = curve.angles.each_ref().map(|track| track.means((0..count).map(block)));
        let (yaw_walk, still_s, zero_variance) = curve
            .noise()
            .ok_or_else(|| unusable("has no still phase before the run that tells how far its yaw drifts"))?;
        let from = run.start - curve.from_s;
        let sha256 = if recording.path.exists() { hash::of_file(&recording.path)? } else { String::new() };
        Ok(Self {
            name: recording.trial.name.clone(),
            path: recording.path.clone(),
            sha256,
            temperature_c: recording.temperature_c,
            askew_deg: [curve.zero_deg[1], curve.zero_deg[2]],
            warnings: curve.warnings.clone(),
            measured,
            profile: speeds::profile_of_run(recording, BLOCK_S / SAMPLES as f64)?,
            times: (0..count).map(|i| from + (i as f64 + 0.5) * BLOCK_S).collect(),
            // 95 % are two standard deviations.
            levelling: (0..count).map(|i| 0.5 * curve.levelling(middle(i))).collect(),
            warming: (0..count).map(|i| curve.warming(middle(i))).collect(),
            yaw_walk,
            still_s,
            zero_variance,
        })
    }

    pub fn blocks(&self) -> usize {
        self.times.len()
    }

    /// What the model makes of the trial; `None` where the solver cannot end it.
    pub fn modelled(&self, robot: &Robot, closure: Closure) -> Option<Blocks> {
        let rate_hz = SAMPLES as f64 / BLOCK_S;
        let options = Options { rate_hz, shapes: false };
        let mut blocks: Blocks = Default::default();
        let mut sums = [0.0; 3];
        // Samples lie amid the steps of the run, so that their mean is that of the block.
        let first = ((self.profile.run()[0] - self.profile.start()) * rate_hz).ceil() as usize;
        let trial = Trial::new(robot, closure, self.profile.clone(), options).ok()?;
        for (i, sample) in trial.enumerate().skip(first).take(self.blocks() * SAMPLES) {
            let sample = sample.ok()?;
            let angles = [sample.yaw_rad, sample.pitch_rad, sample.roll_rad];
            sums = [0, 1, 2].map(|k| sums[k] + angles[k].to_degrees());
            if (i - first) % SAMPLES == SAMPLES - 1 {
                for (block, sum) in blocks.iter_mut().zip(&mut sums) {
                    block.push(*sum / SAMPLES as f64);
                    *sum = 0.0;
                }
            }
        }
        // The last block may lack the end of its samples.
        let last = blocks.each_ref().map(|block| block.last().copied().unwrap_or_default());
        for (block, last) in blocks.iter_mut().zip(last) {
            block.resize(self.blocks(), last);
        }
        Some(blocks)
    }

    /// Covariance of the blocks of yaw, pitch or roll that the sensor's noise alone makes, degrees².
    ///
    /// Yaw: the gyroscope's angle random walk, of which the still phase told the bias too, which has walked since and followed
    /// the temperature (see [`crate::attitude::Drift`]), and what levelling may do to it. Tilt: the zero, which is common to
    /// all blocks.
    fn sensor_covariance(&self, angle: usize) -> DMatrix<f64> {
        let count = self.blocks();
        let walk = self.yaw_walk.powi(2);
        let bias_walk = crate::attitude::BIAS_WALK.powi(2);
        // The bias is that of the middle of the still phase.
        let since = |t: f64| t + 0.5 * self.still_s;
        DMatrix::from_fn(count, count, |i, j| {
            if angle > 0 {
                return self.zero_variance[angle - 1];
            }
            let (a, b) = (self.times[i].min(self.times[j]), self.times[i].max(self.times[j]));
            let bias = bias_walk * since(a).powi(2) * (3.0 * since(b) - since(a)) / 6.0;
            let common = self.levelling[i] * self.levelling[j] + self.warming[i] * self.warming[j];
            walk * (a + a * b / self.still_s) + bias + common
        })
    }

    /// The covariance of the blocks, given what is known of the errors besides the sensor's, the model's numbers and the
    /// clocks'.
    pub fn whitener(&self, angle: usize, rest: Correlated) -> Option<Whitener> {
        let count = self.blocks();
        let mut covariance = self.sensor_covariance(angle);
        let turned = &self.measured[angle];
        let rate = |i: usize| (turned[(i + 1).min(count - 1)] - turned[i.saturating_sub(1)]) / (2.0 * BLOCK_S);
        let rates: Vec<f64> = (0..count).map(rate).collect();
        for i in 0..count {
            for j in 0..count {
                covariance[(i, j)] += NUMBERS.powi(2) * turned[i] * turned[j];
                covariance[(i, j)] += TIMING_S.powi(2) * rates[i] * rates[j];
                covariance[(i, j)] += rest.variance * rest.step.powi(i.abs_diff(j) as i32);
            }
        }
        Some(Whitener(Cholesky::new(covariance)?))
    }
}

/// Errors of blocks that follow each other are alike: a process of first order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correlated {
    /// Variance, degrees².
    pub variance: f64,
    /// Correlation from one block to the next.
    pub step: f64,
}

impl Correlated {
    /// What is taken before anything is known.
    pub fn guess() -> Self {
        Self { variance: GUESS_DEG.powi(2), step: 0.0 }
    }

    /// From residuals of trials.
    pub fn of<'a>(residuals: impl Iterator<Item = &'a Vec<f64>> + Clone) -> Self {
        let sum = |of: &dyn Fn(&[f64]) -> f64| residuals.clone().map(|residual| of(residual)).sum::<f64>();
        let count = sum(&|residual| residual.len() as f64);
        let squares = sum(&|residual| residual.iter().map(|value| value * value).sum());
        let products = sum(&|residual| residual.windows(2).map(|pair| pair[0] * pair[1]).sum());
        // Rounding of the attitude, 1/32768, is the least that there is.
        let variance = (squares / count.max(1.0)).max(1e-6);
        let step = if squares > 0.0 { (products / squares).clamp(0.0, 0.995) } else { 0.0 };
        Self { variance, step }
    }

    /// How many of `count` blocks are worth as much as independent ones.
    pub fn independent(&self, count: usize) -> f64 {
        count as f64 * (1.0 - self.step) / (1.0 + self.step)
    }
}

/// Covariance of errors, factored.
pub(super) struct Whitener(Cholesky<f64, Dyn>);

impl Whitener {
    /// How many errors it is of.
    pub fn count(&self) -> usize {
        self.0.l_dirty().nrows()
    }

    /// The transposed inverse of the factor, times these.
    pub fn whiten_transposed(&self, values: &mut DVector<f64>) {
        self.0.l_dirty().tr_solve_lower_triangular_mut(values);
    }

    /// The transposed factor, times these: the square of the result is their variance.
    pub fn spread(&self, values: &DVector<f64>) -> DVector<f64> {
        self.0.l().tr_mul(values)
    }

    /// Makes correlated errors independent, of variance 1.
    pub fn whiten(&self, values: &[f64]) -> Vec<f64> {
        let mut column = DVector::from_column_slice(values);
        // The factor of a positive definite matrix has no zero on its diagonal.
        self.0.l_dirty().solve_lower_triangular_mut(&mut column);
        column.as_slice().to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_correlation_of_residuals_is_found() {
        // A process of first order with a step of 0.9 and a standard deviation of 0.3, from a fixed generator.
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let mut value = 0.0;
        let residuals: Vec<f64> = (0..20_000)
            .map(|_| {
                value = 0.9 * value + 0.3 * (1.0f64 - 0.81).sqrt() * normal();
                value
            })
            .collect();
        let found = Correlated::of([residuals].iter());
        assert!((found.step - 0.9).abs() < 0.01 && (found.variance.sqrt() - 0.3).abs() < 0.02, "{found:?}");
        assert!((found.independent(1900) - 100.0).abs() < 15.0);
    }
}
