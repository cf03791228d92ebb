//! The frozen inverse of one rod's own equations, and its response to a moving base.
//!
//! Unknowns of a rod of n nodes: free nodes (3 (n - 2)), free edge angles (n - 2), force densities at
//! the two clamped nodes (6). Rows: velocity of every node (3 n), torque about every free edge
//! (n - 2). With kappa = a_0/step (1/s) and spin s = omega/kappa the velocity rows, divided by a_0, are
//! x + s z x x + (1/kappa) M w^-1 K x - (1/kappa) M f; torque rows are scaled by length/GJ.
//!
//! [`Equations`] has the parts that depend on the shape, mainly M w^-1 K; [`Preconditioner`] is the inverse for one
//! time step. [`super::inverses`] chooses the shape.

use super::factors::Factors;
use super::panels::Panels;
use super::state::RodState;
use crate::V3;
use crate::fluid::{mobility::mobility, segment::segment_flow, stokeslet_factor};
use crate::lanes::Vectors;
use crate::linear::invert;
use crate::params::Robot;
use crate::rod::{CLAMPED, Rod, band::Band, frames::Frames, spin::SpinDrag};
use nalgebra::{DMatrix, Matrix6};

/// Parameters of the fluid about one rod.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluidParams {
    /// Regularisation, m.
    pub epsilon: f64,
    /// Viscosity, Pa s.
    pub viscosity: f64,
    /// Drag on the rod's spin.
    pub spin_drag: SpinDrag,
}

impl FluidParams {
    /// Returns the parameters of a robot.
    pub fn new(robot: &Robot) -> Self {
        Self { epsilon: robot.epsilon(), viscosity: robot.fluid.viscosity(), spin_drag: robot.spin_drag() }
    }
}

/// Largest number of rows (79 edges) for which factors in single precision are accurate enough: the stretch's share of
/// the matrix grows as the square of the number of edges.
const LARGEST_FACTORED: usize = 320;

/// How often an inverse is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// For hundreds of steps: it is worth a dense inverse, the fastest to apply.
    Lasting,
    /// For some steps: its factors cost a sixth of a dense inverse.
    Passing,
}

/// A frozen inverse.
#[derive(Clone, Debug)]
pub struct Preconditioner {
    /// Tangents and material directors of the edges at the shape where it was built.
    pub frames: [Vectors; 3],
    inverse: Inverse,
    /// The rod's response to a moving base.
    pub response: BaseResponse,
}

/// Response of a rod within one step to a velocity (m/s) and an angular velocity (rad/s) of the base at the shaft's foot,
/// shaft frame.
#[derive(Clone, Debug)]
pub struct BaseResponse {
    /// Force and torque of the fluid on the rod, about the foot: N s/m and N m s.
    pub load: Matrix6<f64>,
    /// The rod's unknowns, a column for each of the six motions, in the frames of the inverse.
    pub unknowns: [Vec<f32>; 6],
}

#[derive(Clone, Debug)]
enum Inverse {
    Dense(Panels),
    /// Factors of the matrix with the clamp's columns first, so that its pivots are blocks of neighbouring nodes.
    Factored(Factors),
}

impl Preconditioner {
    /// Writes the inverse times each of `vectors` to `out`. Vectors follow one another, and so do results, each with
    /// its padding: see [`Panels::padded`].
    pub fn multiply(&self, vectors: &[f32], out: &mut [f32]) {
        match &self.inverse {
            Inverse::Dense(panels) => panels.multiply(vectors, out),
            Inverse::Factored(factors) => solve(factors, vectors, self.response.unknowns[0].len(), out),
        }
    }
}

/// Writes the solutions for vectors of `size` rows to `out`, one after the other, each with its padding.
fn solve(factors: &Factors, vectors: &[f32], size: usize, out: &mut [f32]) {
    let padded = Factors::padded(size);
    let mut work = vec![0.0; vectors.len() / size * padded];
    for (work, vector) in work.chunks_exact_mut(padded).zip(vectors.chunks_exact(size)) {
        work[..size].copy_from_slice(vector);
    }
    factors.solve(&mut work);
    for (out, work) in out.chunks_exact_mut(Panels::padded(size)).zip(work.chunks_exact(padded)) {
        let (clamp, rest) = work[..size].split_at(3 * CLAMPED);
        out[..rest.len()].copy_from_slice(rest);
        out[rest.len()..size].copy_from_slice(clamp);
    }
}

/// The equations of a rod linearised about a shape, before a time step and a speed are chosen.
#[derive(Clone, Debug)]
pub struct Equations {
    nodes: Vec<V3>,
    frames: [Vectors; 3],
    mobility: DMatrix<f64>,
    /// M w^-1 K of the free degrees of freedom, before the division by kappa.
    elastic: DMatrix<f64>,
    hessian: Band,
    wanted: Use,
    spin_drag: SpinDrag,
}

impl Equations {
    /// Linearises about a shape.
    pub fn new(rod: &Rod, at: &RodState, fluid: FluidParams, wanted: Use) -> Self {
        let n = rod.nodes();
        let mut frames = Frames::new(n);
        frames.update(&at.frames, &at.shape.nodes, &at.shape.angles);
        let mut hessian = Band::new(4 * n);
        rod.hessian(&frames, &at.shape.angles, &mut hessian);
        let mobility = match wanted {
            Use::Lasting => mobility(&[&at.shape.nodes], fluid.epsilon, fluid.viscosity),
            Use::Passing => coarse_mobility(&at.shape.nodes, fluid),
        };
        let free = n - CLAMPED;
        let mut elastic = DMatrix::zeros(3 * n, 4 * free);
        for node in CLAMPED..n {
            for a in 0..3 {
                let row = 4 * node + a;
                let weight = 1.0 / rod.nodal_length[node];
                for column in hessian.columns(row) {
                    let Some(unknown) = unknown_of(column, n) else {
                        continue;
                    };
                    let value = weight * hessian.get(row, column);
                    if value != 0.0 {
                        elastic.column_mut(unknown).axpy(value, &mobility.column(3 * node + a), 1.0);
                    }
                }
            }
        }
        Self {
            nodes: at.shape.nodes.clone(),
            frames: frames.axes().map(Vectors::clone),
            mobility,
            elastic,
            hessian,
            wanted,
            spin_drag: fluid.spin_drag,
        }
    }

    /// Returns the inverse for `kappa` in 1/s and a spin in rad; `None` when the matrix is singular.
    pub fn invert(&self, rod: &Rod, kappa: f64, spin: f64) -> Option<Preconditioner> {
        let size = 4 * rod.nodes() - 2;
        let padded = Factors::padded(size);
        let mut matrix = self.matrix(rod, kappa, spin, padded);
        let (inverse, response) = if self.wanted == Use::Passing && size <= LARGEST_FACTORED {
            matrix.rotate_right(3 * CLAMPED * padded);
            matrix.resize(padded * padded, 0.0);
            let factors = Factors::new(matrix.iter().map(|v| *v as f32).collect(), size)?;
            let product = |vector: &[f64]| -> Vec<f64> {
                let vector: Vec<f32> = vector.iter().map(|v| *v as f32).collect();
                let mut out = vec![0.0; Panels::padded(size)];
                solve(&factors, &vector, size, &mut out);
                out.into_iter().map(f64::from).collect()
            };
            let response = self.response(rod, product, kappa);
            (Inverse::Factored(factors), response)
        } else {
            let mut rows: Vec<f64> = (0..size * size).map(|q| matrix[q % size * padded + q / size]).collect();
            if !invert(&mut rows, size) {
                return None;
            }
            let product = |vector: &[f64]| -> Vec<f64> {
                (0..size).map(|r| (0..size).map(|c| rows[r * size + c] * vector[c]).sum()).collect()
            };
            (Inverse::Dense(Panels::new(&rows, size)), self.response(rod, product, kappa))
        };
        Some(Preconditioner { frames: self.frames.clone(), inverse, response })
    }

    /// Returns the matrix of the equations, column by column, each padded with zeros to `padded` rows.
    fn matrix(&self, rod: &Rod, kappa: f64, spin: f64, padded: usize) -> Vec<f64> {
        let n = rod.nodes();
        let (free, rows) = (n - CLAMPED, 3 * n);
        let mut matrix = vec![0.0; padded * (4 * n - 2)];
        let (elastic, clamp) = matrix.split_at_mut(4 * free * padded);
        for (out, column) in elastic.chunks_exact_mut(padded).zip(self.elastic.as_slice().chunks_exact(rows)) {
            for (entry, value) in out.iter_mut().zip(column) {
                *entry = value / kappa;
            }
        }
        for (out, column) in clamp.chunks_exact_mut(padded).zip(self.mobility.as_slice().chunks_exact(rows)) {
            for (entry, value) in out.iter_mut().zip(column) {
                *entry = -value / kappa;
            }
        }
        let mut add = |row: usize, unknown: usize, value: f64| elastic[unknown * padded + row] += value;
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
            let drag = self.spin_drag.change * rod.rest_length[edge] * kappa;
            add(row, 3 * free + edge - 1, scale * drag);
        }
        matrix
    }

    /// Returns the response to a moving base. `solve`: the inverse times a vector.
    fn response(&self, rod: &Rod, solve: impl Fn(&[f64]) -> Vec<f64>, kappa: f64) -> BaseResponse {
        let n = rod.nodes();
        let free = n - CLAMPED;
        let mut load = Matrix6::zeros();
        let mut unknowns = [const { Vec::new() }; 6];
        for motion in 0..6 {
            let mut unit = V3::zeros();
            unit[motion % 3] = 1.0;
            let mut rows = vec![0.0; 4 * n - 2];
            for (i, x) in self.nodes.iter().enumerate() {
                let velocity = if motion < 3 { unit } else { unit.cross(x) };
                for a in 0..3 {
                    rows[3 * i + a] = -velocity[a] / kappa;
                }
            }
            // The spin of every edge with the frame, rad/s.
            let turning = |edge: usize| if motion < 3 { 0.0 } else { self.frames[0].at(edge).dot(&unit) };
            for edge in 1..n - 1 {
                let torque = self.spin_drag.frame * rod.rest_length[edge] * turning(edge);
                rows[3 * n + edge - 1] = -torque_scale(rod) * torque;
            }
            let correction = solve(&rows);
            for (i, x) in self.nodes.iter().enumerate() {
                let mut force = V3::zeros();
                for a in 0..3 {
                    force[a] = if i < CLAMPED {
                        -rod.nodal_length[i] * correction[4 * free + 3 * i + a]
                    } else {
                        let row = 4 * i + a;
                        self.hessian
                            .columns(row)
                            .filter_map(|c| unknown_of(c, n).map(|u| self.hessian.get(row, c) * correction[u]))
                            .sum()
                    };
                }
                let torque = x.cross(&force);
                for a in 0..3 {
                    load[(a, motion)] += force[a];
                    load[(3 + a, motion)] += torque[a];
                }
            }
            for edge in 0..n - 1 {
                let change = if edge == 0 { 0.0 } else { kappa * correction[3 * free + edge - 1] };
                let torque = -self.spin_drag.frame * rod.rest_length[edge] * (change + turning(edge));
                let tangent = self.frames[0].at(edge);
                for a in 0..3 {
                    load[(3 + a, motion)] += tangent[a] * torque;
                }
            }
            unknowns[motion] = correction[..rows.len()].iter().map(|v| *v as f32).collect();
        }
        BaseResponse { load, unknowns }
    }
}

/// Segments up to this many edges away from a node are integrated exactly in a coarse mobility ...
const NEAR_EDGES: usize = 2;
/// ... and up to this many regularisations: with the density of nearer segments at their ends, the mobility of a thick rod is
/// indefinite and its inverse useless.
const NEAR_EPSILONS: f64 = 3.0;

/// Returns the matrix of [`crate::fluid::mobility::mobility`] with the density of far segments at their ends. The error
/// is some per cent of the far part, less than the effect of the changing shape while the inverse is in use.
fn coarse_mobility(nodes: &[V3], fluid: FluidParams) -> DMatrix<f64> {
    let (n, factor, e2) = (nodes.len(), stokeslet_factor(fluid.viscosity), fluid.epsilon * fluid.epsilon);
    let half: Vec<f64> = nodes.windows(2).map(|p| 0.5 * (p[1] - p[0]).norm()).collect();
    let edge = 2.0 * half.iter().sum::<f64>() / half.len() as f64;
    let near_edges = NEAR_EDGES.max((NEAR_EPSILONS * fluid.epsilon / edge).ceil() as usize);
    let mut mobility = DMatrix::zeros(3 * n, 3 * n);
    for (i, x) in nodes.iter().enumerate() {
        let near = i.saturating_sub(near_edges + 1)..(i + near_edges + 1).min(n - 1);
        for (j, y) in nodes.iter().enumerate() {
            let segments = j.saturating_sub(1)..(j + 1).min(n - 1);
            let length: f64 = segments.filter(|e| !near.contains(e)).map(|e| half[e]).sum();
            if length > 0.0 {
                let d = x - y;
                let inverse = 1.0 / (d.norm_squared() + e2).sqrt();
                let cubed = inverse * inverse * inverse;
                let mut flow = d * (cubed * d).transpose();
                for a in 0..3 {
                    flow[(a, a)] += inverse + e2 * cubed;
                }
                mobility.fixed_view_mut::<3, 3>(3 * i, 3 * j).copy_from(&(flow * (factor * length)));
            }
        }
        for e in near {
            for (side, flow) in segment_flow(*x, nodes[e], nodes[e + 1], fluid.epsilon).iter().enumerate() {
                let mut block = mobility.fixed_view_mut::<3, 3>(3 * i, 3 * (e + side));
                block += flow * factor;
            }
        }
    }
    mobility
}

/// Returns the column of a free degree of freedom (four slots a node), `None` for clamped or unused ones.
fn unknown_of(slot: usize, n: usize) -> Option<usize> {
    let (node, part) = (slot / 4, slot % 4);
    if part == 3 {
        (node >= 1 && node + 1 < n).then(|| 3 * (n - CLAMPED) + node - 1)
    } else {
        (node >= CLAMPED).then(|| 3 * (node - CLAMPED) + part)
    }
}

/// Returns the scale of the torque rows, rad/(N m): it converts a torque residual to the twist of an edge that it
/// causes.
pub fn torque_scale(rod: &Rod) -> f64 {
    rod.rest_length[0] / rod.stiffness.twist_nm2
}
