//! Decides whether a robot with its motors off is still, from the uncalibrated sensor alone.
//!
//! The return to rest is overdamped, so one exponential remains at its end: the rate about the vertical is b + A
//! exp(-t/τ), where b is the gyroscope's unknown bias, of up to 20 °/s, and A the robot's rate at present, t = 0. The
//! accelerometer's tilt, with an unknown offset too, is c + D exp(-t/τ), and its present rate is D/τ. Both are fitted
//! by least squares to the longest stretch up to the present that one exponential describes within the noise: a longer
//! stretch begins with faster motions, or a push. The bound on a rate is its magnitude plus two standard deviations,
//! maximised over all time constants that fit the stretch about as well as the best one.
//!
//! At first, a return to rest with a time constant of a minute looks like a bias. So a still robot is only recognised
//! after 10 s with an MPU6050 as in its data sheet, and after 20 s with a three times noisier one.

use crate::statistics::Line;
use sim::functions::{atan2, exp, hypot, powi};
use std::collections::VecDeque;

/// Largest rate of the yaw of a still robot, °/s.
pub const STILL_YAW_DPS: f64 = 0.05;

/// Largest rate of the tilt of a still robot, °/s.
pub const STILL_TILT_DPS: f64 = 0.01;

/// Length of the blocks of readings, s.
const BLOCK_S: f64 = 0.5;

/// Smallest and largest number of blocks in a stretch, and the step between the lengths tried.
const LEAST: usize = 12;
const MOST: usize = 60;
const STEP: usize = 6;

/// Longest gap between two readings, s. After a longer gap the motion is unknown.
const GAP_S: f64 = 1.0;

/// Time constants of a return to rest: the shortest, s, the ratio of successive ones, and their number. The longest is
/// a minute.
const SHORTEST_S: f64 = 1.5;
const RATIO: f64 = 1.12;
const TIME_CONSTANTS: i32 = 34;

/// Smallest assumed standard deviation of a block's mean: rate, °/s, and tilt, degrees. The MPU6050's noise densities
/// are 0.005 °/s/√Hz and 400 µg/√Hz (data sheet PS-MPU-6000A, sections 6.1 and 6.2), one-sided.
const RATE_NOISE_DPS: f64 = 0.005;
const TILT_NOISE_DEG: f64 = 0.0229;

/// Largest residual of a stretch, relative to the noise.
const QUIET: f64 = 1.5;

/// A time constant is possible if its sum of squares exceeds the smallest one by at most this many variances.
const POSSIBLE: f64 = 16.0;

/// Number of standard deviations in a bound.
const COVERAGE: f64 = 2.0;

/// Upper bounds on the rates at which a robot may still move.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Motion {
    /// Bound for the yaw.
    pub yaw_dps: f64,
    /// Bound for the tilt.
    pub tilt_dps: f64,
}

impl Motion {
    /// Returns the larger of both bounds, relative to the limits of a still robot.
    pub fn relative(&self) -> f64 {
        (self.yaw_dps / STILL_YAW_DPS).max(self.tilt_dps / STILL_TILT_DPS)
    }

    /// Returns whether the robot is still.
    pub fn is_still(&self) -> bool {
        self.relative() <= 1.0
    }
}

/// Sums of the readings in a block: rate about z, °/s, and tilts about two axes, degrees.
#[derive(Clone, Copy, Default, Debug)]
struct Block {
    sums: [f64; 3],
    count: f64,
}

/// Judges whether a robot is still, reading by reading.
#[derive(Clone, Debug, Default)]
pub struct Still {
    /// The latest blocks, the latest one last; a block without readings has a count of zero.
    blocks: VecDeque<Block>,
    /// The incomplete block, with its start.
    open: Option<(f64, Block)>,
    last_s: Option<f64>,
}

impl Still {
    /// Adds a reading at a time, s: rate about the body's z, °/s, with any constant bias, and specific force in body axes, in
    /// any unit.
    pub fn push(&mut self, time_s: f64, rate_dps: f64, force: [f64; 3]) {
        let passed_s = self.last_s.map_or(0.0, |last| time_s - last);
        if !(0.0..=GAP_S).contains(&passed_s) {
            self.clear();
        }
        self.last_s = Some(time_s);
        let (mut start_s, mut block) = self.open.unwrap_or((time_s, Block::default()));
        let passed = ((time_s - start_s + 1e-6) / BLOCK_S).floor();
        if passed >= 1.0 {
            self.blocks.push_back(block);
            // Whole blocks of readings may be missing.
            (1..passed as usize).for_each(|_| self.blocks.push_back(Block::default()));
            while self.blocks.len() > MOST {
                self.blocks.pop_front();
            }
            (start_s, block) = (start_s + passed * BLOCK_S, Block::default());
        }
        let [x, y, z] = force;
        for (sum, value) in block.sums.iter_mut().zip([rate_dps, atan2(x, z).to_degrees(), atan2(y, z).to_degrees()]) {
            *sum += value;
        }
        block.count += 1.0;
        self.open = Some((start_s, block));
    }

    /// Discards all readings, because the motors have turned or the bias of the rates has changed.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Returns the bounds on the robot's present motion; `None` if there are too few readings.
    pub fn motion(&self) -> Option<Motion> {
        let tilt = |k: usize| self.bound(k, TILT_NOISE_DEG, |tau_s| 1.0 / tau_s);
        Some(Motion { yaw_dps: self.bound(0, RATE_NOISE_DPS, |_| 1.0)?, tilt_dps: hypot(tilt(1)?, tilt(2)?) })
    }

    /// Returns the bound on a quantity: the present amplitude of the decay in the means of the blocks, times `factor`
    /// of its time constant.
    fn bound(&self, k: usize, noise: f64, factor: impl Fn(f64) -> f64) -> Option<f64> {
        let longest = self.blocks.len().checked_sub(LEAST)? / STEP * STEP + LEAST;
        (LEAST..=longest).rev().step_by(STEP).find_map(|count| {
            let blocks = self.blocks.range(self.blocks.len() - count..).enumerate();
            // Times relative to the present.
            let (times, means): (Vec<f64>, Vec<f64>) = blocks
                .filter(|(_, block)| block.count > 0.0)
                .map(|(i, block)| ((i as f64 + 0.5 - count as f64) * BLOCK_S, block.sums[k] / block.count))
                .unzip();
            let decays: Vec<(f64, Line)> = (0..TIME_CONSTANTS)
                .map(|i| SHORTEST_S * powi(RATIO, i))
                .map(|tau_s| {
                    (tau_s, Line::through(times.iter().map(|time| exp(-time / tau_s)).zip(means.iter().copied())))
                })
                .collect();
            let least = decays.iter().map(|(_, fit)| fit.squares).fold(f64::INFINITY, f64::min);
            // Bias, amount and time constant are fitted.
            let variance = (least / (means.len() as f64 - 3.0)).max(noise * noise);
            if count > LEAST && variance > QUIET * QUIET * roughness(&means).max(noise * noise) {
                return None;
            }
            let possible = decays.iter().filter(|(_, fit)| fit.squares <= least + POSSIBLE * variance);
            let amount = |fit: &Line| fit.slope.abs() + COVERAGE * (variance / fit.spread).sqrt();
            Some(possible.map(|(tau_s, fit)| factor(*tau_s) * amount(fit)).fold(0.0, f64::max))
        })
    }
}

/// Returns the noise variance of values from their second differences, in which slow changes cancel.
fn roughness(values: &[f64]) -> f64 {
    let squares = values.windows(3).map(|three| powi(three[0] - 2.0 * three[1] + three[2], 2));
    squares.sum::<f64>() / (6.0 * (values.len() as f64 - 2.0))
}
