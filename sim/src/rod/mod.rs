//! Discrete elastic rods: a centre line of nodes with a material frame on every edge.
//!
//! Units SI. Coordinates are in the shaft frame, which turns with the motor, so the clamped nodes are constant.
//! Energies and kinematics: Bergou et al. 2008 (*Discrete Elastic Rods*), Bergou et al. 2010 (*Discrete Viscous
//! Threads*), Jawed et al. 2018 (*A Primer on the Kinematics of Discrete Elastic Rods*).
//!
//! A rod of `n` nodes has the degrees of freedom `x_0, theta_0, x_1, theta_1, ..., x_{n-1}`. In
//! vectors with four slots a node, slot `4 i + 3` is the angle of edge `i`; the last one is unused.

pub mod band;
pub mod bend;
pub mod frames;
mod gradient;
pub mod helix;
pub mod spin;
mod stencil;
pub mod stretch;
pub mod twist;

use crate::V3;
use band::Band;
use frames::{Frames, ReferenceFrames};
use gradient::AtRest;
use serde::{Deserialize, Serialize};

/// Number of clamped nodes at the start of a rod; with them the first edge's twist is clamped.
pub const CLAMPED: usize = 2;

/// Axial, bending and torsional stiffness of a rod.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stiffness {
    /// EA in N.
    pub stretch_n: f64,
    /// EI in N m2, the same in both directions.
    pub bend_nm2: f64,
    /// GJ in N m2.
    pub twist_nm2: f64,
}

impl Stiffness {
    /// Returns the stiffness of a solid round rod: EA = E pi r^2, EI = E pi r^4/4, GJ = G pi r^4/2 with G = E/(2 (1 +
    /// nu)).
    ///
    /// Radius in m, Young's modulus in Pa.
    pub fn solid_round(radius: f64, young: f64, poisson: f64) -> Self {
        let area = std::f64::consts::PI * radius * radius;
        let shear = young / (2.0 * (1.0 + poisson));
        Self {
            stretch_n: young * area,
            bend_nm2: young * area * radius * radius / 4.0,
            twist_nm2: shear * area * radius * radius / 2.0,
        }
    }
}

/// A rod: its stress-free shape and its stiffness.
#[derive(Clone, Debug, PartialEq)]
pub struct Rod {
    /// Stress-free nodes in m.
    pub shape: Vec<V3>,
    /// Reference frames of the stress-free shape (also its material frames: all angles are zero).
    pub rest_frames: ReferenceFrames,
    /// Edge lengths at rest in m, one an edge.
    pub rest_length: Vec<f64>,
    /// Half the sum of the lengths of the adjacent edges in m, one a node; end nodes have half an edge.
    /// The weight of a nodal force density.
    pub nodal_length: Vec<f64>,
    /// Length of the rod in m whose bending and twist a node carries: from the middle of the edge before it to the
    /// middle of the edge after it, except at the clamp ([`Rod::clamped_at_foot`]).
    pub voronoi_length: Vec<f64>,
    /// Natural curvatures kappa1, kappa2 (dimensionless, integrated over the Voronoi length), one a node.
    pub natural_curvature: Vec<[f64; 2]>,
    /// Natural twist in rad, one a node.
    pub natural_twist: Vec<f64>,
    /// Stiffness.
    pub stiffness: Stiffness,
    at_rest: AtRest,
}

impl Rod {
    /// Returns a rod that is free of stress in the given shape (m). The shape sets its natural curvature and twist, so
    /// every elastic force vanishes there to rounding.
    ///
    /// The shape must have at least three nodes, no two neighbours in the same place, and no edge that folds back onto
    /// its neighbour; [`crate::params`] ensures this for a robot.
    pub fn stress_free(shape: Vec<V3>, stiffness: Stiffness) -> Self {
        let n = shape.len();
        let rest_length: Vec<f64> = shape.windows(2).map(|p| (p[1] - p[0]).norm()).collect();
        let edge = |i: usize| rest_length.get(i).copied().unwrap_or(0.0);
        let nodal_length: Vec<f64> = (0..n).map(|i| 0.5 * (edge(i) + if i > 0 { edge(i - 1) } else { 0.0 })).collect();
        let rest_frames = ReferenceFrames::transported_along(&shape);
        let mut frames = Frames::new(n);
        frames.update(&rest_frames, &shape, &vec![0.0; n - 1]);
        let natural_curvature: Vec<[f64; 2]> =
            (0..n).map(|i| if i == 0 || i + 1 == n { [0.0; 2] } else { frames.curvature(i) }).collect();
        let natural_twist = frames.reference_twist[..n].to_vec();
        Self {
            at_rest: AtRest::new(&rest_length, &nodal_length, &natural_curvature, &natural_twist),
            natural_twist,
            shape,
            rest_frames,
            rest_length,
            voronoi_length: nodal_length.clone(),
            nodal_length,
            natural_curvature,
            stiffness,
        }
    }

    /// Returns the same rod held at its first node instead of the middle of its first edge.
    ///
    /// An edge represents the rod's direction at its middle. The clamped edge alone would thus hold the rod half an
    /// edge below the shaft's foot, without the bending and twist of that half: an error of first order in the edge
    /// length. Here node 1 carries that half as well.
    pub fn clamped_at_foot(mut self) -> Self {
        self.voronoi_length[1] += 0.5 * self.rest_length[0];
        let Self { rest_length, voronoi_length, natural_curvature, natural_twist, .. } = &self;
        self.at_rest = AtRest::new(rest_length, voronoi_length, natural_curvature, natural_twist);
        self
    }

    /// Returns the number of nodes.
    pub fn nodes(&self) -> usize {
        self.shape.len()
    }

    /// Returns the number of edges.
    pub fn edges(&self) -> usize {
        self.rest_length.len()
    }

    /// Returns the elastic energy in J.
    pub fn energy(&self, frames: &Frames, angles: &[f64]) -> f64 {
        stretch::energy(self, frames) + bend::energy(self, frames) + twist::energy(self, frames, angles)
    }

    /// Computes the gradient of the energy, four slots a node, in N and N m, into `out` (length `4 n`).
    pub fn gradient(&self, frames: &mut Frames, angles: &[f64], out: &mut [f64]) {
        gradient::gradient(self, frames, angles, out);
    }

    /// Computes the Hessian of the energy into `out` (size `4 n`).
    ///
    /// It is the symmetric part of the derivative of [`Rod::gradient`]: the antisymmetric rest is
    /// the holonomy of the time-parallel frames, of second order in the motion since the frames were
    /// last accepted.
    pub fn hessian(&self, frames: &Frames, angles: &[f64], out: &mut Band) {
        out.clear();
        stretch::add_hessian(self, frames, out);
        bend::add_hessian(self, frames, out);
        twist::add_hessian(self, frames, angles, out);
    }
}
