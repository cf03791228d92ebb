//! Estimates the gyroscope's bias from a robot at rest, or returning to rest.
//!
//! After a run the robot returns slowly to rest in the glycerin: with a time constant of 6 s the yaw still turns at
//! some hundredths of a degree per second after half a minute, which is as fast as the drift. The motion is overdamped,
//! so that one exponential remains at the end: the rate of the yaw is r + A exp(-t/τ), where r is the bias. It is
//! fitted to the mean rates of blocks by least squares, from the earliest time at which the residuals are as small as
//! the noise before the run.

use super::Track;
use nalgebra::{Matrix3, Vector2, Vector3};
use std::ops::Range;

/// Length of the blocks, seconds.
const BLOCK_S: f64 = 2.0;

/// Minimum number of blocks of a still phase.
const MIN_BLOCKS: usize = 3;

/// Minimum number of blocks to separate a return to rest from a bias.
const MIN_SWING_BLOCKS: usize = 6;

/// Smallest angle random walk, °/√s: the MPU-6000/6050's noise density of 0.005 °/s/√Hz (data sheet PS-MPU-6000A,
/// section
/// 6.1), one-sided, over √2.
const ANGLE_WALK_FLOOR: f64 = 0.005 / std::f64::consts::SQRT_2;

/// Share of a phase that is skipped if it began with a motion, because faster motions may remain in the noise.
const MARGIN: f64 = 0.25;

/// Largest change of the bias during a trial, °/s: a third of the data sheet's limit for a warming of 1 °C.
const BIAS_CHANGE: f64 = 0.1;

/// Standard deviation of the change of the bias per °C of warming, °/s: a tenth of the same limit.
pub(super) const BIAS_SPREAD: f64 = 0.03;

/// Shortest time constant that the blocks resolve, s, and the longest, relative to the length of the phase.
const FASTEST_S: f64 = 1.5;
const SLOWEST: f64 = 0.4;

/// A phase in which the gyroscope's bias was estimated.
pub(super) struct Phase {
    pub range: Range<f64>,
    /// Mean rate of the bias, °/s.
    pub rate: f64,
    /// Ratio of the variance of the rate to that of the angle random walk, 1/s.
    pub relative_variance: f64,
    /// Sum of the squared residuals of the blocks' rates, and their degrees of freedom.
    scatter: (f64, f64),
}

impl Phase {
    /// Estimates the bias at rest; returns `None` if the time is too short.
    pub fn still(yaw: Track, range: Range<f64>) -> Option<Self> {
        let span = yaw.span();
        let range = range.start.max(span.start)..range.end.min(span.end);
        let blocks = blocks(yaw, &range, MIN_BLOCKS)?;
        let rate = yaw.rate(range.clone())?;
        Some(Self { rate, relative_variance: 1.0 / (range.end - range.start), scatter: about_mean(&blocks), range })
    }

    /// Estimates the bias while the robot may still return to rest.
    fn decay(yaw: Track, range: Range<f64>) -> Option<Self> {
        let blocks = blocks(yaw, &range, MIN_SWING_BLOCKS)?;
        let steady = about_mean(&blocks);
        let (time_constant_s, fit) = Self::returning(&blocks, &range)?;
        let floor = ANGLE_WALK_FLOOR.powi(2) / BLOCK_S;
        // F-test at about 90 %.
        let swings = 0.5 * (steady.0 - fit.scatter.0) > 3.0 * (fit.scatter.0 / fit.scatter.1).max(floor);
        if !swings {
            return Self::still(yaw, range);
        }
        let within = time_constant_s > FASTEST_S && time_constant_s < SLOWEST * (range.end - range.start);
        within.then_some(fit)
    }

    /// Fits r + A exp(-t/τ) to a return to rest, by trying many time constants; the other parameters are linear.
    /// Returns the time constant too, s.
    fn returning(blocks: &[f64], range: &Range<f64>) -> Option<(f64, Self)> {
        const TRIED: u32 = 60;
        let ratio = SLOWEST * (range.end - range.start) / FASTEST_S;
        let tried = (0..=TRIED).map(|i| FASTEST_S * ratio.powf(f64::from(i) / f64::from(TRIED)));
        let all =
            tried.filter_map(|time_constant_s| Some((time_constant_s, Self::with(blocks, range, time_constant_s)?)));
        all.min_by(|(_, a), (_, b)| a.scatter.0.total_cmp(&b.scatter.0))
    }

    fn with(blocks: &[f64], range: &Range<f64>, time_constant_s: f64) -> Option<Self> {
        let passed = |i: usize| i as f64 * BLOCK_S / time_constant_s;
        let (mut normal, mut right) = (Matrix3::zeros(), Vector2::zeros());
        for (i, rate) in blocks.iter().enumerate() {
            let decay = (-passed(i)).exp();
            right += Vector2::new(1.0, decay) * *rate;
            let row = Vector3::new(1.0, decay, decay * passed(i));
            normal += row * row.transpose();
        }
        let solution = normal.fixed_view::<2, 2>(0, 0).try_inverse()? * right;
        let left = |(i, rate): (usize, &f64)| (rate - solution.x - solution.y * (-passed(i)).exp()).powi(2);
        let squares = blocks.iter().enumerate().map(left).sum();
        Some(Self {
            range: range.clone(),
            rate: solution.x,
            // The time constant is a parameter too. The amplitude does not affect the variance of the rate.
            relative_variance: normal.try_inverse()?[(0, 0)] / BLOCK_S,
            scatter: (squares, blocks.len() as f64 - 3.0),
        })
    }

    /// Applies a Gaussian prior on the change of the bias since `before`, because a fit to a short time is uncertain.
    fn shrunk_towards(self, before: &Phase, walk: f64) -> Self {
        let usual = BIAS_SPREAD.powi(2);
        let weight = usual / (usual + walk.powi(2) * self.relative_variance);
        Self {
            rate: before.rate + weight * (self.rate - before.rate),
            relative_variance: weight * self.relative_variance,
            ..self
        }
    }

    pub fn middle(&self) -> f64 {
        0.5 * (self.range.start + self.range.end)
    }
}

/// Returns the mean rates of blocks, the last of which ends with the range; `None` if there are fewer than `least`.
fn blocks(yaw: Track, range: &Range<f64>, least: usize) -> Option<Vec<f64>> {
    let count = ((range.end - range.start) / BLOCK_S + 1e-6).floor();
    if count.is_nan() || count < least as f64 {
        return None;
    }
    let begin = |i: usize| range.end - (count - i as f64) * BLOCK_S;
    (0..count as usize).map(|i| yaw.rate(begin(i)..begin(i) + BLOCK_S)).collect()
}

fn about_mean(blocks: &[f64]) -> (f64, f64) {
    let count = blocks.len() as f64;
    let mean = blocks.iter().sum::<f64>() / count;
    (blocks.iter().map(|rate| (rate - mean).powi(2)).sum(), count - 1.0)
}

/// Returns the angle random walk and its degrees of freedom.
pub(super) fn noise(phases: &[Phase]) -> Option<(f64, f64)> {
    let (sum, freedom) =
        phases.iter().map(|phase| phase.scatter).fold((0.0, 0.0), |(sum, freedom), (s, f)| (sum + s, freedom + f));
    (freedom > 0.0).then(|| ((sum / freedom * BLOCK_S).sqrt().max(ANGLE_WALK_FLOOR), freedom))
}

/// Returns the longest phase at the end of `range` in which the robot is still, or in which its return to rest can be
/// separated from the bias: with residuals as small as before the run, and a plausible bias. The tolerance is three
/// standard deviations.
pub(super) fn after_run(yaw: Track, range: Range<f64>, before: &Phase) -> Option<Phase> {
    let (walk, _) = noise(std::slice::from_ref(before))?;
    let is_rest = |phase: &Phase| {
        let (squares, freedom) = phase.scatter;
        let quiet = (squares / freedom * BLOCK_S).sqrt() < 1.5 * walk;
        let noise = walk.powi(2) * (phase.relative_variance + before.relative_variance) + BIAS_CHANGE.powi(2);
        quiet && (phase.rate - before.rate).abs() < 3.0 * noise.sqrt()
    };
    let end = range.end.min(yaw.span().end);
    let mut start = range.start;
    while end - start > MIN_SWING_BLOCKS as f64 * BLOCK_S {
        if Phase::decay(yaw, start..end).is_some_and(|phase| is_rest(&phase)) {
            let hidden = if start > range.start { MARGIN * (end - start) } else { 0.0 };
            return Phase::decay(yaw, start + hidden..end)
                .filter(is_rest)
                .map(|phase| phase.shrunk_towards(before, walk));
        }
        start += BLOCK_S / 2.0;
    }
    None
}
