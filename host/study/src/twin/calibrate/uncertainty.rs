//! How errors of the measurement and of the model change the fitted parameters.

use super::data::Whitener;
use super::problem::Problem;
use super::{TwinError, failed};
use levenberg_marquardt::LeastSquaresProblem;
use nalgebra::{DMatrix, DVector};
use sim::accuracy::ModelError;

/// The fit's linear response to errors of its data.
pub(super) struct Response<'a, 'b> {
    problem: &'a Problem<'b>,
    /// Weighted derivatives, each column scaled to length one.
    derivatives: DMatrix<f64>,
    scale: Vec<f64>,
    /// Inverse of the product of the derivatives.
    inverse: DMatrix<f64>,
}

impl<'a, 'b> Response<'a, 'b> {
    /// # Errors
    /// [`TwinError::Fit`] if the trials do not determine all parameters.
    pub fn new(problem: &'a Problem<'b>) -> Result<Self, TwinError> {
        let blind = || failed("the trials do not determine all parameters", "fit fewer parameters with --fit");
        let jacobian = problem.jacobian().ok_or_else(blind)?;
        let jacobian = DMatrix::from_column_slice(jacobian.nrows(), jacobian.ncols(), jacobian.as_slice());
        let scale: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
        if scale.iter().any(|norm| *norm == 0.0 || !norm.is_finite()) {
            return Err(blind());
        }
        let derivatives = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, j| jacobian[(i, j)] / scale[j]);
        let inverse = (derivatives.transpose() * &derivatives).cholesky().ok_or_else(blind)?.inverse();
        Ok(Self { problem, derivatives, scale, inverse })
    }

    /// Returns the covariance of the fitted parameters for errors with the covariance `noise`, for any weights of the fit.
    pub fn covariance(&self, noise: &[[Whitener; 3]]) -> DMatrix<f64> {
        // Effect of each error on each parameter, scaled by the covariance of the errors.
        let mut spread = self.derivatives.clone();
        let mut first = 0;
        for (weights, noise) in self.problem.whiteners.iter().flatten().zip(noise.iter().flatten()) {
            let count = weights.count();
            for j in 0..spread.ncols() {
                let mut part = spread.view((first, j), (count, 1)).column(0).into_owned();
                weights.whiten_transposed(&mut part);
                spread.view_mut((first, j), (count, 1)).copy_from(&noise.spread(&part));
            }
            first += count;
        }
        let covariance = &self.inverse * (spread.transpose() * spread) * &self.inverse;
        let scale = &self.scale;
        DMatrix::from_fn(scale.len(), scale.len(), |i, j| covariance[(i, j)] / (scale[i] * scale[j]))
    }

    /// Returns by how much the model's own errors may have changed each parameter, in the fit's variables.
    ///
    /// They are the same in all trials, because the same effects are left out: the response to an error of the yaw in
    /// proportion to the yaw, and to one of the tilt in proportion to the tilt, added up as squares.
    pub fn model_errors(&self, error: &ModelError) -> Vec<f64> {
        let yaw = self.shift([error.yaw(), 0.0, 0.0]);
        let tilt = self.shift([0.0, error.tilt(), error.tilt()]);
        yaw.iter().zip(&tilt).map(|(yaw, tilt)| yaw.hypot(*tilt)).collect()
    }

    /// Returns the change of the parameters by errors of yaw, pitch and roll in proportion to the measured angles.
    fn shift(&self, shares: [f64; 3]) -> DVector<f64> {
        let angles = self.problem.trials.iter().flat_map(|trial| trial.measured.iter().zip(shares));
        let errors = angles.zip(self.problem.whiteners.iter().flatten()).flat_map(|((angle, share), weights)| {
            weights.whiten(&angle.iter().map(|deg| share * deg).collect::<Vec<_>>())
        });
        let errors = DVector::from_iterator(self.derivatives.nrows(), errors);
        let scaled = &self.inverse * (self.derivatives.transpose() * errors);
        DVector::from_iterator(self.scale.len(), scaled.iter().zip(&self.scale).map(|(value, scale)| value / scale))
    }
}
