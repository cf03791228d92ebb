//! The zero of the tilt at rest, with its noise and the possible rest of a motion.

use super::budget::Term;
use super::righting::Righting;
use crate::attitude::Track;
use std::ops::Range;

/// Length of the blocks whose scatter is the noise of a tilt, s.
pub const BLOCK_S: f64 = 2.0;

/// The zero of the tilt is its mean over this duration at the end of the still phase, but at most over its second half,
/// s: earlier the robot may still swing, and the filter settles after the gyroscope's calibration. The noise of the tilt
/// is its scatter over the whole duration.
const TILT_ZERO_S: f64 = 10.0;

/// Variance of a mean over blocks, relative to that of as many independent ones. The board's filter gives the noise a
/// correlation time of 1 s, so that a mean over many blocks has 1.76 times the variance that their own suggests, and five
/// blocks in a row scatter by 0.85 of theirs.
const CORRELATED: f64 = 2.06;

/// The zero of the tilt at rest.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct TiltZero {
    /// Standard deviation of the block means of pitch and roll.
    scatter_deg: [f64; 2],
    /// Number of blocks whose scatter it is, and number of blocks in the zero.
    blocks: [f64; 2],
    /// Standard deviation of the motion that may be left in pitch and roll.
    moved_deg: [f64; 2],
}

impl TiltZero {
    /// Returns the noise of pitch and roll in a still phase whose last part, `zero`, gives the zero; `None` if the phase is
    /// too short.
    pub fn of(tilts: [Track; 2], still: &Range<f64>, zero: &Range<f64>, righting: Righting) -> Option<Self> {
        let blocks = tilts.map(|tilt| blocks(tilt, still));
        let count = blocks[0].len();
        let deviation = |means: &[f64]| {
            let mean = means.iter().sum::<f64>() / means.len() as f64;
            (means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (means.len() as f64 - 1.0)).sqrt()
        };
        // Neighbours differ by noise and a step of a motion, the ends by noise and all of its steps.
        let moved = |means: &[f64]| {
            let steps = count as f64 - 1.0;
            let neighbours = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>() / steps;
            let ends = (means[0] - means[count - 1]).powi(2);
            ((ends - neighbours).max(0.0) / (1.0 - 1.0 / steps.powi(2))).sqrt()
        };
        if count < 3 {
            return None;
        }
        let middle_s = |i: usize| still.end - (i as f64 + 0.5) * BLOCK_S;
        let left_of_change = righting.left_of_change([middle_s(count - 1), middle_s(0)], zero);
        let left_deg = righting.left_deg(zero);
        Some(Self {
            scatter_deg: blocks.each_ref().map(|means| deviation(means)),
            blocks: [count as f64, ((zero.end - zero.start) / BLOCK_S).max(1.0)],
            moved_deg: blocks.each_ref().map(|means| (left_of_change * moved(means)).max(left_deg)),
        })
    }

    /// Returns the causes of uncertainty of an angle averaged over `window_s`, of which `gradient` are the derivatives by
    /// pitch and roll.
    pub fn terms(&self, gradient: [f64; 2], window_s: f64) -> [Term; 2] {
        let [seen, in_zero] = self.blocks;
        let of = |deg: [f64; 2]| (gradient[0] * deg[0]).hypot(gradient[1] * deg[1]);
        let blocks = BLOCK_S / window_s.max(BLOCK_S) + 1.0 / in_zero.min(seen);
        let u_deg = of(self.scatter_deg) * (CORRELATED * blocks).sqrt();
        [
            Term::of_trial("noise", u_deg, seen - 1.0),
            Term::of_trial("motion at rest", of(self.moved_deg), f64::INFINITY),
        ]
    }

    /// Returns the variance of the mean of a block of pitch (0) or roll (1), degrees².
    pub fn block_variance(&self, tilt: usize) -> f64 {
        self.scatter_deg[tilt].powi(2)
    }

    /// Returns the variance of the zero of pitch (0) or roll (1), degrees².
    pub fn variance(&self, tilt: usize) -> f64 {
        let [seen, in_zero] = self.blocks;
        self.scatter_deg[tilt].powi(2) * CORRELATED / in_zero.min(seen) + self.moved_deg[tilt].powi(2)
    }
}

/// Returns the mean of each block of a range, counted from its end.
pub(super) fn blocks(track: Track, range: &Range<f64>) -> Vec<f64> {
    let count = ((range.end - range.start) / BLOCK_S + 1e-6).floor() as usize;
    (0..count)
        .filter_map(|i| track.mean(range.end - (i + 1) as f64 * BLOCK_S..range.end - i as f64 * BLOCK_S))
        .collect()
}

/// Returns the part of a still phase that shows the tilt's zero and noise.
pub(super) fn end_of(still: &Range<f64>) -> Range<f64> {
    (still.end - TILT_ZERO_S).max(still.start)..still.end
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Columns;

    /// Returns the zero of a tilt of one degree that returns to rest from time 0 on, and the tilt that is left in it.
    fn zero(time_constant_s: f64, still: Range<f64>, over: &Range<f64>) -> (TiltZero, f64) {
        let tilt = |time_s: f64| (-time_s / time_constant_s).exp();
        let mut columns = Columns::<1>::default();
        (0..6000).map(|i| 0.005 * f64::from(i)).for_each(|time| columns.push(time, [tilt(time)]));
        let righting = Righting { time_constant_s, waited: None };
        let track = columns.track(0);
        (TiltZero::of([track; 2], &still, over, righting).unwrap(), track.mean(over.clone()).unwrap())
    }

    #[test]
    fn tilt_that_is_left_in_the_zero_is_within_its_uncertainty() {
        for (time_constant_s, still, over) in
            [(12.0, 10.0..20.0, 10.0..20.0), (12.0, 0.0..7.0, 3.5..7.0), (45.0, 10.0..20.0, 10.0..20.0)]
        {
            let (zero, left_deg) = zero(time_constant_s, still.clone(), &over);
            let stated_deg = 1.96 * zero.variance(0).sqrt();
            println!("{time_constant_s} s, {still:?}: {left_deg:.2} of ±{stated_deg:.2} degrees");
            assert!(left_deg < stated_deg && stated_deg < 2.0 * left_deg, "{time_constant_s} s, {still:?}");
        }
    }
}
