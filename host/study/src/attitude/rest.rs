//! The noise of the gyroscope at rest, and the part of a return to rest that shows its bias.
//!
//! After a run the robot returns slowly to rest in the glycerin: with a time constant of 6 s the yaw still turns at
//! some hundredths of a degree per second after half a minute, as fast as the drift. The motion is overdamped, so one
//! exponential remains at the end: the rate of the yaw is r + A exp(-t/τ), where r is the bias. The longest part of the
//! phase with residuals as small as the noise is taken to follow this law.

use super::Track;
use crate::statistics::{Line, variance_ratio};
use sim::functions::{exp, ln, powi};
use std::ops::Range;

/// Length of the blocks, s.
pub(super) const BLOCK_S: f64 = 2.0;

/// Lengths of the blocks for the noise, s: many short ones, and the blocks of the drift's estimate, which also contain slow
/// noise.
const NOISE_BLOCKS_S: [f64; 2] = [0.5, BLOCK_S];

/// Minimum number of blocks of a still phase, and of a return to rest.
const MIN_BLOCKS: usize = 3;
const MIN_SWING_BLOCKS: usize = 4;

/// Duration of the shortest rest that gives a rate, s.
pub(super) const SHORTEST_REST_S: f64 = MIN_BLOCKS as f64 * BLOCK_S;

/// Largest number of blocks of a phase; a longer phase has longer blocks.
pub(super) const MOST_BLOCKS: f64 = 30.0;

/// Angle random walk, °/√s: the MPU-6000/6050's noise density of 0.005 °/s/√Hz (data sheet PS-MPU-6000A, section 6.1),
/// one-sided, over √2.
pub(crate) const ANGLE_WALK: f64 = 0.005 / std::f64::consts::SQRT_2;

/// Share of a phase that is skipped if it began with a motion, because faster motions may remain in the noise.
const MARGIN: f64 = 0.25;

/// Shortest time constant that the blocks resolve, s, and the longest, relative to the length of the phase.
const FASTEST_S: f64 = 1.5;
pub(super) const SLOWEST: f64 = 2.0;

/// Largest residual of a return to rest, relative to the noise.
pub(super) const QUIET: f64 = 1.4;

/// The scatter of rates: the sum of its squares, times the length of the blocks, and its degrees of freedom.
type Scatter = (f64, f64);

/// The angle random walk, from the scatter of rates at rest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Noise([Scatter; NOISE_BLOCKS_S.len()]);

impl Noise {
    /// Adds a phase in which the robot is still or returns to rest.
    pub fn add(&mut self, yaw: Track, range: &Range<f64>) {
        for ((squares, freedom), block_s) in self.0.iter_mut().zip(NOISE_BLOCKS_S) {
            if let Some((more, count)) = scatter(yaw, range, block_s) {
                *squares += more;
                *freedom += count;
            }
        }
    }

    /// Returns the angle random walk, °/√s, and its degrees of freedom. It is at least the data sheet's value.
    pub fn angle_walk(&self) -> (f64, f64) {
        let (walk, freedom) = self.each().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 1.0));
        (walk.max(ANGLE_WALK), freedom)
    }

    /// Returns whether the rates scatter by more than this angle random walk explains in 99 of 100 phases.
    pub fn exceeds(&self, (known, known_with): (f64, f64)) -> bool {
        self.each().any(|(walk, freedom)| powi(walk / known, 2) > variance_ratio(0.99, freedom, known_with))
    }

    /// Returns the angle random walk from the scatter at each block length, and its degrees of freedom.
    fn each(&self) -> impl Iterator<Item = (f64, f64)> {
        let known = self.0.iter().filter(|(_, freedom)| *freedom > 0.0);
        known.map(|(squares, freedom)| ((squares / freedom).sqrt(), *freedom))
    }
}

/// The mean rate over a stretch of rest.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Stretch {
    /// Its time range, s.
    pub range: Range<f64>,
    /// Mean rate, °/s.
    pub rate: f64,
    /// Variance of the rate due to white noise, (°/s)².
    pub variance: f64,
    /// Mean rates of pitch and roll, °/s.
    pub tilt_dps: [f64; 2],
}

/// Returns the blocks of a range, which end with it, and their mean rates, °/s; `None` if the range is too short.
pub(super) fn blocks_of(yaw: Track, range: &Range<f64>) -> Option<Vec<(Range<f64>, f64)>> {
    blocks(yaw, range, BLOCK_S, MIN_BLOCKS)
}

/// Returns the blocks of at least this length, s, of a range; `None` if there are fewer than `least`.
pub(super) fn blocks(yaw: Track, range: &Range<f64>, shortest_s: f64, least: usize) -> Option<Vec<(Range<f64>, f64)>> {
    let length = shortest_s.max(shortest_s / BLOCK_S * (range.end - range.start) / MOST_BLOCKS);
    let count = ((range.end - range.start) / length + 1e-6).floor();
    if count.is_nan() || count < least as f64 {
        return None;
    }
    let block = |i: usize| {
        let end = range.end - (count - 1.0 - i as f64) * length;
        end - length..end
    };
    (0..count as usize).map(|i| Some((block(i), yaw.rate(block(i))?))).collect()
}

/// Returns the longest part at the end of `range` in which the robot is still, or in which one exponential describes its
/// return to rest. `walk`: angle random walk, °/√s.
pub(super) fn after_run(yaw: Track, range: Range<f64>, walk: f64) -> Option<Range<f64>> {
    let end = range.end.min(yaw.span().end);
    let is_quiet = |part: &Range<f64>| {
        let (squares, freedom) = scatter(yaw, part, BLOCK_S)?;
        Some((squares / freedom).sqrt() < QUIET * walk)
    };
    let mut start = range.start;
    while end - start >= MIN_SWING_BLOCKS as f64 * BLOCK_S {
        if is_quiet(&(start..end)) == Some(true) {
            // The motors take a moment to stop.
            let hidden = if start > range.start { MARGIN * (end - start) } else { BLOCK_S };
            // A part that is too short for its own fit is still covered by a good fit.
            return Some((start + hidden).min(end - MIN_BLOCKS as f64 * BLOCK_S)..end);
        }
        start += BLOCK_S / 2.0;
    }
    None
}

/// Returns the scatter of the rates of a return to rest about r + A exp(-t/τ).
fn scatter(yaw: Track, range: &Range<f64>, block_s: f64) -> Option<Scatter> {
    let blocks = blocks(yaw, range, block_s, MIN_SWING_BLOCKS)?;
    let length = blocks[0].0.end - blocks[0].0.start;
    let slowest_s = SLOWEST * (range.end - range.start);
    let squares = least_squares(&blocks, [length / slowest_s, length / FASTEST_S])?;
    Some((squares * length, blocks.len() as f64 - 3.0))
}

/// Returns the minimum sum of squared residuals, for decays per block within these bounds, in time constants.
fn least_squares(blocks: &[(Range<f64>, f64)], [slow, fast]: [f64; 2]) -> Option<f64> {
    const TRIED: u32 = 16;
    const REFINED: u32 = 24;
    let step = ln(fast / slow) / f64::from(TRIED);
    let tried = (0..=TRIED).map(|i| slow * exp(step * f64::from(i)));
    let rates = || blocks.iter().map(|(_, rate)| *rate).enumerate();
    let of = |passed: f64| Line::through(rates().map(|(i, rate)| (exp(-passed * i as f64), rate))).squares;
    let best = tried.min_by(|a, b| of(*a).total_cmp(&of(*b)))?;
    // Ternary search between the neighbours of the best decay.
    let (mut low, mut high) = ((ln(best) - step).max(ln(slow)), (ln(best) + step).min(ln(fast)));
    for _ in 0..REFINED {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if of(exp(a)) < of(exp(b)) { high = b } else { low = a }
    }
    Some(of(best).min(of(exp(0.5 * (low + high))))).filter(|squares| squares.is_finite())
}
