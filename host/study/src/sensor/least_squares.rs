//! Least squares with few unknowns, and their uncertainty from few repeats.

use crate::statistics::student_95;
use nalgebra::{DMatrix, DVector};

/// Coefficients that fit observations, with their scatter.
#[derive(Clone, PartialEq, Debug)]
pub struct Fit {
    /// The coefficients.
    pub values: Vec<f64>,
    /// Standard deviation of each coefficient for observations with a standard deviation of one.
    pub factors: Vec<f64>,
    /// Sum of the squared residuals.
    pub squares: f64,
    /// Degrees of freedom: observations minus coefficients.
    pub freedom: usize,
}

impl Fit {
    /// Fits observations by rows of regressors. Returns `None` if the regressors do not determine the coefficients.
    pub fn new<const N: usize>(rows: &[[f64; N]], observed: &[f64]) -> Option<Self> {
        let matrix = DMatrix::from_fn(rows.len(), N, |row, column| rows[row][column]);
        let observed = DVector::from_column_slice(observed);
        let inverse = (matrix.transpose() * &matrix).try_inverse()?;
        let values = &inverse * (matrix.transpose() * &observed);
        let squares = (observed - matrix * &values).norm_squared();
        Some(Self {
            values: values.iter().copied().collect(),
            factors: inverse.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect(),
            squares,
            freedom: rows.len().checked_sub(N)?,
        })
    }

    /// Returns the standard deviation of an observation; `None` without a degree of freedom.
    pub fn scatter(&self) -> Option<f64> {
        (self.freedom > 0).then(|| (self.squares / self.freedom as f64).sqrt())
    }
}

/// Returns the standard uncertainty for which ±1.96 u contain 95 % of Student's distribution with this scale and these
/// degrees of freedom. Thus uncertainties from few repeats can be added in quadrature to others.
pub fn expanded(scale: f64, freedom: usize) -> f64 {
    scale * student_95(freedom as f64) / student_95(1e9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_with_its_scatter() {
        let rows: Vec<_> = (0..5).map(|x| [1.0, f64::from(x)]).collect();
        let fit = Fit::new(&rows, &[1.1, 2.9, 5.1, 6.9, 9.0]).unwrap();
        assert!((fit.values[0] - 1.04).abs() < 1e-9 && (fit.values[1] - 1.98).abs() < 1e-9, "{fit:?}");
        assert!((fit.factors[1] - 0.1f64.sqrt()).abs() < 1e-9 && fit.freedom == 3);
        assert!((fit.scatter().unwrap() - (0.036f64 / 3.0).sqrt()).abs() < 1e-9, "{fit:?}");
        assert_eq!(Fit::new(&[[1.0, 1.0], [1.0, 1.0]], &[1.0, 2.0]), None);
    }

    #[test]
    fn few_repeats_give_a_wider_uncertainty() {
        assert!((expanded(1.0, 4) - 2.776 / 1.96).abs() < 0.01);
        assert!((expanded(1.0, 1) - 12.71 / 1.96).abs() < 0.05);
        assert!((expanded(0.5, 100_000) - 0.5).abs() < 1e-3);
    }
}
