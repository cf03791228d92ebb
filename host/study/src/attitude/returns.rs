//! Returns to rest in the rates about an axis, and their contribution to the rotation.
//!
//! Over each stretch the rate has, besides the parts that [`super::smoother`] lists, three parts of unknown size a: the
//! robot's returns to rest before and after the run, A exp(-t/τ) each, and a faster motion after the run. For given
//! time constants and standard deviations D of the sizes, the whitened rates e, with columns B of the parts, give
//!
//! ```text
//! P = D (I + D BᵀB D)⁻¹ D           covariance of a
//! q = P Bᵀe                         mean of a
//! ln w = ½ (eᵀB q - ln |I + D BᵀB D|)   evidence
//! ```
//!
//! (Gaussian process regression: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 2.25, 2.26 and
//! 2.30.) The rotation is linear in a. The time constants and D are not known: every combination in a list is weighted
//! by its evidence times its prior, and the robot's parameters contribute a prior for τ. Mean and covariance are those
//! of the mixture. So a return to rest that hides in the noise adds to the uncertainty, and each second of rest reduces
//! it.

use super::rest::Stretch;
use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector, Dyn, Matrix3, MatrixXx3, Vector3};
use sim::functions::{exp, ln};
use std::f64::consts::TAU;
use std::ops::Range;

/// Initial time constants of a return to rest, s. More are added between neighbours with different weights.
const TIME_CONSTANTS_S: [f64; 7] = [1.5, 2.7, 5.0, 9.0, 16.0, 28.0, 50.0];
const MOST_TIME_CONSTANTS: usize = 250;

/// Largest difference between the log weights of neighbouring time constants.
const LARGEST_DIFFERENCE: f64 = 1.0;

/// Standard deviation of the logarithm of a robot's time constant about the value from its parameters, which are not
/// fitted yet, and the probability that the parameters belong to another robot.
const ROBOT_WITHIN: f64 = 0.5;
const OTHER_ROBOT: f64 = 0.2;

/// Candidate standard deviations of the rate of a return to rest, °/s: at the start of the run, before which the recorder has
/// waited, and after the run.
const BEFORE_DPS: [f64; 4] = [0.0, 0.01, 0.1, 1.0];
const AFTER_DPS: [f64; 5] = [0.0, 0.01, 0.1, 1.0, 10.0];

/// The faster motion after a run: candidate time constants, s, and the standard deviation of its rate when the motors stop, °/s.
/// Soft flagella spring back before they follow the tether: in the model, a run at 90 and 90 rpm ends with 64 °/s, which falls by
/// three quarters every two seconds, until the slow return of 6.3 s remains. A fit of one exponential mistakes the rest of this
/// motion for a bias.
pub(super) const FAST_S: [f64; 4] = [1.0, 1.25, 1.6, 2.0];
const FAST_DPS: f64 = 60.0;

/// Prior weight of no motion, before and after the run. Before the run, the recorder has waited until the robot was
/// still.
const STILL_BEFORE: f64 = 0.99;
const STILL_AFTER: f64 = 0.5;

/// Prior weight of a faster motion after the run: flagella are soft.
const HAS_FAST: f64 = 0.95;

/// Combinations with a smaller weight, relative to the best one, are left out.
const LEAST_WEIGHT: f64 = 1e-3;

/// Times at which the robot may still have been moving.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Motions {
    /// Start of the run: the end of the first return to rest, s.
    pub run_s: f64,
    /// End of the run, s.
    pub stop_s: f64,
    /// Start of the rest after the run, s.
    pub after_s: f64,
    /// Time constant of both returns from the robot's parameters, s; `None` if it is not known.
    pub time_constant_s: Option<f64>,
}

impl Motions {
    /// Returns the prior density of the logarithm of a time constant, not normalised: uniform, or mostly near the
    /// robot's value.
    fn density(&self, tau: f64) -> f64 {
        let even = 1.0 / ln(TIME_CONSTANTS_S[TIME_CONSTANTS_S.len() - 1] / TIME_CONSTANTS_S[0]);
        let near = |robot_s: f64| {
            let off = ln(tau / robot_s) / ROBOT_WITHIN;
            exp(-0.5 * off * off) / (ROBOT_WITHIN * TAU.sqrt())
        };
        self.time_constant_s.map_or(even, |robot_s| OTHER_ROBOT * even + (1.0 - OTHER_ROBOT) * near(robot_s))
    }
}

/// The estimate of the rotation from the rates if nothing moves.
pub(super) struct Still<'a> {
    pub stretches: &'a [Stretch],
    /// Covariance of the rates, factored.
    pub factored: Cholesky<f64, Dyn>,
    /// The rates, whitened.
    pub rates: DVector<f64>,
    /// Covariance of the rotation at each time of its grid with the whitened rates.
    pub cross: DMatrix<f64>,
    /// The rotation is zero at this time, s.
    pub from_s: f64,
}

/// The rotation due to the bias or to returns to rest, and its covariance, at each time of a grid. Zero at the reference time.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Rotation {
    /// Mean, degrees.
    pub mean: DVector<f64>,
    /// Covariance, degrees².
    pub covariance: DMatrix<f64>,
    /// Mean rate of the first return to rest at the start of the run and its standard deviation, °/s.
    pub residual_dps: [f64; 2],
}

/// Combinations that share their time constants.
struct Family {
    time_constant_s: f64,
    /// Whitened rates over the stretches for unit rates, 1 °/s: of the return before the run, at the start of the run;
    /// of the return after it, at the start of the rest; and of the faster motion, when the motors stop.
    columns: MatrixXx3<f64>,
    combinations: Vec<Combination>,
}

struct Combination {
    log_weight: f64,
    /// Mean of the three rates, °/s, and their covariance.
    mean: Vector3<f64>,
    covariance: Matrix3<f64>,
}

/// Returns the mixture over all combinations.
pub(super) fn mixed(still: &Still, motions: &Motions) -> Rotation {
    let families = still.families(motions);
    let best = families.iter().map(Family::best).fold(f64::NEG_INFINITY, f64::max);
    let weight = |combination: &Combination| {
        let weight = exp(combination.log_weight - best);
        if weight > LEAST_WEIGHT { weight } else { 0.0 }
    };
    let all = || families.iter().flat_map(|family| &family.combinations);
    let total: f64 = all().map(weight).sum();
    let rows = still.cross.nrows();
    let (mut mean, mut square) = (DVector::zeros(rows), DMatrix::zeros(rows, rows));
    let (mut residual, mut residual_square) = (0.0, 0.0);
    for family in &families {
        let (mut of_mean, mut of_square) = (Vector3::zeros(), Matrix3::zeros());
        for combination in &family.combinations {
            let share = weight(combination) / total;
            of_mean += share * combination.mean;
            of_square += share * (combination.covariance + combination.mean * combination.mean.transpose());
        }
        if of_square == Matrix3::zeros() {
            continue;
        }
        residual += of_mean.x;
        residual_square += of_square.m11;
        // The rotation for rates of 1 °/s: rates that the motions explain are not bias, and the robot still turns back.
        let mut turned = -(&still.cross * &family.columns);
        let tau = family.time_constant_s;
        turned.column_mut(0).add_scalar_mut(tau * exp(-(still.from_s - motions.run_s) / tau));
        mean += &turned * of_mean;
        square += &turned * of_square * turned.transpose();
    }
    let covariance = square - &mean * mean.transpose();
    let residual_dps = [residual, (residual_square - residual * residual).max(0.0).sqrt()];
    Rotation { mean, covariance, residual_dps }
}

impl Family {
    fn best(&self) -> f64 {
        self.combinations.iter().map(|combination| combination.log_weight).fold(f64::NEG_INFINITY, f64::max)
    }
}

impl Still<'_> {
    /// Returns all combinations of time constants and sizes, with their weights. Time constants are added where the
    /// weights are not negligible, until each interval and its neighbours have similar weights at both ends. Neighbours
    /// count, because the best time constant may lie between two of equal weight.
    fn families(&self, motions: &Motions) -> Vec<Family> {
        let tried = |tau: f64| -> (f64, Vec<Family>) {
            (tau, FAST_S.iter().map(|fast_s| self.family(motions, tau, *fast_s)).collect())
        };
        let mut all: Vec<(f64, Vec<Family>)> = TIME_CONSTANTS_S.map(tried).into();
        loop {
            let weights: Vec<f64> =
                all.iter().map(|(_, of)| of.iter().map(Family::best).fold(f64::NEG_INFINITY, f64::max)).collect();
            let least = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max) + ln(LEAST_WEIGHT);
            let differ = |i: usize| (weights[i] - weights[i + 1]).abs() > LARGEST_DIFFERENCE;
            let is_coarse = |i: &usize| {
                let beside = i.saturating_sub(1)..=(i + 1).min(weights.len() - 2);
                weights[*i].max(weights[i + 1]) > least && beside.into_iter().any(differ)
            };
            let middles: Vec<f64> =
                (0..all.len() - 1).filter(is_coarse).map(|i| (all[i].0 * all[i + 1].0).sqrt()).collect();
            if middles.is_empty() || all.len() + middles.len() > MOST_TIME_CONSTANTS {
                break;
            }
            all.extend(middles.into_iter().map(tried));
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let taus: Vec<f64> = all.iter().map(|(tau, _)| ln(*tau)).collect();
        let width = |i: usize| 0.5 * (taus[(i + 1).min(taus.len() - 1)] - taus[i.saturating_sub(1)]);
        for (i, (tau, families)) in all.iter_mut().enumerate() {
            let more = ln(width(i) * motions.density(*tau));
            families.iter_mut().flat_map(|family| &mut family.combinations).for_each(|one| one.log_weight += more);
        }
        all.into_iter().flat_map(|(_, families)| families).collect()
    }

    /// Returns the combinations of sizes for one time constant of both returns and one of the faster motion.
    fn family(&self, motions: &Motions, tau: f64, fast_s: f64) -> Family {
        let is_after = |stretch: &Stretch| stretch.range.start >= motions.run_s;
        let rates = |tau: f64, zero_s: f64, after: bool| {
            let mean = |stretch: &Stretch| {
                let Range { start, end } = stretch.range;
                let part = |t: f64| exp(-(t - zero_s) / tau);
                if is_after(stretch) == after { tau * (part(start) - part(end)) / (end - start) } else { 0.0 }
            };
            DVector::from_iterator(self.stretches.len(), self.stretches.iter().map(mean))
        };
        let parts = [(tau, motions.run_s, false), (tau, motions.after_s, true), (fast_s, motions.stop_s, true)];
        let mut columns = MatrixXx3::from_columns(&parts.map(|(tau, zero_s, after)| rates(tau, zero_s, after)));
        self.factored.l_dirty().solve_lower_triangular_mut(&mut columns);
        let gram: Matrix3<f64> = columns.tr_mul(&columns);
        let along: Vector3<f64> = columns.tr_mul(&self.rates);
        let sizes = |after: bool, all: &'static [f64], still: f64| {
            let is_seen = self.stretches.iter().any(|stretch| is_after(stretch) == after);
            let moving = (1.0 - still) / (all.len() - 1) as f64;
            let weighed = move |dps: &f64| (*dps, if *dps == 0.0 { still } else { moving });
            if is_seen { all } else { &all[..1] }.iter().map(weighed)
        };
        let combination = |parts: [(f64, f64); 3]| {
            let [sizes, priors] = [parts.map(|(dps, _)| dps), parts.map(|(_, prior)| prior)];
            let sizes = Matrix3::from_diagonal(&Vector3::from(sizes));
            let factored = Cholesky::new(Matrix3::identity() + sizes * gram * sizes)?;
            // Solves with the factors: a product with the inverse would lose the small differences between large
            // evidences.
            let mean = sizes * factored.solve(&(sizes * along));
            let ln_determinant = factored.l_dirty().diagonal().iter().map(|pivot| 2.0 * ln(*pivot)).sum::<f64>();
            let evidence = 0.5 * (along.dot(&mean) - ln_determinant);
            let log_weight = evidence + ln(priors.iter().product::<f64>());
            Some(Combination { log_weight, mean, covariance: sizes * factored.inverse() * sizes })
        };
        let mut combinations = Vec::new();
        for before in sizes(false, &BEFORE_DPS, STILL_BEFORE) {
            for after in sizes(true, &AFTER_DPS, STILL_AFTER) {
                for fast in sizes(true, &[0.0, FAST_DPS], 1.0 - HAS_FAST) {
                    combinations.extend(combination([before, after, fast]));
                }
            }
        }
        Family { time_constant_s: tau, columns, combinations }
    }
}
