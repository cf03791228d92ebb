//! Flicker and random walk of a gyroscope's bias, from the rates of a long rest.
//!
//! The mean rates over groups of bins are a sum of independent Gaussian parts: a constant, its change with temperature, a
//! random walk K of the bias, flicker with the instability B, and white noise N²/T over a group of length T. Every pair
//! of K and B in a grid is weighted by its prior and by the evidence of the rates (Rasmussen and Williams, Gaussian
//! Processes for Machine Learning, 2006, eq. 2.30). So a part that hides in the noise also gets a mean and a standard
//! deviation.

use super::{BIAS_WALK, Estimate};
use crate::attitude::{BiasNoise, WARMING_DPS_PER_C};
use nalgebra::{DMatrix, DVector};
use sim::functions::{exp, ln, ln_1p, pow, powi};

/// Most groups, and fewest bins in a group: longer than the delay of every filter.
const MOST_GROUPS: usize = 90;
const LEAST_BINS: usize = 10;

/// Standard deviation of the constant, °/s, for a gyroscope that was never calibrated.
const CONSTANT_DPS: f64 = 20.0;

/// Range of the grid, in units of the priors' scales. Its lower end is less than a trial can show.
const MOST: f64 = 100.0;
const LEAST: f64 = 0.03;
const TRIED: usize = 18;

/// Scales of the priors: of the walk, °/s/√s, and of the instability, °/s. An MPU6050 at rest for 655 s had a walk of a
/// fifth of [`BIAS_WALK`], and a floor of 0.004 °/s on one axis.
const USUAL_WALK: f64 = BIAS_WALK / 5.0;
const USUAL_INSTABILITY_DPS: f64 = 0.006;

/// Noise of the bias about an axis, estimated from a rest.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct BiasEstimate {
    /// Random walk K, °/s/√s.
    pub walk: Estimate,
    /// Bias instability B, °/s.
    pub instability_dps: Estimate,
}

/// Estimates the noise. `rates_dps` and `temperature_c`: means over bins of `bin_s`; `angle_walk`: N, °/√s.
pub(super) fn of_rest(rates_dps: &[f64], temperature_c: &[f64], bin_s: f64, angle_walk: f64) -> BiasEstimate {
    let size = rates_dps.len().div_ceil(MOST_GROUPS).max(LEAST_BINS);
    let length_s = size as f64 * bin_s;
    let means = |of: &[f64]| {
        let means: Vec<f64> = of.chunks_exact(size).map(|group| group.iter().sum::<f64>() / size as f64).collect();
        DVector::from_vec(means).add_scalar(-of.iter().sum::<f64>() / of.len() as f64)
    };
    let (rates, warmth) = (means(rates_dps), WARMING_DPS_PER_C * means(temperature_c));
    let count = rates.len();
    let apart = DMatrix::identity(count, count) * (powi(angle_walk, 2) / length_s);
    let own = apart.add_scalar(powi(CONSTANT_DPS, 2)) + &warmth * warmth.transpose();
    let group = |k: usize| k as f64 * length_s..(k + 1) as f64 * length_s;
    let [walk, flicker] = [(1.0, 0.0), (0.0, 1.0)].map(|(walk_dps_per_root_s, instability_dps)| {
        let unit = BiasNoise { walk_dps_per_root_s, instability_dps };
        DMatrix::from_fn(count, count, |i, j| unit.covariance(&group(i), &group(j), 0.0))
    });
    let list = |usual: f64| (0..TRIED).map(move |k| usual * LEAST * pow(MOST / LEAST, k as f64 / (TRIED - 1) as f64));
    let mut tried = Vec::new();
    for instability in list(USUAL_INSTABILITY_DPS) {
        let own = &own + &flicker * powi(instability, 2);
        for k in list(USUAL_WALK) {
            let Some(factored) = (&own + &walk * powi(k, 2)).cholesky() else { continue };
            let log_prior = log_prior(k / USUAL_WALK) + log_prior(instability / USUAL_INSTABILITY_DPS);
            let misfit = rates.dot(&factored.solve(&rates));
            let ln_determinant = factored.l_dirty().diagonal().iter().map(|pivot| 2.0 * ln(*pivot)).sum::<f64>();
            tried.push(([k, instability], log_prior - 0.5 * (misfit + ln_determinant)));
        }
    }
    let best = tried.iter().map(|(_, weight)| *weight).fold(f64::NEG_INFINITY, f64::max);
    let sum = |of: &dyn Fn(&[f64; 2]) -> f64| tried.iter().map(|(at, weight)| of(at) * exp(weight - best)).sum::<f64>();
    let estimate = |which: usize| {
        let mean = |power: i32| sum(&|at| powi(at[which], power)) / sum(&|_| 1.0);
        Estimate { value: mean(1), u: (mean(2) - powi(mean(1), 2)).max(0.0).sqrt() }
    };
    BiasEstimate { walk: estimate(0), instability_dps: estimate(1) }
}

/// Returns the log prior of a point of the grid, whose steps are proportional to the value: half a Cauchy distribution,
/// because sensors differ by orders of magnitude.
fn log_prior(scaled: f64) -> f64 {
    ln(scaled) - ln_1p(scaled * scaled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::tests::Random;

    const ANGLE_WALK: f64 = 0.005;
    const BIN_S: f64 = 0.1;
    const SEEDS: u64 = 12;

    /// Returns the estimate from a simulated rest with a walk and with flicker, made of walks that revert with time
    /// constants in a ratio of 5.
    fn found(seed: u64, seconds: f64, walk: f64, instability: f64) -> BiasEstimate {
        let mut random = Random::new(seed);
        let mut bias = 3.0;
        let mut parts = [0.5, 2.5, 12.5, 62.5, 312.5, 1562.5].map(|tau| (tau, random.normal()));
        let each = instability * (5f64.ln() / std::f64::consts::PI).sqrt();
        let bins = (seconds / BIN_S) as usize;
        let warm = |i: usize| 25.0 + 2.0 * (1.0 - (-(i as f64) * BIN_S / 150.0).exp());
        let temperature: Vec<f64> = (0..bins).map(warm).collect();
        let rates: Vec<f64> = (temperature.iter())
            .map(|celsius| {
                bias += walk * BIN_S.sqrt() * random.normal();
                for (tau, value) in &mut parts {
                    let keeps = (-BIN_S / *tau).exp();
                    *value = keeps * *value + (1.0 - keeps * keeps).sqrt() * random.normal();
                }
                let flicker = each * parts.iter().map(|(_, value)| value).sum::<f64>();
                bias + flicker + 0.04 * (celsius - 25.0) + ANGLE_WALK / BIN_S.sqrt() * random.normal()
            })
            .collect();
        of_rest(&rates, &temperature, BIN_S, ANGLE_WALK)
    }

    /// Returns the standard deviation of the change of the bias over 120 s, between means over 20 s.
    fn change_dps(walk: f64, instability_dps: f64) -> f64 {
        let (length_s, apart_s) = (20.0, 120.0);
        let noise = BiasNoise { walk_dps_per_root_s: walk, instability_dps };
        noise.change_dps(&(0.0..length_s), &(apart_s..apart_s + length_s))
    }

    /// Returns the root mean square of the walk and of the instability over some rests.
    fn sizes(seconds: f64, walk: f64, instability: f64) -> [f64; 2] {
        let all: Vec<BiasEstimate> = (0..SEEDS).map(|seed| found(seed, seconds, walk, instability)).collect();
        let mean = |of: fn(&BiasEstimate) -> Estimate| {
            let squares = all.iter().map(|noise| of(noise).value.powi(2) + of(noise).u.powi(2));
            (squares.sum::<f64>() / all.len() as f64).sqrt()
        };
        let sizes = [mean(|noise| noise.walk), mean(|noise| noise.instability_dps)];
        println!(
            "{seconds} s, walk {walk:.0e}, instability {instability:.0e}: found {:.1e}, {:.1e}",
            sizes[0], sizes[1]
        );
        sizes
    }

    /// Walk and flicker of a bias look alike within a rest, so only their joint effect over a trial is compared.
    #[test]
    fn the_change_over_a_trial_is_that_of_the_sensor() {
        for (walk, instability) in [(3e-4, 0.0), (1e-3, 0.0), (4e-3, 0.0), (0.0, 6e-3), (0.0, 2e-2), (5e-4, 5e-3)] {
            let found = sizes(600.0, walk, instability);
            let ratio = change_dps(found[0], found[1]) / change_dps(walk, instability);
            println!("change: {ratio:.2} of the true one");
            assert!((0.8..1.4).contains(&ratio), "{walk}, {instability}: {found:?}, {ratio}");
        }
        let [walk, flicker] = sizes(600.0, 0.0, 2e-2);
        assert!((0.7..1.3).contains(&(flicker / 2e-2)) && walk < 1e-3, "{walk}, {flicker}");
    }

    #[test]
    fn what_nothing_shows_has_the_size_that_may_hide() {
        let [short, long, longer] = [30.0, 600.0, 3600.0].map(|seconds| sizes(seconds, 0.0, 0.0));
        for which in [0, 1] {
            assert!(
                short[which] > 1.3 * long[which] && long[which] > 1.3 * longer[which],
                "{short:?} {long:?} {longer:?}"
            );
        }
    }
}
