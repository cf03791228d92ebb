//! The frozen inverse of one rod's own equations, and its response to a moving base.
//!
//! Unknowns of a rod of n nodes: free nodes (3 (n - 2)), free edge angles (n - 2), force densities at
//! the two clamped nodes (6). Rows: velocity of every node (3 n), torque about every free edge
//! (n - 2). With kappa = a_0/step (1/s) and spin s = omega/kappa the velocity rows, divided by a_0, are
//! x + s z x x + (1/kappa) M w^-1 K x - (1/kappa) M f; torque rows are scaled by length/GJ.
//!
//! [`Equations`] has what depends on the shape, M w^-1 K first of all; [`Preconditioner`] is the inverse for one time step,
//! in the form of factors. M is rougher than that of the residual: what it misses is small against what the shape changes
//! while the inverse is frozen. [`super::inverses`] chooses the shape.

use super::factors::Factors;
use super::limits::LEAST_SPIN_DRAG;
use crate::V3;
use crate::fluid::{segment::segment_flow, stokeslet_factor};
use crate::params::Robot;
use crate::rod::{CLAMPED, Rod, band::Band, frames::Frames};
use crate::state::RodState;
use nalgebra::Matrix6;

/// Unknowns of the clamp: its force densities. Their columns come first, next to the rows of the same nodes.
const CLAMP: usize = 3 * CLAMPED;
/// Segments up to this many edges away from a node are integrated exactly.
const NEAR_EDGES: usize = 2;

/// Parameters of the fluid about one rod.
#[derive(Clone, Copy, Debug)]
pub struct FluidParams {
    /// Regularisation, m.
    pub epsilon: f64,
    /// Viscosity, Pa s.
    pub viscosity: f64,
    /// Drag on changes of an edge's spin in the shaft frame, N m s a metre and radian.
    pub spin_drag: f64,
}

impl FluidParams {
    /// Those of a robot.
    pub fn new(robot: &Robot) -> Self {
        let spin_drag = robot.fluid.spin_drag.max(LEAST_SPIN_DRAG) * robot.round_spin_drag();
        Self { epsilon: robot.epsilon(), viscosity: robot.fluid.viscosity(), spin_drag }
    }
}

/// A frozen inverse.
#[derive(Clone, Debug)]
pub struct Preconditioner {
    /// Tangents and material directors of the edges at the shape where it was built.
    pub frames: Vec<[V3; 3]>,
    factors: Factors,
    /// Change of the fluid's force and torque on the rod (about the shaft's foot, shaft frame)
    /// within one step for a velocity and angular velocity of the base there: N s/m and N m s.
    pub response: Matrix6<f64>,
}

impl Preconditioner {
    /// Replaces rows of the residual over kappa by the corrections of the unknowns: vectors one after the other, each
    /// padded with zeros to the length `padded`.
    pub fn solve(&self, vectors: &mut [f32], padded: usize) {
        self.factors.solve(vectors);
        let size = 4 * (self.frames.len() + 1) - 2;
        for vector in vectors.chunks_exact_mut(padded) {
            vector[..size].rotate_left(CLAMP);
        }
    }
}

/// The equations of a rod linearised about a shape, but for time step and speed.
#[derive(Clone, Debug)]
pub struct Equations {
    nodes: Vec<V3>,
    frames: Vec<[V3; 3]>,
    /// The rod's own mobility: velocity of the nodes for force densities at them, column by column.
    mobility: Vec<f32>,
    /// M w^-1 K of the free degrees of freedom, before the division by kappa, column by column.
    elastic: Vec<f32>,
    hessian: Band,
    spin_drag: f64,
}

impl Equations {
    /// Linearises about a shape.
    pub fn new(rod: &Rod, at: &RodState, fluid: FluidParams) -> Self {
        let (n, rows) = (rod.nodes(), 3 * rod.nodes());
        let mut frames = Frames::new(n);
        frames.update(&at.frames, &at.shape.nodes, &at.shape.angles);
        let mut hessian = Band::new(4 * n);
        rod.hessian(&frames, &at.shape.angles, &mut hessian);
        let mobility = coarse_mobility(&at.shape.nodes, fluid);
        let mut elastic = vec![0.0; rows * 4 * (n - CLAMPED)];
        for column in 0..4 * n {
            let Some(unknown) = unknown_of(column, n) else {
                continue;
            };
            let out = &mut elastic[unknown * rows..(unknown + 1) * rows];
            for row in hessian.columns(column).filter(|row| row % 4 != 3 && *row >= 4 * CLAMPED) {
                let value = hessian.get(row, column) / rod.nodal_length[row / 4];
                if value != 0.0 {
                    let at = (row / 4 * 3 + row % 4) * rows;
                    add_multiple(value as f32, &mobility[at..at + rows], out);
                }
            }
        }
        Self {
            nodes: at.shape.nodes.clone(),
            frames: (0..n - 1).map(|e| [frames.tangent.at(e), frames.m1.at(e), frames.m2.at(e)]).collect(),
            mobility,
            elastic,
            hessian,
            spin_drag: fluid.spin_drag,
        }
    }

    /// Returns the inverse for `kappa` in 1/s and a spin in rad; `None` when the matrix is singular.
    pub fn invert(&self, rod: &Rod, kappa: f64, spin: f64) -> Option<Preconditioner> {
        let n = rod.nodes();
        let free = n - CLAMPED;
        let (rows, size) = (3 * n, 4 * n - 2);
        let padded = Factors::padded(size);
        let mut matrix = vec![0.0; padded * padded];
        let (clamp, rest) = matrix.split_at_mut(CLAMP * padded);
        for (column, mobility) in clamp.chunks_exact_mut(padded).zip(self.mobility.chunks_exact(rows)) {
            add_multiple(-1.0 / kappa as f32, mobility, column);
        }
        for (column, elastic) in rest.chunks_exact_mut(padded).zip(self.elastic.chunks_exact(rows)) {
            add_multiple(1.0 / kappa as f32, elastic, column);
        }
        let mut add = |row: usize, unknown: usize, value: f64| rest[unknown * padded + row] += value as f32;
        for node in CLAMPED..n {
            let (row, unknown) = (3 * node, 3 * (node - CLAMPED));
            for a in 0..3 {
                add(row + a, unknown + a, 1.0);
            }
            add(row, unknown + 1, -spin);
            add(row + 1, unknown, spin);
        }
        let scale = torque_scale(rod);
        for edge in 1..n - 1 {
            let (row, slot) = (3 * n + edge - 1, 4 * edge + 3);
            for column in self.hessian.columns(slot) {
                if let Some(unknown) = unknown_of(column, n) {
                    add(row, unknown, scale * self.hessian.get(slot, column));
                }
            }
            let drag = self.spin_drag * rod.rest_length[edge] * kappa;
            add(row, 3 * free + edge - 1, scale * drag);
        }
        let factors = Factors::new(matrix, size)?;
        let mut inverse = Preconditioner { frames: self.frames.clone(), factors, response: Matrix6::zeros() };
        inverse.response = self.response(rod, &inverse, kappa);
        Some(inverse)
    }

    fn response(&self, rod: &Rod, inverse: &Preconditioner, kappa: f64) -> Matrix6<f64> {
        let n = rod.nodes();
        let free = n - CLAMPED;
        let padded = Factors::padded(4 * n - 2);
        let mut rows = vec![0.0; 6 * padded];
        for (motion, rows) in rows.chunks_exact_mut(padded).enumerate() {
            let mut unit = V3::zeros();
            unit[motion % 3] = 1.0;
            for (i, x) in self.nodes.iter().enumerate() {
                let velocity = if motion < 3 { unit } else { unit.cross(x) };
                for a in 0..3 {
                    rows[3 * i + a] = (-velocity[a] / kappa) as f32;
                }
            }
        }
        inverse.solve(&mut rows, padded);
        let mut response = Matrix6::zeros();
        for (motion, correction) in rows.chunks_exact(padded).enumerate() {
            let correction = |unknown: usize| f64::from(correction[unknown]);
            for (i, x) in self.nodes.iter().enumerate() {
                let mut force = V3::zeros();
                for a in 0..3 {
                    force[a] = if i < CLAMPED {
                        -rod.nodal_length[i] * correction(4 * free + 3 * i + a)
                    } else {
                        let row = 4 * i + a;
                        self.hessian
                            .columns(row)
                            .filter_map(|c| unknown_of(c, n).map(|u| self.hessian.get(row, c) * correction(u)))
                            .sum()
                    };
                }
                let torque = x.cross(&force);
                for a in 0..3 {
                    response[(a, motion)] += force[a];
                    response[(3 + a, motion)] += torque[a];
                }
            }
        }
        response
    }
}

/// Returns the mobility matrix of [`crate::fluid::mobility::mobility`] in single precision, column by column. The density of
/// far segments acts at their ends: that is good to some per cent of their part.
fn coarse_mobility(nodes: &[V3], fluid: FluidParams) -> Vec<f32> {
    let (n, rows, factor) = (nodes.len(), 3 * nodes.len(), stokeslet_factor(fluid.viscosity));
    let e2 = fluid.epsilon * fluid.epsilon;
    let half: Vec<f64> = nodes.windows(2).map(|p| 0.5 * (p[1] - p[0]).norm()).collect();
    let mut mobility = vec![0.0; rows * rows];
    for (i, x) in nodes.iter().enumerate() {
        let near = i.saturating_sub(NEAR_EDGES + 1)..(i + NEAR_EDGES + 1).min(n - 1);
        for (j, y) in nodes.iter().enumerate() {
            let segments = j.saturating_sub(1)..(j + 1).min(n - 1);
            let length: f64 = segments.filter(|e| !near.contains(e)).map(|e| half[e]).sum();
            if length == 0.0 {
                continue;
            }
            let d = x - y;
            let inverse = 1.0 / (d.norm_squared() + e2).sqrt();
            let cubed = inverse * inverse * inverse;
            let direct = inverse + e2 * cubed;
            for b in 0..3 {
                let entries = &mut mobility[(3 * j + b) * rows + 3 * i..][..3];
                for (a, entry) in entries.iter_mut().enumerate() {
                    let same = if a == b { direct } else { 0.0 };
                    *entry = (factor * length * (same + cubed * d[a] * d[b])) as f32;
                }
            }
        }
        for e in near {
            for (side, flow) in segment_flow(*x, nodes[e], nodes[e + 1], fluid.epsilon).iter().enumerate() {
                for b in 0..3 {
                    for a in 0..3 {
                        mobility[(3 * (e + side) + b) * rows + 3 * i + a] += (factor * flow[(a, b)]) as f32;
                    }
                }
            }
        }
    }
    mobility
}

/// Adds a multiple of a vector to the beginning of another.
#[inline(always)]
fn add_multiple(factor: f32, vector: &[f32], out: &mut [f32]) {
    for (o, v) in out.iter_mut().zip(vector) {
        *o += factor * v;
    }
}

/// Column of a free degree of freedom (four slots a node), `None` for clamped or unused ones.
fn unknown_of(slot: usize, n: usize) -> Option<usize> {
    let (node, part) = (slot / 4, slot % 4);
    if part == 3 {
        (node >= 1 && node + 1 < n).then(|| 3 * (n - CLAMPED) + node - 1)
    } else {
        (node >= CLAMPED).then(|| 3 * (node - CLAMPED) + part)
    }
}

/// Scale of the torque rows, rad/(N m): a torque residual becomes the twist of an edge that it makes.
pub fn torque_scale(rod: &Rod) -> f64 {
    rod.rest_length[0] / rod.stiffness.twist_nm2
}
