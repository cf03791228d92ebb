//! Compares how two attitudes approach their steady ends.
//!
//! The run is divided into blocks of some seconds, over which the wobble of the robot with its flagella averages out.
//! Let r be the errors of the blocks and C their covariance due to the measurement: drift, noise, and the sensor's
//! errors, which correlate neighbours. The mean of r over the steady end, d, is judged separately. It explains the part
//! C w / (wᵀ C w) d of the other blocks, their regression on d, where w averages over the steady end. For example, a
//! scale error of the gyroscope affects all blocks in proportion to their yaw. The remainder, r - C w / (wᵀ C w) d, is
//! independent of d, and its covariance is C - C w wᵀ C / (wᵀ C w) (conditional normal distribution). Its root mean
//! square is compared with the bound from this covariance ([`ExpectedRms`]), plus the tolerance of the model.

use super::aligned::Aligned;
use super::comparison::{Settling, Transient, Uncertainty, Unjudged};
use super::pair::Pair;
use crate::statistics::ExpectedRms;
use crate::trial::{BLOCK_S, OverTime};
use nalgebra::{DMatrix, DVector};
use sim::accuracy::ModelError;
use sim::functions::powi;
use sim::trial::means::settled_within_deg;
use std::ops::Range;

/// Largest number of blocks; a longer run has longer blocks.
const MOST_BLOCKS: f64 = 200.0;

/// Fewest blocks before the steady end for judging the transient.
const LEAST_BLOCKS: usize = 3;

/// Smallest share of a block in which both attitudes are known.
const LEAST_SHARE: f64 = 0.5;

/// Error of a replayed transient that is not due to the robot, degrees: the speeds are interpolated between encoder
/// counts, and start and time shift are known to some hundredths of a second.
pub(super) const TOLERANCE_DEG: f64 = 0.1;

/// Half width of a 95 % interval in standard deviations.
const NORMAL_95: f64 = 1.96;

/// Means over a part of the run.
struct Block {
    /// Middle of the block, from the start of the run, s.
    middle_s: f64,
    measured_deg: [f64; 3],
    modelled_deg: [f64; 3],
    /// Whether it is in the steady end of the run.
    is_steady: bool,
}

/// The run in blocks, with the covariances of their errors.
pub(super) struct Blocks {
    blocks: Vec<Block>,
    length_s: f64,
    /// Covariances of yaw, pitch and roll; `None` for an angle if its uncertainty is unknown in either attitude.
    covariances: [Option<DMatrix<f64>>; 3],
}

impl Blocks {
    /// Divides the common run, whose steady end is `window`.
    ///
    /// # Errors
    /// [`Unjudged`] if too few blocks are left before it, or no transient is known.
    pub fn new(pair: &Pair, aligned: &Aligned, window: &Range<f64>) -> Result<Self, Unjudged> {
        if pair.has_steady_state() {
            return Err(Unjudged::SteadyState);
        }
        if pair.is_blind() {
            return Err(Unjudged::NoEncoders);
        }
        let length_s = BLOCK_S.max(window.end / MOST_BLOCKS);
        let count = (window.end / length_s + 1e-6).floor() as usize;
        let block = |i: usize| {
            let end_s = window.end - (count - 1 - i) as f64 * length_s;
            let part = |time: f64| aligned.times_s.partition_point(|t| *t < time);
            let part = part(end_s - length_s)..part(end_s);
            let known =
                part.clone().filter(|i| (aligned.measured_deg[*i][0] + aligned.modelled_deg[*i][0]).is_finite());
            let known: Vec<usize> = known.collect();
            let mean = |angles: &[[f64; 3]]| {
                [0, 1, 2].map(|k| known.iter().map(|i| angles[*i][k]).sum::<f64>() / known.len() as f64)
            };
            let middle_s = end_s - 0.5 * length_s;
            (known.len() as f64 >= LEAST_SHARE * part.len().max(1) as f64).then(|| Block {
                middle_s,
                measured_deg: mean(&aligned.measured_deg),
                modelled_deg: mean(&aligned.modelled_deg),
                is_steady: middle_s > window.start,
            })
        };
        let blocks: Vec<Block> = (0..count).filter_map(block).collect();
        let steady = blocks.iter().filter(|block| block.is_steady).count();
        if steady == 0 || blocks.len() - steady < LEAST_BLOCKS {
            let before = (window.start / length_s) as usize;
            return Err(if before < LEAST_BLOCKS || count == 0 { Unjudged::Short } else { Unjudged::Gaps });
        }
        let times = |run_start_s: f64, shift_s: f64| -> Vec<f64> {
            blocks.iter().map(|block| run_start_s + block.middle_s - shift_s).collect()
        };
        let (one, other) = (&pair.measured.zeroed, &pair.modelled.zeroed);
        let one = one.over_time(&times(pair.measured.start_s, 0.0), length_s);
        let other = other.over_time(&times(pair.modelled.start_s, aligned.shift_s), length_s);
        let is_same = pair.is_of_one_sensor();
        let shorter = BLOCK_S / length_s;
        let covariance = |k: usize| {
            let (one, other) = one[k].as_ref().zip(other[k].as_ref())?;
            Some(OverTime::of_difference(one, other, is_same, shorter))
        };
        let covariances = [0, 1, 2].map(covariance);
        Ok(Self { blocks, length_s, covariances })
    }

    /// Judges the transient of an angle (0 to 2: yaw, pitch, roll). `uncertainty`: uncertainty of its steady error.
    pub fn transient(&self, angle: usize, uncertainty: Uncertainty, model: Option<&ModelError>) -> Option<Transient> {
        let covariance = self.covariances[angle].as_ref()?;
        let count = self.blocks.len();
        let errors =
            DVector::from_fn(count, |i, _| self.blocks[i].modelled_deg[angle] - self.blocks[i].measured_deg[angle]);
        let steady = self.blocks.iter().filter(|block| block.is_steady).count() as f64;
        let weights = DVector::from_fn(count, |i, _| if self.blocks[i].is_steady { 1.0 / steady } else { 0.0 });
        let along = covariance * &weights;
        let variance = weights.dot(&along);
        // Between models the variance is zero, and the steady error explains nothing.
        let explained = if variance > 0.0 { &along / variance } else { DVector::zeros(count) };
        let left = &errors - &explained * weights.dot(&errors);
        let covariance = covariance - &explained * along.transpose();
        let before = self.blocks.iter().position(|block| block.is_steady).unwrap_or(count);
        let left = left.rows(0, before);
        let expected =
            ExpectedRms::new(&covariance.view((0, 0), (before, before)).into_owned(), uncertainty.degrees_of_freedom);
        let model_error_deg = model.map(|model| {
            let squares =
                self.blocks[..before].iter().map(|block| powi(model.of_modelled_deg(block.modelled_deg)[angle], 2));
            (squares.sum::<f64>() / before as f64).sqrt()
        });
        Some(Transient {
            residual_deg: left.norm() / (before as f64).sqrt(),
            allowed_deg: expected.bound + TOLERANCE_DEG,
            independent_samples: expected.independent,
            model_error_deg,
        })
    }

    /// Returns whether the attitudes settle at different times: more than a block apart for any values within the
    /// uncertainties.
    fn settle_apart(&self) -> bool {
        let [one, other] = [|block: &Block| block.measured_deg, |block: &Block| block.modelled_deg]
            .map(|of: fn(&Block) -> [f64; 3]| self.settled_between(of));
        let (Some(one), Some(other)) = (one, other) else { return false };
        one.start > other.end + self.length_s || other.start > one.end + self.length_s
    }

    /// Returns the earliest and the latest time at which yaw and pitch may have settled; `None` if it is unknown.
    fn settled_between(&self, of: fn(&Block) -> [f64; 3]) -> Option<Range<f64>> {
        let [Some(yaw), Some(pitch), _] = &self.covariances else { return None };
        let covariances = [yaw, pitch];
        let steady: Vec<usize> = (0..self.blocks.len()).filter(|i| self.blocks[*i].is_steady).collect();
        let mean = |value: &dyn Fn(usize) -> f64| steady.iter().map(|i| value(*i)).sum::<f64>() / steady.len() as f64;
        // Excess of the distance from the final value over the limit, and its uncertainty.
        let beyond = |i: usize, angle: usize| {
            let covariance = covariances[angle];
            let last = mean(&|j| of(&self.blocks[j])[angle]);
            let variance =
                covariance[(i, i)] - 2.0 * mean(&|j| covariance[(i, j)]) + mean(&|j| mean(&|k| covariance[(j, k)]));
            let margin = NORMAL_95 * variance.max(0.0).sqrt() + TOLERANCE_DEG;
            ((of(&self.blocks[i])[angle] - last).abs() - settled_within_deg(last), margin)
        };
        let settled_s = |is_unsettled: &dyn Fn(f64, f64) -> bool| {
            let unsettled = |i: &usize| {
                [0, 1].into_iter().any(|angle| {
                    let (distance, margin) = beyond(*i, angle);
                    is_unsettled(distance, margin)
                })
            };
            let before = (0..self.blocks.len()).rev().filter(|i| !self.blocks[*i].is_steady);
            before.into_iter().find(unsettled).map_or(0.0, |i| self.blocks[i].middle_s + 0.5 * self.length_s)
        };
        Some(settled_s(&|distance, margin| distance > margin)..settled_s(&|distance, margin| distance > -margin))
    }
}

/// Returns the settling times of both attitudes. `blocks`: `None` for a run without judged transients.
pub(super) fn settling(pair: &Pair, aligned: &Aligned, blocks: Option<&Blocks>) -> Settling {
    let [measured_s, modelled_s] = [&pair.measured, &pair.modelled].map(|side| side.steady.settle_s);
    if aligned.lengths_s.is_some() {
        return Settling { measured_s, modelled_s, ratio: None, differs: false };
    }
    let ratio = match [measured_s, modelled_s] {
        [Some(measured), Some(modelled)] if measured > 0.0 && modelled > 0.0 => Some(modelled / measured),
        _ => None,
    };
    let both = measured_s.is_some() && modelled_s.is_some();
    Settling { measured_s, modelled_s, ratio, differs: both && blocks.is_some_and(Blocks::settle_apart) }
}
