//! Propagates errors of the measurement and of the model to the fitted parameters.

use super::errors::{Correlated, TrialErrors};
use super::problem::Problem;
use super::{Blocks, TwinError, failed};
use nalgebra::{DMatrix, DVector};
use sim::accuracy::ModelError;
use sim::functions::hypot;

/// The fit's linear response to errors of its data.
pub(super) struct Response<'a, 'b> {
    problem: &'a Problem<'b>,
    /// For each parameter, its change per error of each block, 1/degree.
    gains: Vec<Vec<Blocks>>,
}

impl<'a, 'b> Response<'a, 'b> {
    /// # Errors
    /// [`TwinError::Fit`] if the trials do not determine all parameters.
    pub fn new(problem: &'a Problem<'b>) -> Result<Self, TwinError> {
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
                weighted[0].iter().map(|blocks| blocks.clone().map(|b| vec![0.0; b.len()])).collect();
            for (j, weighted) in weighted.iter().enumerate() {
                let share = inverse[(i, j)] / (scale[i] * scale[j]);
                for (sum, value) in values_mut(&mut gain).zip(values(weighted)) {
                    *sum += share * value;
                }
            }
            gain
        };
        Ok(Self { problem, gains: (0..count).map(gain).collect() })
    }

    /// Returns the covariance of the parameters in the fit's variables due to the scatter of the residuals, and due to the stated
    /// errors of the sensor, the clocks and the solver. Both hold for any weights of the fit.
    pub fn covariances(&self, scatter: &[Correlated; 3]) -> [DMatrix<f64>; 2] {
        let trials = self.problem.given.trials;
        let of_sensors: Vec<Vec<DVector<f64>>> =
            self.gains.iter().map(|gain| self.problem.given.weights.of_sensors(gain)).collect();
        let by = |of: &dyn Fn(usize, usize) -> f64| {
            let mut matrix = DMatrix::zeros(self.gains.len(), self.gains.len());
            for i in 0..self.gains.len() {
                for j in 0..=i {
                    matrix[(i, j)] = of(i, j);
                    matrix[(j, i)] = matrix[(i, j)];
                }
            }
            matrix
        };
        let pairs = |i: usize, j: usize| {
            let gains = self.gains[i].iter().zip(&self.gains[j]);
            gains.enumerate().flat_map(|(t, (one, other))| (0..3).map(move |k| (t, k, &one[k], &other[k])))
        };
        let own = |errors: &TrialErrors, k: usize, one: &[f64], other: &[f64]| {
            DVector::from_column_slice(one).dot(&(&errors.own[k] * DVector::from_column_slice(other)))
        };
        [
            by(&|i, j| pairs(i, j).map(|(_, k, one, other)| scatter[k].covariance(one, other)).sum()),
            by(&|i, j| {
                let of_trials: f64 = pairs(i, j).map(|(t, k, one, other)| own(&trials[t].errors, k, one, other)).sum();
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
    pub fn model_errors(&self, error: &ModelError) -> Vec<f64> {
        let share = |shares: [f64; 3]| {
            let of_trial =
                |measured: &Blocks| [0, 1, 2].map(|k| measured[k].iter().map(|deg| shares[k] * deg).collect());
            self.change(&self.problem.given.trials.iter().map(|trial| of_trial(&trial.measured)).collect::<Vec<_>>())
        };
        let yaw = share([error.yaw(), 0.0, 0.0]);
        let tilt = share([0.0, error.tilt(), error.tilt()]);
        yaw.iter().zip(&tilt).map(|(yaw, tilt)| hypot(*yaw, *tilt)).collect()
    }

    /// Returns the change of each parameter due to errors of the data.
    pub fn change(&self, errors: &[Blocks]) -> Vec<f64> {
        self.gains.iter().map(|gain| dot(gain, errors)).collect()
    }
}

fn values(blocks: &[Blocks]) -> impl Iterator<Item = &f64> {
    blocks.iter().flatten().flatten()
}

fn values_mut(blocks: &mut [Blocks]) -> impl Iterator<Item = &mut f64> {
    blocks.iter_mut().flatten().flatten()
}

fn dot(one: &[Blocks], other: &[Blocks]) -> f64 {
    values(one).zip(values(other)).map(|(a, b)| a * b).sum()
}
