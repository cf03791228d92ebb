//! The noise of a gyroscope's bias: a random walk and flicker.
//!
//! The walk has the variance K² t after a time t, so the covariance at two times is K² times the earlier one. Flicker
//! is the noise whose Allan deviation is flat, at 0.664 of the bias instability B. Its two-sided density is B²/(2π f)
//! (IEEE Std 952-2020, annex C). A sum of first-order Gauss-Markov processes has this density between the frequencies
//! of the slowest and the fastest one, if successive time constants have the ratio r and each variance is B² ln r/π.

use sim::functions::{exp, ln, powi};
use std::f64::consts::PI;
use std::ops::Range;

/// Time constants, s: slower flicker is constant during a trial, faster flicker is part of the angle random walk.
const TIME_CONSTANTS_S: [f64; 8] = [0.632, 2.0, 6.32, 20.0, 63.2, 200.0, 632.0, 2000.0];
const RATIO: f64 = 3.162;

/// The noise of a gyroscope's bias about an axis.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct BiasNoise {
    /// Random walk K, °/s/√s.
    pub walk_dps_per_root_s: f64,
    /// Bias instability B of the flicker, °/s.
    pub instability_dps: f64,
}

impl BiasNoise {
    /// Returns the covariance of the mean biases over two stretches of time, (°/s)². The walk is zero at `from_s`, not
    /// later than either stretch.
    pub fn covariance(self, one: &Range<f64>, other: &Range<f64>, from_s: f64) -> f64 {
        self.of_walk(one, other, from_s) + self.of_flicker(one, other)
    }

    /// Returns the walk's part of the covariance.
    pub(super) fn of_walk(self, one: &Range<f64>, other: &Range<f64>, from_s: f64) -> f64 {
        // The earlier of two times is half their sum minus half their distance; |x|³/6 is the second integral of |x|.
        let apart = mean(one, other, |x| powi(x.abs(), 3) / 6.0);
        let middle = |range: &Range<f64>| 0.5 * (range.start + range.end) - from_s;
        0.5 * powi(self.walk_dps_per_root_s, 2) * (middle(one) + middle(other) - apart)
    }

    /// Returns the flicker's part, which depends only on the time between the stretches.
    pub(super) fn of_flicker(self, one: &Range<f64>, other: &Range<f64>) -> f64 {
        if self.instability_dps == 0.0 {
            return 0.0;
        }
        // The second integral of exp(-|x|/τ).
        let of_process = |tau: f64| mean(one, other, |x| tau * tau * (exp(-x.abs() / tau) + x.abs() / tau));
        let variance = powi(self.instability_dps, 2) * ln(RATIO) / PI;
        variance * TIME_CONSTANTS_S.map(of_process).iter().sum::<f64>()
    }

    /// Returns the standard deviation of the change of the bias between two stretches of time, °/s.
    pub fn change_dps(self, one: &Range<f64>, other: &Range<f64>) -> f64 {
        let from_s = one.start.min(other.start);
        let [first, second, both] =
            [(one, one), (other, other), (one, other)].map(|(a, b)| self.covariance(a, b, from_s));
        (first + second - 2.0 * both).max(0.0).sqrt()
    }
}

/// Returns the mean of a function of the distance between two times, one in each stretch. `twice`: the function's
/// second integral.
fn mean(one: &Range<f64>, other: &Range<f64>, twice: impl Fn(f64) -> f64) -> f64 {
    let sum = twice(one.end - other.start) - twice(one.end - other.end) - twice(one.start - other.start)
        + twice(one.start - other.end);
    sum / ((one.end - one.start) * (other.end - other.start))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLICKER: BiasNoise = BiasNoise { walk_dps_per_root_s: 0.0, instability_dps: 0.01 };

    #[test]
    fn allan_deviation_of_flicker_is_flat() {
        for tau in [10.0, 30.0, 100.0, 300.0] {
            let deviation = FLICKER.change_dps(&(0.0..tau), &(tau..2.0 * tau)) / 2f64.sqrt();
            println!("{tau} s: {deviation:.5}");
            assert!((deviation / 0.00664 - 1.0).abs() < 0.06, "{tau} s: {deviation}");
        }
    }

    /// The Allan deviation of a walk is K √(τ/3) (IEEE Std 952-2020, annex C).
    #[test]
    fn allan_deviation_of_a_walk_grows_with_the_root_of_time() {
        let walk = BiasNoise { walk_dps_per_root_s: 5e-4, instability_dps: 0.0 };
        for tau in [0.7, 13.0, 240.0] {
            let deviation = walk.change_dps(&(40.0..40.0 + tau), &(40.0 + tau..40.0 + 2.0 * tau)) / 2f64.sqrt();
            assert!((deviation / (5e-4 * (tau / 3.0).sqrt()) - 1.0).abs() < 1e-9, "{tau} s: {deviation}");
        }
    }

    #[test]
    fn means_over_short_and_distant_stretches_are_those_of_the_processes() {
        let both = BiasNoise { walk_dps_per_root_s: 3e-4, ..FLICKER };
        let variance = 1e-4 * RATIO.ln() / PI;
        let at = |t: f64| t - 1e-3..t + 1e-3;
        let flicker = |apart: f64| variance * TIME_CONSTANTS_S.map(|tau| (-apart / tau).exp()).iter().sum::<f64>();
        for apart in [0.0, 5.0, 50.0, 500.0] {
            let (found, expected) = (both.covariance(&at(7.0), &at(7.0 + apart), 2.0), flicker(apart) + 9e-8 * 5.0);
            assert!((found / expected - 1.0).abs() < 1e-3, "{apart} s: {found} {expected}");
        }
    }
}
