//! Flicker of a gyroscope's bias: the noise whose Allan deviation is flat, at 0.664 of the bias instability B.
//!
//! Its two-sided density is B²/(2π f) (IEEE Std 952-2020, annex C). A sum of first-order Gauss-Markov processes whose time
//! constants are in the ratio r, each of variance B² ln r/π, has this density between the frequencies of the slowest and the
//! fastest one.

use std::f64::consts::PI;
use std::ops::Range;

/// Time constants, s: slower flicker is a constant in a trial, faster is part of the angle random walk.
const TIME_CONSTANTS_S: [f64; 8] = [0.632, 2.0, 6.32, 20.0, 63.2, 200.0, 632.0, 2000.0];
const RATIO: f64 = 3.162;

/// Flicker with a bias instability.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Flicker {
    /// Bias instability B, °/s.
    pub instability_dps: f64,
}

impl Flicker {
    /// Returns the covariance of the mean biases over two stretches of time, (°/s)².
    pub fn covariance(self, one: &Range<f64>, other: &Range<f64>) -> f64 {
        if self.instability_dps == 0.0 {
            return 0.0;
        }
        let area = (one.end - one.start) * (other.end - other.start);
        let of_process = |tau: f64| {
            // The second integral of exp(-|x|/τ).
            let twice = |x: f64| tau * tau * ((-x.abs() / tau).exp() + x.abs() / tau);
            twice(one.end - other.start) - twice(one.end - other.end) - twice(one.start - other.start)
                + twice(one.start - other.end)
        };
        let variance = self.instability_dps.powi(2) * RATIO.ln() / PI;
        variance * TIME_CONSTANTS_S.map(of_process).iter().sum::<f64>() / area
    }

    /// Returns the standard deviation of the change of the bias between two stretches of time, °/s.
    pub fn change_dps(self, one: &Range<f64>, other: &Range<f64>) -> f64 {
        let between = self.covariance(one, other);
        (self.covariance(one, one) + self.covariance(other, other) - 2.0 * between).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allan_deviation_is_flat() {
        let flicker = Flicker { instability_dps: 0.01 };
        for tau in [10.0, 30.0, 100.0, 300.0] {
            let deviation = flicker.change_dps(&(0.0..tau), &(tau..2.0 * tau)) / 2f64.sqrt();
            println!("{tau} s: {deviation:.5}");
            assert!((deviation / 0.00664 - 1.0).abs() < 0.06, "{tau} s: {deviation}");
        }
    }

    #[test]
    fn means_over_short_and_distant_stretches_are_those_of_the_processes() {
        let flicker = Flicker { instability_dps: 0.01 };
        let variance = 1e-4 * RATIO.ln() / PI;
        let at = |t: f64| t - 1e-3..t + 1e-3;
        let expected = |apart: f64| variance * TIME_CONSTANTS_S.map(|tau| (-apart / tau).exp()).iter().sum::<f64>();
        for apart in [5.0, 50.0, 500.0] {
            let found = flicker.covariance(&at(0.0), &at(apart));
            assert!((found / expected(apart) - 1.0).abs() < 1e-3, "{apart} s: {found} {}", expected(apart));
        }
        assert!((flicker.covariance(&at(0.0), &at(0.0)) / expected(0.0) - 1.0).abs() < 1e-3);
    }
}
