//! A trial prepared for a fit: means of yaw, pitch and roll over short blocks, and the speeds that drive the model.

use super::super::{TwinError, speeds};
use crate::session::Attempt;
use crate::trial::{Data, Finding, Unusable, Want, Zeroed, findings};
use biflag_log::Origin;
use nalgebra::{DMatrix, DVector, Dyn, linalg::Cholesky};
use protocol::units::CentiRpm;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::phase::Ratio;
use sim::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::path::PathBuf;

/// Length of the blocks, s. Yaw and pitch change over seconds, and a block is most of a turn of a slow motor.
pub(super) const BLOCK_S: f64 = 0.5;

/// Number of the model's samples per block.
const SAMPLES: usize = 10;

/// Standard deviation of the remaining error of a block assumed by the weights of the fit, degrees.
const GUESS_DEG: f64 = 0.1;

/// Standard deviation of the difference between the clocks of attitude and motors, s: about the error of the delay of
/// the sensor's filter.
const TIMING_S: f64 = 0.002;

/// Relative standard deviation of the solver's error of an angle: mean forces have an error of some tenths of a per
/// cent from tolerance and steps.
const SOLVER_ERROR: f64 = 0.005;

/// Yaw, pitch and roll of every block, degrees.
pub(super) type Blocks = [Vec<f64>; 3];

/// A trial prepared for a fit.
#[derive(Debug)]
pub struct FitTrial {
    pub(super) name: String,
    pub(super) path: PathBuf,
    pub(super) sha256: String,
    pub(super) temperature_c: f64,
    /// Mounting of the sensor: pitch and roll at rest, degrees.
    pub(super) askew_deg: [f64; 2],
    /// Findings about its log.
    pub(super) findings: Vec<Finding>,
    /// Whether it measured a real robot.
    pub(super) is_real: bool,
    /// Its robot and the closure of its model.
    pub(super) robot: Result<Robot, TwinError>,
    pub(super) closure: Option<Closure>,
    /// The ratio of the speeds, if it is simple: the phase of the flagella matters.
    pub(super) ratio: Option<Ratio>,
    /// Whether it was recorded on a rig, whose flagella stood anywhere.
    pub(super) is_of_rig: bool,
    /// Number of the board, and which of its starts, from which its encoders count.
    pub(super) board_start: Option<[u16; 2]>,
    pub(super) measured: Blocks,
    profile: SpeedProfile,
    /// Covariances of the blocks of yaw, pitch and roll due to the sensor alone, degrees².
    sensor: [DMatrix<f64>; 3],
}

impl FitTrial {
    /// Reads the log of a trial and prepares it.
    ///
    /// # Errors
    /// [`TwinError::Log`], and those of [`Self::new`].
    pub fn read(log: &Attempt) -> Result<Self, TwinError> {
        Self::new(&log.read(Want { hash: true, ..Want::default() })?)
    }

    /// Prepares a trial.
    ///
    /// # Errors
    /// [`TwinError::Unusable`] if it has no run, or no still phase before the run.
    pub fn new(data: &Data) -> Result<Self, TwinError> {
        let unusable = |reason: &str| {
            let help = "calibrate with trials that begin with a still phase of 10 s or more";
            TwinError::unusable(data, Unusable { reason: reason.to_owned(), help })
        };
        data.check().map_err(|error| TwinError::unusable(data, error))?;
        // The decay is part of the fit, so the drift is estimated from the still phase before the run alone.
        let zeroed = Zeroed::from_rest(data);
        if zeroed.steady.is_none() {
            return Err(unusable("contains no attitude in its run"));
        }
        let run = &zeroed.run;
        let end = zeroed.span().end.min(data.duration_s);
        let count = ((end - run.start) / BLOCK_S).floor() as usize;
        let block = |i: usize| run.start + i as f64 * BLOCK_S..run.start + (i + 1) as f64 * BLOCK_S;
        let middle = |i: usize| run.start + (i as f64 + 0.5) * BLOCK_S;
        let means = |track: crate::attitude::Track| {
            (0..count).map(|i| track.mean(block(i)).unwrap_or_default()).collect::<Vec<_>>()
        };
        // Why there is no rest may be in the findings.
        let findings = findings(data, &zeroed);
        let grave: String =
            findings.iter().filter(|finding| finding.grave).map(|finding| format!("; {}", finding.text)).collect();
        let drift = zeroed
            .drift()
            .ok_or_else(|| {
                unusable(&format!("has no still phase before the run, so the drift of its yaw is unknown{grave}"))
            })
            .map(|drift| drift.variance(run.end).is_some());
        let centres: Vec<f64> = (0..count).map(middle).collect();
        let sensor = match zeroed.covariances(&centres) {
            Some(sensor) => sensor,
            None if !drift? => return Err(TwinError::unusable(data, Unusable {
                reason: "was recorded without a calibration of the gyroscope, and its still phase is too short to show the \
                         bias"
                    .to_owned()
                    + &grave,
                help: "calibrate the gyroscope before each trial, or begin with a still phase of 15 s or more",
            })),
            None => return Err(unusable(&format!("has a still phase before the run that is too short{grave}"))),
        };
        Ok(Self {
            name: data.trial().name,
            path: data.path.clone(),
            sha256: data.sha256.clone().unwrap_or_default(),
            temperature_c: data.temperature_c,
            askew_deg: [zeroed.zero_deg[1], zeroed.zero_deg[2]],
            findings,
            is_real: data.is_real(),
            robot: data.robot().map_err(|source| TwinError::robot(data, source)),
            closure: data.records.model.as_ref().map(|model| model.closure),
            ratio: Ratio::of(data.speeds().map(CentiRpm::rpm)),
            is_of_rig: data.origin() == Origin::Rig,
            board_start: (data.records.board.as_ref().filter(|_| !data.is_model()))
                .map(|board| [board.board_id, board.boot_count]),
            measured: zeroed.angles_deg.tracks().map(means),
            profile: speeds::profile_of_run(data, BLOCK_S / SAMPLES as f64)?,
            sensor,
        })
    }

    pub(super) fn blocks(&self) -> usize {
        self.sensor[0].nrows()
    }

    /// Returns the model's blocks of the trial; `None` if the solver fails.
    pub(super) fn modelled(&self, robot: &Robot, closure: Closure) -> Option<Blocks> {
        let rate_hz = SAMPLES as f64 / BLOCK_S;
        let options = Options { rate_hz, shapes: false };
        let mut blocks: Blocks = Default::default();
        let mut sums = [0.0; 3];
        // Samples are in the middle of the steps of the run, so that their mean is that of the block.
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
        // The last block may have fewer samples.
        let last = blocks.each_ref().map(|block| block.last().copied().unwrap_or_default());
        for (block, last) in blocks.iter_mut().zip(last) {
            block.resize(self.blocks(), last);
        }
        Some(blocks)
    }

    /// Returns the factored covariance of the blocks due to the sensor, the solver, the clocks, and the remaining
    /// errors.
    pub(super) fn whitener(&self, angle: usize, rest: Correlated) -> Option<Whitener> {
        let count = self.blocks();
        let mut covariance = self.sensor[angle].clone();
        let turned = &self.measured[angle];
        let rate = |i: usize| (turned[(i + 1).min(count - 1)] - turned[i.saturating_sub(1)]) / (2.0 * BLOCK_S);
        let rates: Vec<f64> = (0..count).map(rate).collect();
        for i in 0..count {
            for j in 0..count {
                covariance[(i, j)] += SOLVER_ERROR.powi(2) * turned[i] * turned[j];
                covariance[(i, j)] += TIMING_S.powi(2) * rates[i] * rates[j];
                covariance[(i, j)] += rest.variance * rest.step.powi(i.abs_diff(j) as i32);
            }
        }
        Some(Whitener(Cholesky::new(covariance)?))
    }
}

/// Correlated errors of successive blocks: an autoregressive process of first order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correlated {
    /// Variance, degrees².
    pub variance: f64,
    /// Correlation from one block to the next.
    pub step: f64,
}

impl Correlated {
    /// Returns the assumption before the first fit.
    pub fn guess() -> Self {
        Self { variance: GUESS_DEG.powi(2), step: 0.0 }
    }

    /// Estimates variance and correlation from the residuals of trials.
    pub fn of<'a>(residuals: impl Iterator<Item = &'a Vec<f64>> + Clone) -> Self {
        let sum = |of: &dyn Fn(&[f64]) -> f64| residuals.clone().map(|residual| of(residual)).sum::<f64>();
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
}

/// The factored covariance of errors.
pub(super) struct Whitener(Cholesky<f64, Dyn>);

impl Whitener {
    /// Returns the number of errors.
    pub fn count(&self) -> usize {
        self.0.l_dirty().nrows()
    }

    /// Multiplies by the transposed inverse of the factor.
    pub fn whiten_transposed(&self, values: &mut DVector<f64>) {
        self.0.l_dirty().tr_solve_lower_triangular_mut(values);
    }

    /// Multiplies by the transposed factor: the squared norm of the result is the variance of the weighted sum of
    /// errors.
    pub fn spread(&self, values: &DVector<f64>) -> DVector<f64> {
        self.0.l().tr_mul(values)
    }

    /// Transforms errors to independent ones of variance 1.
    pub fn whiten(&self, values: &[f64]) -> Vec<f64> {
        let mut column = DVector::from_column_slice(values);
        // The factor of a positive definite matrix has no zeros on its diagonal.
        self.0.l_dirty().solve_lower_triangular_mut(&mut column);
        column.as_slice().to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_of_residuals_is_estimated() {
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
