//! A Bayesian smoother for the gyroscope's bias about one axis, from the mean rates over stretches of rest.
//!
//! The rate at rest is a sum of independent Gaussian parts:
//!
//! - a constant bias;
//! - its change with the sensor's temperature, proportional to the warming in the log;
//! - a random walk and flicker;
//! - the robot's return to rest before the run, and the one after it: A exp(-t/τ) each, and a faster one after the run;
//! - a share of the rates at which the tilt returns to rest: the yaw follows the tilt, and the axis measures part of
//!   it;
//! - white noise, of variance N²/L over a stretch of length L, where N is the angle random walk.
//!
//! The result is linear in the observed rates (Gaussian process regression: Rasmussen and Williams, Gaussian Processes for
//! Machine Learning, 2006, eq. 2.25 and 2.26). The time constants and the sizes of the motions are not known:
//! [`super::returns`] averages over them.

use super::rest::Stretch;
use super::returns::{self, Motions, Rotation, Still};
use super::{BiasNoise, Track};
use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Standard deviation of the constant bias after the calibration, °/s.
const BIAS_DPS: f64 = 1.0;

/// Standard deviation of the change of the bias with temperature, °/s/°C: a tenth of the data sheet's ±20 °/s over -40
/// to 85 °C (PS-MPU-6000A, section 6.1).
pub const WARMING_DPS_PER_C: f64 = 0.03;

/// Standard deviation of the share of the tilt's rates in the rate about an axis at rest. The robot's yaw follows its
/// returning tilt with some hundredths of the tilt's rate (`cargo test --release -p sim --test all returning_tilt --
/// --nocapture`), and the data sheet allows cross-axis terms of 0.02 and scale errors of 0.03 (PS-MPU-6000A, section
/// 6.1).
const TILT_SHARE: f64 = 0.03;

/// The times at which to estimate the rotation.
pub(super) struct Target<'a> {
    /// Times, ascending, s.
    pub times: &'a [f64],
    /// Component of the axis along the vertical at each of the times.
    pub weights: &'a [f64],
    /// The rotation is zero at this time, s.
    pub from_s: f64,
    /// Noise of the bias about the axis.
    pub bias_noise: BiasNoise,
}

/// Estimates the rotation that the bias about one axis causes. `motions` is `None` if the rates at rest about this axis
/// contain no motion. Returns `None` without stretches.
pub(super) fn rotation(
    stretches: &[Stretch],
    temperature_c: Track,
    target: &Target,
    motions: Option<&Motions>,
) -> Option<Rotation> {
    let first = stretches.first()?;
    let temperature = |range: &Range<f64>| temperature_c.mean(range.clone()).unwrap_or_default();
    let reference_c = temperature(&first.range);
    // Each scaled to unit variance.
    let constant_and_warming = |k: usize, celsius: f64| [BIAS_DPS, WARMING_DPS_PER_C * (celsius - reference_c)][k];
    let n = stretches.len();
    // Subtract the mean rate, so that the prior of the constant is centred on the observations.
    let offset = stretches.iter().map(|stretch| stretch.rate).sum::<f64>() / n as f64;
    let rates = DVector::from_iterator(n, stretches.iter().map(|stretch| stretch.rate - offset));
    let seen = DMatrix::from_fn(n, 2, |i, k| constant_and_warming(k, temperature(&stretches[i].range)));
    let instants = DMatrix::from_fn(target.times.len(), 2, |i, k| {
        target.weights[i] * constant_and_warming(k, temperature_c.at(target.times[i]).unwrap_or_default())
    });
    let wanted = integrals(instants, target);
    let [own, cross, prior] = changes(stretches, target);
    let noise = DMatrix::from_diagonal(&DVector::from_iterator(n, stretches.iter().map(|stretch| stretch.variance)));
    let tilts = DMatrix::from_fn(n, 2, |i, k| TILT_SHARE * stretches[i].tilt_dps[k]);
    let own = &seen * seen.transpose() + &tilts * tilts.transpose() + noise + own;
    let cross = &wanted * seen.transpose() + cross;
    let prior = &wanted * wanted.transpose() + prior;
    let constant = DVector::from_fn(target.times.len(), |i, _| offset * wanted[(i, 0)] / BIAS_DPS);
    let factored = Cholesky::new(own)?;
    let rates = factored.l_dirty().solve_lower_triangular(&rates)?;
    let cross = factored.l_dirty().solve_lower_triangular(&cross.transpose())?.transpose();
    let mut mean = &cross * &rates + constant;
    let mut covariance = prior - &cross * cross.transpose();
    let mut residual_dps = [0.0; 2];
    if let Some(motions) = motions {
        let still = Still { stretches, factored, rates, cross, from_s: target.from_s };
        let returns = returns::mixed(&still, motions);
        mean += returns.mean;
        covariance += returns.covariance;
        residual_dps = returns.residual_dps;
    }
    Some(Rotation { mean, covariance, residual_dps })
}

/// Integrates columns of values at the times of the target from the reference time to each of them.
fn integrals(instants: DMatrix<f64>, target: &Target) -> DMatrix<f64> {
    let mut sums = instants;
    for mut column in sums.column_iter_mut() {
        let mut last = std::mem::take(&mut column[0]);
        for i in 1..column.len() {
            let next = column[i];
            column[i] = column[i - 1] + 0.5 * (last + next) * (target.times[i] - target.times[i - 1]);
            last = next;
        }
        let values: Vec<f64> = column.iter().copied().collect();
        column.add_scalar_mut(-Track { time_s: target.times, value: &values }.at(target.from_s).unwrap_or_default());
    }
    sums
}

/// Returns the contribution of the bias noise to three covariances: of the rates, of the rotation with the rates, and of
/// the rotation.
fn changes(stretches: &[Stretch], target: &Target) -> [DMatrix<f64>; 3] {
    let Target { times, weights, bias_noise, .. } = *target;
    let n = stretches.len();
    // The bias at a time of the grid is its mean over the interval around it.
    let half = times.get(1).map_or(0.5, |next| 0.5 * (next - times[0]));
    let around = |i: usize| times[i] - half..times[i] + half;
    let from_s = stretches.first().map_or(f64::INFINITY, |first| first.range.start).min(around(0).start);
    let between = |one: &Range<f64>, other: &Range<f64>| bias_noise.covariance(one, other, from_s);
    let cross = DMatrix::from_fn(times.len(), n, |i, j| weights[i] * between(&around(i), &stretches[j].range));
    let lagged: Vec<f64> = (0..times.len()).map(|lag| bias_noise.of_flicker(&around(0), &around(lag))).collect();
    let instants = DMatrix::from_fn(times.len(), times.len(), |i, j| {
        weights[i] * weights[j] * (lagged[i.abs_diff(j)] + bias_noise.of_walk(&around(i), &around(j), from_s))
    });
    let own = DMatrix::from_fn(n, n, |i, j| between(&stretches[i].range, &stretches[j].range));
    [own, integrals(cross, target), integrals(integrals(instants, target).transpose(), target)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two of the initial time constants explain the rates equally well, and a third between them does better.
    #[test]
    fn time_constant_between_those_that_are_tried_first_is_found() {
        let (run_s, after_s) = (20.0, 152.0);
        let stretch = |start: f64, rate: f64| Stretch {
            range: start..start + 2.0,
            rate,
            variance: 0.0036f64.powi(2) / 2.0,
            tilt_dps: [0.0; 2],
        };
        let before = (0..7).map(|i| stretch(6.0 + 2.0 * f64::from(i), 0.0));
        let after = (0..9).map(|i| stretch(after_s + 2.0 * f64::from(i), 0.2 * (-f64::from(i) / 3.35).exp()));
        let stretches: Vec<Stretch> = before.chain(after).collect();
        let times: Vec<f64> = (0..=170).map(f64::from).collect();
        let bias_noise = BiasNoise { walk_dps_per_root_s: 1e-4, instability_dps: 0.0 };
        let target = Target { times: &times, weights: &[1.0; 171], from_s: 19.5, bias_noise };
        let motions = Motions { run_s, stop_s: 140.0, after_s, time_constant_s: Some(6.0) };
        let temperature = Track { time_s: &times, value: &[25.0; 171] };
        let found = rotation(&stretches, temperature, &target, Some(&motions)).unwrap();
        let (at_end, u) = (found.mean[139], found.covariance[(139, 139)].sqrt());
        println!("{at_end:.3} ± {u:.3}");
        assert!(at_end.abs() < 0.1 && u < 0.25, "{at_end} {u}");
    }
}
