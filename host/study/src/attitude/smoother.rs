//! A Bayesian smoother for the gyroscope's bias about one axis, from the mean rates over stretches of rest.
//!
//! The rate at rest is a sum of independent Gaussian parts:
//!
//! - a constant bias;
//! - its change with the sensor's temperature, proportional to the warming in the log;
//! - a random walk and flicker;
//! - the robot's return to rest before the run, and the one after it: A exp(-t/τ) each, and a faster one after the run;
//! - a share of the rates at which the tilt returns to rest, which takes the yaw along and which the axis reads besides;
//! - white noise, of variance N²/L over a stretch of length L, where N is the angle random walk.
//!
//! The result is linear in the observed rates (Gaussian process regression: Rasmussen and Williams, Gaussian Processes for
//! Machine Learning, 2006, eq. 2.25 and 2.26). The time constant τ and the sizes of both motions are not known: every
//! combination of a list is weighted by the evidence that the rates give for it (eq. 2.30) and by what the robot's parameters
//! say of τ, and the results are mixed.
//! So a return to rest that hides in the noise adds to the uncertainty what it may hide, and ten seconds of rest help by
//! ten seconds' worth.

use super::{BiasNoise, Track};
use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use std::ops::Range;

/// Standard deviation of the constant bias after the calibration, °/s.
const BIAS_DPS: f64 = 1.0;

/// Standard deviation of the change of the bias with temperature, °/s/°C: a tenth of what the data sheet's ±20 °/s over -40
/// to 85 °C (PS-MPU-6000A, section 6.1) amounts to.
pub const WARMING_DPS_PER_C: f64 = 0.03;

/// Time constants of a return to rest that are tried first, s. More are tried between those of which the weights differ.
const TIME_CONSTANTS_S: [f64; 7] = [1.5, 2.7, 5.0, 9.0, 16.0, 28.0, 50.0];
const MOST_TIME_CONSTANTS: usize = 60;

/// Standard deviation of the logarithm of a robot's time constant about that of its parameters, which are not fitted yet, and
/// the probability that the parameters are those of another robot.
const ROBOT_WITHIN: f64 = 0.5;
const OTHER_ROBOT: f64 = 0.2;

/// Standard deviations of the rate of a return to rest that are tried, °/s: at the start of the run, where the recorder has
/// waited, and after it.
const BEFORE_DPS: [f64; 4] = [0.0, 0.01, 0.1, 1.0];
const AFTER_DPS: [f64; 5] = [0.0, 0.01, 0.1, 1.0, 10.0];

/// The faster motion after a run: its time constant, s, and the standard deviation of its rate when the motors stop, °/s. Soft
/// flagella spring back before they follow the tether: in the model, a run at 90 and 90 rpm ends with 64 °/s, of which three
/// quarters are gone every two seconds, until the slow return of 6.3 s remains. A fit of one exponential takes what is left of
/// it for a bias.
const FAST_S: f64 = 1.6;
const FAST_DPS: f64 = 60.0;

/// Prior weight of no motion, before the run and after it. Before it, the recorder has waited until the robot was still.
const STILL_BEFORE: f64 = 0.99;
const STILL_AFTER: f64 = 0.5;

/// Prior weight of a faster motion after the run: flagella are soft.
const HAS_FAST: f64 = 0.95;

/// Standard deviation of the share of the tilt's rates that the rate about an axis has at rest. The robot's yaw follows its
/// returning tilt by some hundredths of its rate (`cargo test --release -p sim --test all returning_tilt -- --nocapture`), and the data sheet allows
/// cross-axis terms of 0.02 and scale errors of 0.03 (PS-MPU-6000A, section 6.1).
const TILT_SHARE: f64 = 0.03;

/// Combinations of less than this weight, relative to the best one, are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// The mean rate over a stretch of rest.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Stretch {
    /// When it was.
    pub range: Range<f64>,
    /// Mean rate, °/s.
    pub rate: f64,
    /// Variance of the rate due to white noise, (°/s)².
    pub variance: f64,
    /// Mean rates of pitch and roll, °/s.
    pub tilt_dps: [f64; 2],
}

/// Where the robot may still have been moving.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Motions {
    /// Start of the run: the end of the first return to rest, s.
    pub run_s: f64,
    /// End of the run, s.
    pub stop_s: f64,
    /// Start of the rest after the run, s.
    pub after_s: f64,
    /// Their time constant by the robot's parameters, s; `None` if it is not known.
    pub time_constant_s: Option<f64>,
}

impl Motions {
    /// Returns the prior density of the logarithm of a time constant, not normalised: even, or about that of the robot.
    fn density(&self, tau: f64) -> f64 {
        let even = 1.0 / (TIME_CONSTANTS_S[TIME_CONSTANTS_S.len() - 1] / TIME_CONSTANTS_S[0]).ln();
        let near = |robot_s: f64| {
            let off = (tau / robot_s).ln() / ROBOT_WITHIN;
            (-0.5 * off * off).exp() / (ROBOT_WITHIN * TAU.sqrt())
        };
        self.time_constant_s.map_or(even, |robot_s| OTHER_ROBOT * even + (1.0 - OTHER_ROBOT) * near(robot_s))
    }
}

/// The rotation due to the bias, and its covariance, at each time of a grid. Zero at the reference time.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Rotation {
    /// Mean, degrees.
    pub mean: DVector<f64>,
    /// Covariance, degrees².
    pub covariance: DMatrix<f64>,
    /// Mean rate of the first return to rest at the start of the run and its standard deviation, °/s.
    pub residual_dps: [f64; 2],
}

/// The times at which a rotation is wanted.
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

/// Estimates the rotation that the bias about one axis causes. `motions` is `None` for an axis whose rates at rest have no
/// motion in them. Returns `None` without stretches.
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
    // Rates about their mean, so that the prior of the constant is about what is seen.
    let offset = stretches.iter().map(|stretch| stretch.rate).sum::<f64>() / n as f64;
    let rates = DVector::from_iterator(n, stretches.iter().map(|stretch| stretch.rate - offset));
    let seen = DMatrix::from_fn(n, 2, |i, k| constant_and_warming(k, temperature(&stretches[i].range)));
    let instants = DMatrix::from_fn(target.times.len(), 2, |i, k| {
        target.weights[i] * constant_and_warming(k, temperature_c.at(target.times[i]).unwrap_or_default())
    });
    let wanted = integrals(instants, target);
    let changes = changes(stretches, target);
    let noise = DMatrix::from_diagonal(&DVector::from_iterator(n, stretches.iter().map(|stretch| stretch.variance)));
    let tilts = DMatrix::from_fn(n, 2, |i, k| TILT_SHARE * stretches[i].tilt_dps[k]);
    let own = &seen * seen.transpose() + &tilts * tilts.transpose() + noise + changes.own;
    let cross = &wanted * seen.transpose() + changes.cross;
    let prior = &wanted * wanted.transpose() + changes.prior;
    let constant = DVector::from_fn(target.times.len(), |i, _| offset * wanted[(i, 0)] / BIAS_DPS);
    let given = Given { stretches, rates, own, cross, prior, from_s: target.from_s };
    let mut found = match motions {
        Some(motions) => given.weigh_motions(motions),
        None => given.weigh(&Tried::default()).into_iter().collect(),
    };
    let best = best_of(&found);
    found.retain(|(weight, _)| weight - best > LEAST_WEIGHT.ln());
    let total: f64 = found.iter().map(|(weight, _)| (weight - best).exp()).sum();
    let shares = found.iter().map(|(weight, solved)| ((weight - best).exp() / total, solved));
    let mixed = given.mix(shares);
    Some(Rotation { mean: mixed.mean + constant, ..mixed })
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

/// The part of the bias's noise in the covariance of the rates, of the wanted rotation with them, and of the rotation.
struct Changes {
    own: DMatrix<f64>,
    cross: DMatrix<f64>,
    prior: DMatrix<f64>,
}

fn changes(stretches: &[Stretch], target: &Target) -> Changes {
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
    Changes {
        own: DMatrix::from_fn(n, n, |i, j| between(&stretches[i].range, &stretches[j].range)),
        cross: integrals(cross, target),
        prior: integrals(integrals(instants, target).transpose(), target),
    }
}

/// A combination of time constant and sizes of the motions.
#[derive(Clone, Default)]
struct Tried {
    /// Logarithm of its prior weight.
    log_prior: f64,
    /// Rate of the first return to rest over each stretch, scaled to unit variance.
    before: Vec<f64>,
    time_constant_s: f64,
    before_dps: f64,
    run_s: f64,
    after: Vec<f64>,
    /// Rate of the faster motion after the run.
    fast: Vec<f64>,
}

/// Returns the combinations of sizes for one time constant.
fn motions_tried(stretches: &[Stretch], motions: &Motions, tau: f64) -> Vec<Tried> {
    let is_after = |stretch: &Stretch| stretch.range.start >= motions.run_s;
    let sizes = |after: bool| {
        let is_seen = stretches.iter().any(|stretch| is_after(stretch) == after);
        let all = if after { &AFTER_DPS[..] } else { &BEFORE_DPS };
        if is_seen { all } else { &all[..1] }
    };
    let rate = |dps: f64, tau: f64, zero_s: f64, after: bool| {
        let mean = |stretch: &Stretch| {
            let Range { start, end } = stretch.range;
            let part = |t: f64| (-(t - zero_s) / tau).exp();
            if is_after(stretch) == after { dps * tau * (part(start) - part(end)) / (end - start) } else { 0.0 }
        };
        stretches.iter().map(mean).collect::<Vec<_>>()
    };
    let weight =
        |dps: f64, still: f64, sizes: usize| if dps == 0.0 { still } else { (1.0 - still) / (sizes - 1) as f64 };
    let fast = [(FAST_DPS, HAS_FAST), (0.0, 1.0 - HAS_FAST)]
        .map(|(dps, weight)| (rate(dps, FAST_S, motions.stop_s, true), weight));
    let fast = &fast[..sizes(true).len().min(2)];
    let pairs = sizes(false).iter().flat_map(|before| sizes(true).iter().map(move |after| (*before, *after)));
    pairs
        .flat_map(|pair| fast.iter().map(move |fast| (pair, fast)))
        .map(|((before_dps, after_dps), (fast, has_fast))| Tried {
            log_prior: (weight(before_dps, STILL_BEFORE, BEFORE_DPS.len())
                * weight(after_dps, STILL_AFTER, AFTER_DPS.len())
                * has_fast)
                .ln(),
            before: rate(before_dps, tau, motions.run_s, false),
            after: rate(after_dps, tau, motions.after_s, true),
            fast: fast.clone(),
            time_constant_s: tau,
            before_dps,
            run_s: motions.run_s,
        })
        .collect()
}

/// Weighted combinations.
type Weighed = Vec<(f64, Solved)>;

fn best_of(weighed: &Weighed) -> f64 {
    weighed.iter().map(|(weight, _)| *weight).fold(f64::NEG_INFINITY, f64::max)
}

/// What all combinations share.
struct Given<'a> {
    stretches: &'a [Stretch],
    rates: DVector<f64>,
    /// Covariance of the rates.
    own: DMatrix<f64>,
    /// Covariance of the wanted rotation with the rates.
    cross: DMatrix<f64>,
    /// Covariance of the wanted rotation.
    prior: DMatrix<f64>,
    from_s: f64,
}

/// One combination, with the covariance of the rates factored.
struct Solved {
    factored: Cholesky<f64, nalgebra::Dyn>,
    /// Solution of the factored equations for the rates.
    solved: DVector<f64>,
    /// Rate of the first return to rest over each stretch, scaled to unit variance.
    before: DVector<f64>,
    /// What the robot turns back after the reference time, degrees, for unit amplitude.
    turns_back_deg: f64,
    residual_dps: [f64; 2],
}

impl Given<'_> {
    /// Returns the weighted combinations of time constants and sizes. Time constants are added until the weights of
    /// neighbours are of one order, where the weights are not negligible.
    fn weigh_motions(&self, motions: &Motions) -> Weighed {
        let weigh = |tau: f64| -> Weighed {
            motions_tried(self.stretches, motions, tau).iter().filter_map(|tried| self.weigh(tried)).collect()
        };
        let mut all: Vec<(f64, Weighed)> = TIME_CONSTANTS_S.iter().map(|tau| (*tau, weigh(*tau))).collect();
        loop {
            let weights: Vec<f64> = all.iter().map(|(_, weighed)| best_of(weighed)).collect();
            let least = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max) + LEAST_WEIGHT.ln();
            let middles: Vec<f64> = (0..all.len() - 1)
                .filter(|i| weights[*i].max(weights[i + 1]) > least && (weights[*i] - weights[i + 1]).abs() > 1.0)
                .map(|i| (all[i].0 * all[i + 1].0).sqrt())
                .collect();
            if middles.is_empty() || all.len() + middles.len() > MOST_TIME_CONSTANTS {
                break;
            }
            all.extend(middles.into_iter().map(|tau| (tau, weigh(tau))));
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let taus: Vec<f64> = all.iter().map(|(tau, _)| tau.ln()).collect();
        let width = |i: usize| 0.5 * (taus[(i + 1).min(taus.len() - 1)] - taus[i.saturating_sub(1)]);
        let widened = |(i, (_, weighed)): (usize, (f64, Weighed))| {
            let more = (width(i) * motions.density(taus[i].exp())).ln();
            weighed.into_iter().map(move |(weight, solved)| (weight + more, solved))
        };
        all.into_iter().enumerate().flat_map(widened).collect()
    }

    /// Returns the logarithm of the weight of a combination, not normalised.
    fn weigh(&self, tried: &Tried) -> Option<(f64, Solved)> {
        let mut own = self.own.clone();
        let column = |values: &Vec<f64>| {
            let mut column = DVector::zeros(self.stretches.len());
            column.iter_mut().zip(values).for_each(|(entry, value)| *entry = *value);
            column
        };
        let [before, after, fast] = [&tried.before, &tried.after, &tried.fast].map(column);
        own += &before * before.transpose() + &after * after.transpose() + &fast * fast.transpose();
        let factored = Cholesky::new(own)?;
        let solved = factored.solve(&self.rates);
        let weight = tried.log_prior - 0.5 * (self.rates.dot(&solved) + factored.ln_determinant());
        let dps = tried.before_dps;
        let tau = tried.time_constant_s;
        let turns_back_deg = if dps > 0.0 { dps * tau * (-(self.from_s - tried.run_s) / tau).exp() } else { 0.0 };
        let explained = before.dot(&factored.solve(&before));
        let residual_dps = [dps * before.dot(&solved), dps * (1.0 - explained).max(0.0).sqrt()];
        Some((weight, Solved { factored, solved, before, turns_back_deg, residual_dps }))
    }

    /// Returns mean and covariance of the wanted rotation over all combinations, each with its share.
    ///
    /// A combination changes the covariance of the rotation with the rates, C, by what the robot turns back: the same row
    /// for all times. So all sums are over matrices of the rates alone.
    fn mix<'s>(&self, shares: impl Iterator<Item = (f64, &'s Solved)>) -> Rotation {
        let n = self.rates.len();
        let (mut weights, mut explained) = (DVector::zeros(n), DMatrix::zeros(n, n));
        let (mut turns_back, mut with_rates, mut square) = (0.0, DVector::zeros(n), 0.0);
        let (mut residual, mut residual_square) = (0.0, 0.0);
        for (share, Solved { factored, solved, before, turns_back_deg: back, residual_dps }) in shares {
            let along = before.dot(solved);
            let inverse = factored.solve(before);
            weights.axpy(share, solved, 1.0);
            explained += share * (factored.inverse() - solved * solved.transpose());
            turns_back += share * back * along;
            with_rates += share * *back * (&inverse - along * solved);
            square += share * back * back * (1.0 - before.dot(&inverse) + along * along);
            residual += share * residual_dps[0];
            residual_square += share * (residual_dps[0].powi(2) + residual_dps[1].powi(2));
        }
        let mean = (&self.cross * weights).add_scalar(turns_back);
        let along = &self.cross * with_rates;
        let mut covariance = &self.prior - &self.cross * explained * self.cross.transpose() - &mean * mean.transpose();
        for i in 0..mean.len() {
            for j in 0..mean.len() {
                covariance[(i, j)] += square - along[i] - along[j];
            }
        }
        let residual_dps = [residual, (residual_square - residual * residual).max(0.0).sqrt()];
        Rotation { mean, covariance, residual_dps }
    }
}
