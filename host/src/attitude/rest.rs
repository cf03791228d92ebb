//! What a robot at rest, or one that swings back to rest, says of its gyroscope's bias.
//!
//! After a run the robot swings back through glycerin, the last of it slowly: at 6 s of time constant there are some hundredths
//! of a degree a second left after half a minute, as much as a bias. The return is overdamped, so in the end one exponential
//! is left of it: the yaw's rate is r + A exp(-t/τ), and r the bias. It is fitted to the mean rates of blocks by least squares,
//! from where it fits as well as the noise before the run allows.

use super::series::Track;
use nalgebra::{Matrix3, Vector2, Vector3};
use std::ops::Range;

/// Length of the blocks, seconds.
const BLOCK_S: f64 = 2.0;

/// The fewest blocks that count as a still phase.
const MIN_BLOCKS: usize = 3;

/// The fewest in which a return is told from a bias.
const MIN_SWING_BLOCKS: usize = 6;

/// Least angle random walk, °/√s: the MPU-6000/6050's noise density of 0.005 °/s/√Hz (data sheet PS-MPU-6000A, section
/// 6.1), one-sided, over √2.
const ANGLE_WALK_FLOOR: f64 = 0.005 / std::f64::consts::SQRT_2;

/// Part of a phase that is left out where the phase began with a motion: what is left of faster ones hides in the noise.
const MARGIN: f64 = 0.25;

/// How far the bias may move during a trial, °/s: a third of what the data sheet allows for a degree of warming.
const BIAS_CHANGE: f64 = 0.1;

/// Standard deviation of what it usually moves by for a degree of warming, °/s: a tenth of the same.
pub(super) const BIAS_SPREAD: f64 = 0.03;

/// Fastest return that blocks can tell, s; the slowest is a part of the time that it is seen.
const FASTEST_S: f64 = 1.5;
const SLOWEST: f64 = 0.4;

/// A time in which the gyroscope's bias was seen.
pub(super) struct Phase {
    pub range: Range<f64>,
    /// Mean rate of the bias, °/s.
    pub rate: f64,
    /// Variance of the rate over that of the angle random walk, 1/s.
    pub unknown: f64,
    /// Sum of the squares of what the blocks' rates have left, and its degrees of freedom.
    scatter: (f64, f64),
}

impl Phase {
    /// All of a time at rest. `None` where it is too short to say anything.
    pub fn still(yaw: &Track, range: Range<f64>) -> Option<Self> {
        let span = yaw.span();
        let range = range.start.max(span.start)..range.end.min(span.end);
        let blocks = blocks(yaw, &range, MIN_BLOCKS)?;
        let rate = yaw.rate(range.clone())?;
        Some(Self { rate, unknown: 1.0 / (range.end - range.start), scatter: about_mean(&blocks), range })
    }

    /// A time in which the robot may still come to rest.
    fn swing(yaw: &Track, range: Range<f64>) -> Option<Self> {
        let blocks = blocks(yaw, &range, MIN_SWING_BLOCKS)?;
        let steady = about_mean(&blocks);
        let fit = Swing::fit(&blocks, range.end - range.start)?;
        let floor = ANGLE_WALK_FLOOR.powi(2) / BLOCK_S;
        // Fisher's test, at about 90 %.
        let swings = 0.5 * (steady.0 - fit.scatter.0) > 3.0 * (fit.scatter.0 / fit.scatter.1).max(floor);
        if !swings {
            return Self::still(yaw, range);
        }
        let within = fit.time_constant_s > FASTEST_S && fit.time_constant_s < SLOWEST * (range.end - range.start);
        within.then_some(Self { rate: fit.rate, unknown: fit.unknown, scatter: fit.scatter, range })
    }

    /// The rate weighed against what the bias has usually become since `before`: a fit to little time says little.
    fn weighed(self, before: &Phase, walk: f64) -> Self {
        let usual = BIAS_SPREAD.powi(2);
        let weight = usual / (usual + walk.powi(2) * self.unknown);
        Self { rate: before.rate + weight * (self.rate - before.rate), unknown: weight * self.unknown, ..self }
    }

    pub fn middle(&self) -> f64 {
        0.5 * (self.range.start + self.range.end)
    }
}

/// Mean rates of the blocks of a time, the last ends with it. `None` where there are fewer than `least`.
fn blocks(yaw: &Track, range: &Range<f64>, least: usize) -> Option<Vec<f64>> {
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

/// A fitted return to rest.
struct Swing {
    rate: f64,
    unknown: f64,
    time_constant_s: f64,
    scatter: (f64, f64),
}

impl Swing {
    /// The best of many time constants; the rest is linear.
    fn fit(blocks: &[f64], length_s: f64) -> Option<Self> {
        const TRIED: u32 = 60;
        let ratio = SLOWEST * length_s / FASTEST_S;
        let all =
            (0..=TRIED).filter_map(|i| Self::with(blocks, FASTEST_S * ratio.powf(f64::from(i) / f64::from(TRIED))));
        all.min_by(|a, b| a.scatter.0.total_cmp(&b.scatter.0))
    }

    fn with(blocks: &[f64], time_constant_s: f64) -> Option<Self> {
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
            rate: solution.x,
            // The time constant is a parameter too; how large the swing is does not matter for the rate.
            unknown: normal.try_inverse()?[(0, 0)] / BLOCK_S,
            time_constant_s,
            scatter: (squares, blocks.len() as f64 - 3.0),
        })
    }
}

/// Angle random walk and its degrees of freedom.
pub(super) fn noise(phases: &[Phase]) -> Option<(f64, f64)> {
    let (sum, freedom) =
        phases.iter().map(|phase| phase.scatter).fold((0.0, 0.0), |(sum, freedom), (s, f)| (sum + s, freedom + f));
    (freedom > 0.0).then(|| ((sum / freedom * BLOCK_S).sqrt().max(ANGLE_WALK_FLOOR), freedom))
}

/// The longest end of `range` in which the robot is still, or swings back in a way that can be told from a bias: as quiet
/// as before the run, and with a rate that a bias can have become. Three standard deviations are allowed.
pub(super) fn after_run(yaw: &Track, range: Range<f64>, before: &Phase) -> Option<Phase> {
    let (walk, _) = noise(std::slice::from_ref(before))?;
    let is_rest = |phase: &Phase| {
        let (squares, freedom) = phase.scatter;
        let quiet = (squares / freedom * BLOCK_S).sqrt() < 1.5 * walk;
        let noise = walk.powi(2) * (phase.unknown + before.unknown) + BIAS_CHANGE.powi(2);
        quiet && (phase.rate - before.rate).abs() < 3.0 * noise.sqrt()
    };
    let end = range.end.min(yaw.span().end);
    let mut start = range.start;
    while end - start > MIN_SWING_BLOCKS as f64 * BLOCK_S {
        if Phase::swing(yaw, start..end).is_some_and(|phase| is_rest(&phase)) {
            let hidden = if start > range.start { MARGIN * (end - start) } else { 0.0 };
            return Phase::swing(yaw, start + hidden..end).filter(is_rest).map(|phase| phase.weighed(before, walk));
        }
        start += BLOCK_S / 2.0;
    }
    None
}
