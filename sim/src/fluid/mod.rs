//! Stokes flow about the centre lines: regularised Stokeslet segments.
//!
//! SI units, in any set of axes: the flow of an unbounded fluid does not depend on their directions. The force density
//! f (N/m, on the fluid) is linear on each segment between its nodes, u = M f. Equations: Cortez 2018 (*Regularized
//! Stokeslet segments*).
//!
//! [`segment`] has the exact integrals, [`mobility`] the dense matrix, and [`near`] with [`far`] the
//! fast product: exact segments within a few edges on the same rod, Gauss points for all others. [`head`] is a rigid
//! body in the same flow. [`walls`] has the images of forces in the walls of a tank; [`tank`] computes their flow about
//! the robot between few points ([`coarse`]).

pub mod coarse;
pub mod far;
pub mod head;
pub mod mobility;
pub mod near;
pub mod reflections;
pub mod segment;
pub mod tank;
pub mod walls;

use crate::V3;
use std::f64::consts::PI;

/// Returns 1/(8 pi mu) in 1/(Pa s), the factor of every Stokeslet.
pub fn stokeslet_factor(viscosity: f64) -> f64 {
    1.0 / (8.0 * PI * viscosity)
}

/// Nodes and force densities of a flagellum in the body frame.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// Nodes, m.
    pub nodes: Vec<V3>,
    /// Force density on the fluid at the nodes, N/m.
    pub density: Vec<V3>,
}
