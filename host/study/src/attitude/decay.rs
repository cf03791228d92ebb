//! The part of the phase after a run from which the drift is estimated.
//!
//! Soft flagella spring back within some seconds, and then the robot returns slowly: the rate of the yaw is a bias plus
//! two exponentials. While the faster one lasts, the rates are far above the noise. They determine the time constant of
//! the slower one, which the end of the phase cannot. But a motion is exponential only to within a fraction of its own
//! rate.

use super::Track;
use super::rest::{BLOCK_S, MOST_BLOCKS, QUIET, SLOWEST, blocks};
use super::returns::FAST_S;
use nalgebra::{Matrix3, Vector3};
use sim::functions::{exp, powi};
use std::ops::Range;

/// Time after the run until the motors have stopped and all motions but two have ended, s.
const HIDDEN_S: f64 = 4.0;

/// Fewest blocks for a fit of two exponentials, which have five parameters.
const LEAST_BLOCKS: usize = 6;
const PARAMETERS: f64 = 5.0;

/// Standard deviation of the rate of a return to rest about two exponentials, relative to the rate. Assumed: a robot in
/// glycerin returns in proportion to the remaining angle, which is some degrees by then.
const SHAPE: f64 = 0.02;

/// Ratio of successive trial time constants.
const STEP: f64 = 1.1;

/// The part of the phase after a run that one or two exponentials describe.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Decay {
    /// Its time range, s.
    pub range: Range<f64>,
    /// Standard deviation of its rates about the exponentials, relative to the rates.
    shape: f64,
    /// Approximate rate at rest, °/s.
    bias: f64,
    /// Angle random walk, °/√s.
    walk: f64,
}

impl Decay {
    /// Finds the longest part at the end of a phase that two exponentials describe. `single` is the part that one
    /// exponential describes; it is returned unless a longer part is found. `None` if there is neither. `bias`:
    /// approximate rate at rest, °/s; `walk`: angle random walk, °/√s.
    pub fn find(yaw: Track, phase: &Range<f64>, single: Option<Range<f64>>, bias: f64, walk: f64) -> Option<Self> {
        let end = phase.end.min(yaw.span().end);
        let step = 0.5 * BLOCK_S.max((end - phase.start) / MOST_BLOCKS);
        let latest = single.as_ref().map_or(f64::INFINITY, |single| single.start);
        let starts = std::iter::successors(Some(phase.start + HIDDEN_S), |start| Some(start + step))
            .take_while(|start| *start < latest.min(end - LEAST_BLOCKS as f64 * BLOCK_S));
        let double = starts
            .map(|start| Self { range: start..end, shape: SHAPE, bias, walk })
            .find(|part| part.is_two_exponentials(yaw) == Some(true));
        double.or_else(|| single.map(|range| Self { range, shape: 0.0, bias, walk }))
    }

    /// Returns the variance of the mean rate over a block, (°/s)².
    pub fn variance(&self, block: &Range<f64>, rate: f64) -> f64 {
        powi(self.walk, 2) / (block.end - block.start) + powi(self.shape * (rate - self.bias), 2)
    }

    /// Returns whether two exponentials describe the part within the noise and the error of its shape.
    fn is_two_exponentials(&self, yaw: Track) -> Option<bool> {
        let blocks = blocks(yaw, &self.range, BLOCK_S, LEAST_BLOCKS)?;
        let length = blocks.last()?.0.end - self.range.start;
        let slow = std::iter::successors(Some(STEP * FAST_S[FAST_S.len() - 1]), |tau| Some(STEP * tau));
        let pairs = slow.take_while(|tau| *tau < SLOWEST * length).flat_map(|slow| FAST_S.map(|fast| [slow, fast]));
        let squares = pairs.filter_map(|pair| self.squares(&blocks, pair)).min_by(f64::total_cmp)?;
        Some(squares < powi(QUIET, 2) * (blocks.len() as f64 - PARAMETERS))
    }

    /// Returns the minimum sum of squared residuals about exponentials of these time constants, s, each relative to its
    /// standard deviation.
    fn squares(&self, blocks: &[(Range<f64>, f64)], time_constants_s: [f64; 2]) -> Option<f64> {
        let [slow, fast] = time_constants_s;
        let (mut normal, mut right, mut total) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
        for (block, rate) in blocks {
            let passed = block.start - self.range.start;
            let row = Vector3::new(1.0, exp(-passed / slow), exp(-passed / fast));
            let weight = 1.0 / self.variance(block, *rate);
            let moved = rate - self.bias;
            normal += weight * row * row.transpose();
            right += weight * moved * row;
            total += weight * moved * moved;
        }
        Some(total - right.dot(&normal.cholesky()?.solve(&right)))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Columns;
    use super::*;

    const WALK: f64 = 0.004;

    /// Returns the part of a phase of 20 s that is found in a turn of the yaw.
    fn found(turned: impl Fn(f64) -> f64, single: Option<Range<f64>>) -> Option<Decay> {
        let mut yaw = Columns::<1>::default();
        (0..=2000).map(|i| f64::from(i) * 0.01).for_each(|t| yaw.push(t, [turned(t)]));
        Decay::find(yaw.track(0), &(0.0..20.0), single, 0.0, WALK)
    }

    fn back(t: f64, turns_deg: f64, tau: f64) -> f64 {
        turns_deg * (1.0 - (-t / tau).exp())
    }

    #[test]
    fn two_modes_are_described_from_the_end_of_the_others_on() {
        let decay = found(|t| back(t, 102.0, 1.6) + back(t, 16.0, 6.3), Some(11.75..20.0)).unwrap();
        assert_eq!((decay.range, decay.shape), (4.0..20.0, SHAPE));
    }

    /// A separate motion in the first eight seconds: 3 degrees there and back.
    #[test]
    fn what_is_no_exponential_is_left_out() {
        let other = |t: f64| if t < 8.0 { 3.0 * (std::f64::consts::PI * t / 8.0).sin() } else { 0.0 };
        let decay = found(|t| back(t, 16.0, 6.3) + other(t), None).unwrap();
        assert!((7.0..=8.0).contains(&decay.range.start), "{:?}", decay.range);
    }

    #[test]
    fn one_exponential_that_is_as_long_is_preferred() {
        let decay = found(|t| back(t, 16.0, 6.3), Some(2.0..20.0)).unwrap();
        assert_eq!((decay.range, decay.shape), (2.0..20.0, 0.0));
        assert_eq!(found(|t| (7.0 * t).sin(), None), None);
    }
}
