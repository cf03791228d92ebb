//! The parameters that distinguish inverses of one shape: the length of a step and the speed of the motor, rounded to a
//! grid.

use super::preconditioner::{Equations, Preconditioner};
use crate::functions::{ln, powi};
use crate::rod::Rod;

/// Ratio of neighbouring grid values of kappa.
const KAPPA_GRID: f64 = 1.25;
/// Distance of neighbouring grid values of the spin, rad.
const SPIN_GRID: f64 = 0.1;

/// The parameters of an inverse besides the shape, rounded to a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    /// Index on the logarithmic grid of kappa.
    kappa: i32,
    /// Index on the grid of the spin.
    spin: i32,
}

impl Key {
    /// Returns the key for `kappa` = a_0/step in 1/s and the motor's speed in rad/s.
    pub fn new(kappa: f64, speed: f64) -> Self {
        let index = (ln(kappa) / ln(KAPPA_GRID)).round() as i32;
        Self { kappa: index, spin: (speed / kappa / SPIN_GRID).round() as i32 }
    }

    /// Returns the inverse of these equations at its grid values; `None` when the matrix is singular.
    pub fn invert(self, equations: &Equations, rod: &Rod) -> Option<Preconditioner> {
        equations.invert(rod, powi(KAPPA_GRID, self.kappa), f64::from(self.spin) * SPIN_GRID)
    }
}
