//! The frozen inverse of one rod's own equations, and its response to a moving base.
//!
//! Unknowns of a rod of n nodes: free nodes (3 (n - 2)), free edge angles (n - 2), force densities at
//! the two clamped nodes (6). Rows: velocity of every node (3 n), torque about every free edge
//! (n - 2). With kappa = a_0/step (1/s) and spin s = omega/kappa the velocity rows, divided by a_0, are
//! x + s z x x + (1/kappa) M w^-1 K x - (1/kappa) M f; torque rows are scaled by length/GJ.
//!
//! It is built at the stress-free shape (one built under load makes later steps diverge), with kappa and
//! s rounded to a grid. So it depends on its key only, and a restored state goes on bit for bit. Where a rod is about to buckle or snap, the iteration with it stalls; then a step
//! gets an inverse of its own, built at its predicted shape and dropped after it.

use super::panels::Panels;
use crate::V3;
use crate::fluid::mobility::mobility;
use crate::linear::invert;
use crate::params::Robot;
use crate::rod::{CLAMPED, Rod, band::Band, frames::Frames, spin::SpinDrag};
use crate::state::Shape;
use nalgebra::{DMatrix, Matrix6};
use std::sync::Arc;

/// Ratio of neighbouring grid values of kappa.
const KAPPA_GRID: f64 = 1.25;
/// Distance of neighbouring grid values of the spin, rad.
const SPIN_GRID: f64 = 0.1;
/// Inverses in the cache; a ramp visits many keys, a steady trial two to ten.
const CACHE_SIZE: usize = 24;

/// Parameters of the fluid about one rod.
#[derive(Clone, Copy, Debug)]
pub struct FluidParams {
    /// Regularisation, m.
    pub epsilon: f64,
    /// Viscosity, Pa s.
    pub viscosity: f64,
    /// Drag on the rod's spin.
    pub spin_drag: SpinDrag,
}

impl FluidParams {
    /// Those of a robot.
    pub fn new(robot: &Robot) -> Self {
        Self { epsilon: robot.epsilon(), viscosity: robot.fluid.viscosity(), spin_drag: SpinDrag::new(robot) }
    }
}

/// Key of a frozen inverse: the rod and the grid values that it depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    rod: usize,
    /// Index on the logarithmic grid of kappa.
    kappa: i32,
    /// Index on the grid of the spin.
    spin: i32,
}

impl Key {
    /// For rod design `rod`, `kappa` = a_0/step in 1/s and the motor's speed in rad/s.
    pub fn new(rod: usize, kappa: f64, speed: f64) -> Self {
        let index = (kappa.ln() / KAPPA_GRID.ln()).round() as i32;
        Self { rod, kappa: index, spin: (speed / kappa / SPIN_GRID).round() as i32 }
    }

    /// Returns the grid value of kappa, 1/s.
    fn kappa(&self) -> f64 {
        KAPPA_GRID.powi(self.kappa)
    }
}

/// A frozen inverse.
#[derive(Clone, Debug)]
pub struct Preconditioner {
    /// Tangents and material directors of the edges at the shape where it was built.
    pub frames: Vec<[V3; 3]>,
    /// The inverse, single precision.
    pub inverse: Panels,
    /// Change of the fluid's force and torque on the rod (about the shaft's foot, shaft frame at rest)
    /// within one step for a velocity and angular velocity of the base there: N s/m and N m s.
    pub response: Matrix6<f64>,
}

/// Inverses by key, oldest dropped first.
#[derive(Clone, Debug, Default)]
pub struct Cache {
    entries: Vec<(Key, Arc<Preconditioner>)>,
    /// Self mobility and elastic Hessian at rest, one of each rod design.
    designs: Vec<Option<Design>>,
    /// Inverses built so far.
    pub built: usize,
}

impl Preconditioner {
    /// Returns the inverse at a trial shape, for one step. Motion: kappa in 1/s and the motor's speed in rad/s.
    pub fn at_shape(
        rod: &Rod,
        shape: &Shape,
        frames: &Frames,
        (kappa, speed): (f64, f64),
        fluid: FluidParams,
    ) -> Option<Self> {
        Design::new(rod, shape, frames, fluid).build(rod, kappa, speed / kappa)
    }
}

#[derive(Clone, Debug)]
struct Design {
    nodes: Vec<V3>,
    frames: Vec<[V3; 3]>,
    mobility: DMatrix<f64>,
    /// M w^-1 K of the free degrees of freedom, before the division by kappa.
    elastic: DMatrix<f64>,
    hessian: Band,
    spin_drag: SpinDrag,
}

impl Cache {
    /// Returns the inverse for a key, built if it is not in the cache; `None` when the matrix is singular.
    pub fn find(&mut self, key: Key, rod: &Rod, fluid: FluidParams) -> Option<Arc<Preconditioner>> {
        if let Some((_, known)) = self.entries.iter().find(|(k, _)| *k == key) {
            return Some(known.clone());
        }
        if self.designs.len() <= key.rod {
            self.designs.resize(key.rod + 1, None);
        }
        let design = self.designs[key.rod].get_or_insert_with(|| {
            let shape = Shape::at_rest(rod);
            let mut frames = Frames::new(rod.nodes());
            frames.update(&rod.rest_frames, &shape.nodes, &shape.angles);
            Design::new(rod, &shape, &frames, fluid)
        });
        let built = design.build(rod, key.kappa(), key.spin as f64 * SPIN_GRID)?;
        self.built += 1;
        if self.entries.len() == CACHE_SIZE {
            self.entries.remove(0);
        }
        let built = Arc::new(built);
        self.entries.push((key, built.clone()));
        Some(built)
    }
}

impl Design {
    fn new(rod: &Rod, shape: &Shape, frames: &Frames, fluid: FluidParams) -> Self {
        let n = rod.nodes();
        let mut hessian = Band::new(4 * n);
        rod.hessian(frames, &shape.angles, &mut hessian);
        let mobility = mobility(&[&shape.nodes], fluid.epsilon, fluid.viscosity);
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
            nodes: shape.nodes.clone(),
            frames: (0..n - 1).map(|e| [frames.tangent.at(e), frames.m1.at(e), frames.m2.at(e)]).collect(),
            mobility,
            elastic,
            hessian,
            spin_drag: fluid.spin_drag,
        }
    }

    fn build(&self, rod: &Rod, kappa: f64, spin: f64) -> Option<Preconditioner> {
        let n = rod.nodes();
        let free = n - CLAMPED;
        let size = 4 * n - 2;
        let mut matrix = vec![0.0; size * size];
        for row in 0..3 * n {
            let out = &mut matrix[row * size..(row + 1) * size];
            for (column, entry) in out[..4 * free].iter_mut().enumerate() {
                *entry = self.elastic[(row, column)] / kappa;
            }
            for clamped in 0..3 * CLAMPED {
                out[4 * free + clamped] = -self.mobility[(row, clamped)] / kappa;
            }
        }
        for node in CLAMPED..n {
            let (row, column) = (3 * node, 3 * (node - CLAMPED));
            for a in 0..3 {
                matrix[(row + a) * size + column + a] += 1.0;
            }
            matrix[row * size + column + 1] -= spin;
            matrix[(row + 1) * size + column] += spin;
        }
        let scale = torque_scale(rod);
        for edge in 1..n - 1 {
            let (row, slot) = (3 * n + edge - 1, 4 * edge + 3);
            for column in self.hessian.columns(slot) {
                if let Some(unknown) = unknown_of(column, n) {
                    matrix[row * size + unknown] = scale * self.hessian.get(slot, column);
                }
            }
            let drag = self.spin_drag.change * rod.rest_length[edge] * kappa;
            matrix[row * size + 3 * free + edge - 1] += scale * drag;
        }
        if !invert(&mut matrix, size) {
            return None;
        }
        let response = self.response(rod, &matrix, kappa);
        Some(Preconditioner { frames: self.frames.clone(), inverse: Panels::new(&matrix, size), response })
    }

    fn response(&self, rod: &Rod, inverse: &[f64], kappa: f64) -> Matrix6<f64> {
        let n = rod.nodes();
        let free = n - CLAMPED;
        let size = 4 * n - 2;
        let mut response = Matrix6::zeros();
        for motion in 0..6 {
            let mut unit = V3::zeros();
            unit[motion % 3] = 1.0;
            let mut rows = vec![0.0; size];
            for (i, x) in self.nodes.iter().enumerate() {
                let velocity = if motion < 3 { unit } else { unit.cross(x) };
                for a in 0..3 {
                    rows[3 * i + a] = velocity[a] / kappa;
                }
            }
            // The spin of every edge with the frame, rad/s.
            let turning = |edge: usize| if motion < 3 { 0.0 } else { self.frames[edge][0].dot(&unit) };
            for edge in 1..n - 1 {
                let torque = self.spin_drag.frame * rod.rest_length[edge] * turning(edge);
                rows[3 * n + edge - 1] = torque_scale(rod) * torque;
            }
            let correction: Vec<f64> =
                (0..size).map(|r| -(0..size).map(|c| inverse[r * size + c] * rows[c]).sum::<f64>()).collect();
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
                    response[(a, motion)] += force[a];
                    response[(3 + a, motion)] += torque[a];
                }
            }
            for (edge, [tangent, ..]) in self.frames.iter().enumerate() {
                let change = if edge == 0 { 0.0 } else { kappa * correction[3 * free + edge - 1] };
                let torque = -self.spin_drag.frame * rod.rest_length[edge] * (change + turning(edge));
                for a in 0..3 {
                    response[(3 + a, motion)] += tangent[a] * torque;
                }
            }
        }
        response
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
