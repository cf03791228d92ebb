//! Propagates errors of the measurement and of the model to the fitted parameters.

use super::data::FitTrial;
use super::errors::Correlated;
use super::problem::{Given, Problem};
use super::{Blocks, Parameter, TwinError, failed};
use crate::statistics::{effective_freedom, student_95};
use nalgebra::{DMatrix, DVector};
use sim::accuracy::ModelError;
use sim::functions::{hypot, powi};

/// Next least-squares step, in standard errors, above which the fit has not reached the minimum.
const LEFT_TO_GO: f64 = 1.0;

/// The uncertainty of the fitted parameters, in the fit's variables.
pub(super) struct Spread {
    /// Covariance of all errors except the model's.
    pub covariance: DMatrix<f64>,
    /// The part due to the scatter of the residuals.
    pub scatter: DMatrix<f64>,
    /// Degrees of freedom of the scatter.
    pub degrees_of_freedom: f64,
    /// Quantile of each parameter, with its effective degrees of freedom.
    pub quantiles: Vec<f64>,
    /// Possible change of each parameter due to the model's error; `None` for simulated robots.
    pub model_errors: Option<Vec<f64>>,
    /// The step that least squares would take next.
    next_step: Vec<f64>,
}

impl Spread {
    /// # Errors
    /// [`TwinError::Fit`] if the trials do not determine all parameters.
    pub fn of(problem: &Problem, errors: &[Blocks], model_error: &ModelError) -> Result<Self, TwinError> {
        let Given { trials, parameters, weights, .. } = problem.given;
        let gains = gains(problem)?;
        let change = |errors: &[Blocks]| gains.iter().map(|gain| dot(gain, errors)).collect::<Vec<f64>>();
        // Residuals that the sensor explains are not scatter.
        let scatter = Correlated::of_angles(&weights.without_sensors(errors));
        let [by_scatter, stated] = covariances(problem, &gains, &scatter);
        // The fitted parameters absorb part of the residuals.
        let blocks: usize = trials.iter().map(FitTrial::blocks).sum();
        let independent: f64 = scatter.iter().map(|scatter| scatter.independent(blocks)).sum();
        let degrees_of_freedom = (independent - parameters.len() as f64).max(1.0);
        let scatter = by_scatter * (independent / degrees_of_freedom).max(1.0);
        let mut covariance = stated + &scatter;
        for (i, parameter) in parameters.iter().enumerate() {
            covariance[(i, i)] += powi(parameter.solver_error(), 2);
        }
        // Welch and Satterthwaite (GUM, G.2b): all other causes are of type B.
        let effective =
            |i: usize| effective_freedom(covariance[(i, i)], std::iter::once((scatter[(i, i)], degrees_of_freedom)));
        Ok(Self {
            quantiles: (0..parameters.len()).map(|i| student_95(effective(i))).collect(),
            model_errors: trials.iter().any(|trial| trial.is_real).then(|| model_errors(trials, &change, model_error)),
            next_step: change(errors).iter().map(|change| -change).collect(),
            covariance,
            scatter,
            degrees_of_freedom,
        })
    }

    /// Returns the standard uncertainty of a parameter, without the model's error.
    pub fn deviation(&self, i: usize) -> f64 {
        self.covariance[(i, i)].max(0.0).sqrt()
    }

    /// Returns the names of the parameters that have not reached the minimum.
    pub fn short_of_minimum(&self, parameters: &[Parameter]) -> Vec<&'static str> {
        let is_short = |i: &usize| self.next_step[*i].abs() > LEFT_TO_GO * self.deviation(*i);
        (0..parameters.len()).filter(is_short).map(|i| parameters[i].name()).collect()
    }
}

/// Returns the fit's linear response to errors of its data: for each parameter, its change per error of each block,
/// 1/degree.
fn gains(problem: &Problem) -> Result<Vec<Vec<Blocks>>, TwinError> {
    let blind = || failed("the trials do not determine all parameters", "fit fewer parameters with --fit");
    let slopes = problem.slopes().ok_or_else(blind)?;
    let weighted: Vec<Vec<Blocks>> = slopes.iter().map(|slopes| problem.given.weights.solve(slopes)).collect();
    let count = slopes.len();
    let product = DMatrix::from_fn(count, count, |i, j| dot(&slopes[i], &weighted[j]));
    let scale: Vec<f64> = (0..count).map(|i| product[(i, i)].sqrt()).collect();
    if scale.iter().any(|scale| *scale == 0.0 || !scale.is_finite()) {
        return Err(blind());
    }
    let scaled = DMatrix::from_fn(count, count, |i, j| product[(i, j)] / (scale[i] * scale[j]));
    let inverse = scaled.cholesky().ok_or_else(blind)?.inverse();
    let gain = |i: usize| {
        let mut gain: Vec<Blocks> =
            weighted[0].iter().map(|blocks| blocks.each_ref().map(|b| DVector::zeros(b.len()))).collect();
        for (j, weighted) in weighted.iter().enumerate() {
            let share = inverse[(i, j)] / (scale[i] * scale[j]);
            for (sum, value) in gain.iter_mut().flatten().zip(weighted.iter().flatten()) {
                *sum += share * value;
            }
        }
        gain
    };
    Ok((0..count).map(gain).collect())
}

/// Returns the covariance of the parameters in the fit's variables due to the scatter of the residuals, and due to the stated
/// errors of the sensor, the clocks and the solver. Both hold for any weights of the fit.
fn covariances(problem: &Problem, gains: &[Vec<Blocks>], scatter: &[Correlated; 3]) -> [DMatrix<f64>; 2] {
    let Given { trials, weights, .. } = problem.given;
    let of_sensors: Vec<Vec<DVector<f64>>> = gains.iter().map(|gain| weights.of_sensors(gain)).collect();
    let by = |of: &dyn Fn(usize, usize) -> f64| {
        let mut matrix = DMatrix::zeros(gains.len(), gains.len());
        for i in 0..gains.len() {
            for j in 0..=i {
                matrix[(i, j)] = of(i, j);
                matrix[(j, i)] = matrix[(i, j)];
            }
        }
        matrix
    };
    let pairs = |i: usize, j: usize| {
        let gains = gains[i].iter().zip(&gains[j]);
        gains.enumerate().flat_map(|(t, (one, other))| (0..3).map(move |k| (t, k, &one[k], &other[k])))
    };
    [
        by(&|i, j| pairs(i, j).map(|(_, k, one, other)| scatter[k].covariance(one.as_slice(), other.as_slice())).sum()),
        by(&|i, j| {
            let own = |(t, k, one, other): (usize, usize, _, _)| DVector::dot(one, &(&trials[t].errors.own[k] * other));
            let of_trials: f64 = pairs(i, j).map(own).sum();
            let of_sensors: f64 = of_sensors[i].iter().zip(&of_sensors[j]).map(|(one, other)| one.dot(other)).sum();
            of_trials + of_sensors
        }),
    ]
}

/// Returns the possible change of each parameter due to the model's own errors, in the fit's variables.
///
/// They are the same in all trials, because the model neglects the same effects: an error of the yaw in proportion
/// to the yaw, and of the tilt in proportion to the tilt, added in quadrature. The shares refer to the measured
/// angles, which the fitted model reproduces. For a model that is not fitted, `compare` states a larger share of
/// the modelled angles ([`ModelError::of_modelled_deg`]).
fn model_errors(trials: &[FitTrial], change: &dyn Fn(&[Blocks]) -> Vec<f64>, error: &ModelError) -> Vec<f64> {
    let share = |shares: [f64; 3]| {
        let of_trial = |trial: &FitTrial| [0, 1, 2].map(|k| shares[k] * &trial.measured[k]);
        change(&trials.iter().map(of_trial).collect::<Vec<_>>())
    };
    let yaw = share([error.yaw(), 0.0, 0.0]);
    let tilt = share([0.0, error.tilt(), error.tilt()]);
    yaw.iter().zip(&tilt).map(|(yaw, tilt)| hypot(*yaw, *tilt)).collect()
}

fn dot(one: &[Blocks], other: &[Blocks]) -> f64 {
    one.iter().flatten().flatten().zip(other.iter().flatten().flatten()).map(|(a, b)| a * b).sum()
}
