//! The end of a still phase, and means over blocks of it.

use crate::attitude::Track;
use std::ops::Range;

/// Length of the blocks in which a tilt at rest may not change, and of the blocks for the noise over time, s.
pub const BLOCK_S: f64 = 2.0;

/// The zero of the tilt is its mean over this duration at the end of the still phase, but at most over its second half,
/// s: earlier the robot may still swing, and the filter may still settle after the gyroscope's calibration.
const TILT_ZERO_S: f64 = 10.0;

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
