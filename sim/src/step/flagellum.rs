//! One flagellum within a step: its trial shape, the forces on it, its residual and its update.
//!
//! Shaft frame, SI. There is no inertia, and nothing is inverted. The force density on the fluid at free nodes is the
//! sum of elastic force, net weight and contact over the nodal length; the densities at the two clamped nodes are
//! unknowns. The residual is the velocity of every node less the mobility times the density, and the torque about every
//! free edge.

use super::corotated::{set_steps, steps_from_reference, to_reference};
use super::panels::Panels;
use super::preconditioner::{Preconditioner, torque_scale};
use super::state::{RodState, Shape};
use crate::V3;
use crate::body::load::Load;
use crate::body::shaft::Shaft;
use crate::fluid::far::{Sources, Targets, gauss_rule};
use crate::fluid::near::NearBand;
use crate::fluid::{Line, stokeslet_factor};
use crate::lanes::Vectors;
use crate::params::Robot;
use crate::rod::{CLAMPED, Rod, frames::Frames, spin::SpinDrag};

/// Motion of a shaft frame and the time formula of its rod.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics {
    /// Velocity of the frame's origin, in the frame, m/s.
    pub base_velocity: V3,
    /// Angular velocity of the frame, in the frame, rad/s: motor and body.
    pub rotation: V3,
    /// First weight of the time formula over the step, 1/s.
    pub kappa: f64,
}

/// Working memory of one flagellum.
#[derive(Clone, Debug)]
pub struct Flagellum {
    /// Trial shape.
    pub shape: Shape,
    /// Frames at the trial shape after [`Flagellum::update_forces`].
    pub frames: Frames,
    /// Force density on the fluid at all nodes, N/m.
    pub density: Vec<V3>,
    /// Contact forces on the nodes, shaft frame, N.
    pub contact: Vec<V3>,
    /// Flow of everything but the flagella at the nodes, shaft axes, m/s; see [`crate::step::surroundings`].
    pub surrounding_flow: Vec<V3>,
    /// Torques of contact on the edges about their tangents, N m.
    pub contact_torque: Vec<f64>,
    /// Sum over the past of the time formula's weights times the nodes, over the step: m/s.
    pub history: Vec<V3>,
    /// The same for the angles of the edges, rad/s.
    pub angle_history: Vec<f64>,
    spin_drag: SpinDrag,
    /// Residual over kappa: 3 n rows in m, then n - 2 torque rows in rad.
    residual: Vec<f64>,
    gradient: Vec<f64>,
    near: NearBand,
    targets: Targets,
    /// The residual in the frames of the frozen inverse.
    reference: Vec<f32>,
    product: Vec<f32>,
    /// Scratch of corrections edge by edge.
    steps: Vectors,
    /// The Gauss rule of far segments.
    pub rule: &'static [(f64, f64)],
    epsilon: f64,
    viscosity: f64,
}

impl Flagellum {
    /// Returns working memory for a rod at rest.
    pub fn new(robot: &Robot, rod: &Rod) -> Self {
        let n = rod.nodes();
        let points = robot.solver.gauss_points as usize;
        Self {
            shape: Shape::at_rest(rod),
            frames: Frames::new(n),
            density: vec![V3::zeros(); n],
            contact: vec![V3::zeros(); n],
            surrounding_flow: vec![V3::zeros(); n],
            contact_torque: vec![0.0; n - 1],
            history: vec![V3::zeros(); n],
            angle_history: vec![0.0; n - 1],
            spin_drag: robot.spin_drag(),
            residual: vec![0.0; 4 * n - 2],
            gradient: vec![0.0; 4 * n],
            near: NearBand::new(n, robot.solver.near_edges as usize, points),
            targets: Targets::new(n, robot.solver.far_field),
            reference: vec![0.0; 4 * n - 2],
            product: vec![0.0; Panels::padded(4 * n - 2)],
            steps: Vectors::new(n),
            rule: gauss_rule(points),
            epsilon: robot.epsilon(),
            viscosity: robot.fluid.viscosity(),
        }
    }

    /// Prepares the first sweep at the predicted shape: the reference frames of the step's start, and the near band.
    pub fn begin(&mut self, start: &RodState) {
        self.frames.start_from(&start.frames);
        self.near.assemble(&self.shape.nodes, self.epsilon, self.viscosity);
    }

    /// Updates frames, elastic forces and force densities at the trial shape. `weight`: net weight of the rod
    /// in the shaft frame, N/m.
    pub fn update_forces(&mut self, rod: &Rod, weight: V3) {
        let shape = &self.shape;
        self.frames.update_at(&shape.nodes, &shape.angles);
        rod.gradient(&mut self.frames, &shape.angles, &mut self.gradient);
        self.density[..CLAMPED].copy_from_slice(&shape.clamp_density);
        for i in CLAMPED..rod.nodes() {
            let elastic = V3::new(self.gradient[4 * i], self.gradient[4 * i + 1], self.gradient[4 * i + 2]);
            self.density[i] = (self.contact[i] - elastic) / rod.nodal_length[i] + weight;
        }
    }

    /// Adds this rod's far field.
    pub fn push_own_sources(&self, sources: &mut Sources) {
        let (nodes, density) = (&self.shape.nodes, &self.density);
        sources.push_edges(0..nodes.len() - 1, self.rule, |i| nodes[i], |i| density[i]);
    }

    /// Adds this rod's far field as seen from another shaft frame.
    pub fn push_sources(&self, own: &Shaft, other: &Shaft, sources: &mut Sources) {
        let (nodes, density) = (&self.shape.nodes, &self.density);
        let node = |i: usize| other.point_to_shaft(own.point_to_body(nodes[i]));
        sources.push_edges(0..nodes.len() - 1, self.rule, node, |i| other.to_shaft(own.to_body(density[i])));
    }

    /// Writes nodes and force densities in the body frame.
    pub fn write_line(&self, shaft: &Shaft, line: &mut Line) {
        line.nodes.clear();
        line.nodes.extend(self.shape.nodes.iter().map(|x| shaft.point_to_body(*x)));
        line.density.clear();
        line.density.extend(self.density.iter().map(|f| shaft.to_body(*f)));
    }

    /// Updates the residual and returns its size in m/s.
    ///
    /// `sources`: far field of both rods, in this shaft frame; `lever`: velocity in m/s equivalent to a twist error of
    /// one radian.
    #[inline(never)] // so that a profile shows it
    pub fn update_residual(&mut self, rod: &Rod, motion: &Kinematics, sources: &Sources, lever: f64) -> f64 {
        let n = rod.nodes();
        self.near.multiply(&self.density);
        self.targets.set(&self.shape.nodes);
        self.targets.add_flow(sources, self.epsilon);
        let factor = stokeslet_factor(self.viscosity);
        let inverse = 1.0 / motion.kappa;
        let mut largest = 0f64;
        for i in 0..n {
            let flagella = self.velocity(motion, i) - self.near.flow(i) - self.targets.flow(i) * factor;
            let slip = flagella - self.surrounding_flow[i];
            largest = largest.max(slip.norm_squared());
            for a in 0..3 {
                self.residual[3 * i + a] = slip[a] * inverse;
            }
        }
        let scale = torque_scale(rod);
        let mut twist = 0f64;
        for e in 1..n - 1 {
            let row = scale * (self.gradient[4 * e + 3] - self.spin_torque(motion, e) - self.contact_torque[e]);
            self.residual[3 * n + e - 1] = row;
            twist = twist.max(row.abs());
        }
        // max() drops a NaN, a sum does not.
        let sum: f64 = self.residual.iter().sum();
        if sum.is_finite() { largest.sqrt().max(twist * lever) } else { f64::INFINITY }
    }

    /// Returns the torque of the fluid on an edge about its tangent, N m.
    #[inline(always)]
    fn spin_torque(&self, motion: &Kinematics, e: usize) -> f64 {
        let change = self.shape.angles[e] * motion.kappa + self.angle_history[e];
        self.spin_drag.torque(self.frames.length[e], change, motion.rotation.dot(&self.frames.tangent.at(e)))
    }

    /// Returns the velocity of a node against the fluid at rest, shaft axes, m/s.
    #[inline(always)]
    pub fn velocity(&self, motion: &Kinematics, i: usize) -> V3 {
        let x = self.shape.nodes[i];
        x * motion.kappa + self.history[i] + motion.base_velocity + motion.rotation.cross(&x)
    }

    /// Returns the angular velocity of the cross-sections of an edge against the fluid at rest, shaft axes, rad/s.
    pub fn edge_rotation(&self, motion: &Kinematics, e: usize) -> V3 {
        let edge = self.shape.nodes[e + 1] - self.shape.nodes[e];
        let change = self.shape.angles[e] * motion.kappa + self.angle_history[e];
        let across = edge.cross(&(self.velocity(motion, e + 1) - self.velocity(motion, e))) / edge.norm_squared();
        let tangent = edge.normalize();
        tangent * (change + motion.rotation.dot(&tangent)) + across
    }

    /// Removes all loads of contact.
    pub fn clear_contact(&mut self) {
        self.contact.fill(V3::zeros());
        self.contact_torque.fill(0.0);
    }

    /// Adds a couple (N m, shaft axes) to the contact on an edge: the part along the edge twists it, the rest is a pair of
    /// forces on its nodes.
    pub fn add_contact_couple(&mut self, e: usize, couple: V3) {
        let edge = self.shape.nodes[e + 1] - self.shape.nodes[e];
        self.contact_torque[e] += couple.dot(&edge.normalize());
        let force = couple.cross(&edge) / edge.norm_squared();
        self.contact[e] -= force;
        self.contact[e + 1] += force;
    }

    /// Moves the trial shape by minus the frozen inverse times the residual, in corotated coordinates.
    #[inline(never)] // so that a profile shows it
    pub fn correct(&mut self, preconditioner: &Preconditioner) {
        let n = self.shape.nodes.len();
        let wanted = |i: usize| -V3::from_column_slice(&self.residual[3 * i..3 * i + 3]);
        let (built, today) = (preconditioner.frames.each_ref(), self.frames.axes());
        to_reference(built, today, wanted, &mut self.steps, &mut self.reference[..3 * n]);
        for (slot, row) in self.reference[3 * n..].iter_mut().zip(&self.residual[3 * n..]) {
            *slot = -*row as f32;
        }
        preconditioner.multiply(&self.reference, &mut self.product);
        self.apply_product(preconditioner);
    }

    /// Moves the trial shape by the rod's response to a change of the base's velocity (m/s) and angular velocity (rad/s) at
    /// the shaft's foot, shaft axes.
    pub fn follow_base(&mut self, preconditioner: &Preconditioner, velocity: V3, rotation: V3) {
        let motion = [velocity.x, velocity.y, velocity.z, rotation.x, rotation.y, rotation.z].map(|rate| rate as f32);
        let columns = &preconditioner.response.unknowns;
        for (i, slot) in self.product[..self.residual.len()].iter_mut().enumerate() {
            *slot = motion.iter().zip(columns).fold(0.0, |sum, (rate, column)| sum + rate * column[i]);
        }
        self.apply_product(preconditioner);
    }

    /// Moves the trial shape by `product`, which is in the frames of the inverse.
    fn apply_product(&mut self, preconditioner: &Preconditioner) {
        let product = std::mem::take(&mut self.product);
        let (built, today) = (preconditioner.frames.each_ref(), self.frames.axes());
        steps_from_reference(built, today, &product, self.shape.nodes.len() - 1, &mut self.steps);
        self.apply_steps(&product);
        self.product = product;
    }

    /// Returns the corrections of the rod's unknowns within the step for flows (m/s, shaft frame) at its nodes. For
    /// flows of unit forces, these are columns of its compliance.
    #[inline(never)] // so that a profile shows it
    pub fn compliance_columns(&self, preconditioner: &Preconditioner, flows: &[Vec<V3>], kappa: f64) -> Vec<Vec<f64>> {
        let (n, size) = (self.shape.nodes.len(), self.residual.len());
        let padded = Panels::padded(size);
        let (built, today, mut steps) = (preconditioner.frames.each_ref(), self.frames.axes(), Vectors::new(n));
        let mut rows = vec![0.0; size * flows.len()];
        let mut products = vec![0.0; padded * flows.len()];
        for (flow, rows) in flows.iter().zip(rows.chunks_exact_mut(size)) {
            to_reference(built, today, |i| flow[i] / kappa, &mut steps, &mut rows[..3 * n]);
        }
        preconditioner.multiply(&rows, &mut products);
        let column = |product: &[f32]| {
            let mut correction: Vec<f64> = product[..size].iter().map(|value| f64::from(*value)).collect();
            steps_from_reference(built, today, product, n - 1, &mut steps);
            let mut sum = V3::zeros();
            for (e, slots) in (1..n - 1).zip(correction.chunks_exact_mut(3)) {
                sum += steps.at(e);
                slots.copy_from_slice(sum.as_slice());
            }
            correction
        };
        products.chunks_exact(padded).map(column).collect()
    }

    /// Moves the trial shape by a correction of its unknowns.
    pub fn apply(&mut self, correction: &[f64]) {
        set_steps(&mut self.steps, self.shape.nodes.len() - 1, correction);
        self.apply_steps(correction);
    }

    /// Moves the trial shape by `steps` and the other unknowns of a correction: edge by edge, the part along an edge changes
    /// its length, the part across rotates it. Moving nodes along straight lines would stretch edges to second order, and
    /// the stretch is the stiff part.
    fn apply_steps<T: Copy + Into<f64>>(&mut self, correction: &[T]) {
        let n = self.shape.nodes.len();
        let nodes = &mut self.shape.nodes;
        let (mut before, mut end) = (nodes[1], nodes[1]);
        for e in 1..n - 1 {
            let (edge, step) = (nodes[e + 1] - before, self.steps.at(e));
            before = nodes[e + 1];
            let length = edge.norm();
            let tangent = edge / length;
            let along = step.dot(&tangent);
            let rotated = edge + step - tangent * along;
            end += rotated * ((length + along) / rotated.norm());
            nodes[e + 1] = end;
        }
        let angles = 3 * (n - CLAMPED);
        for (angle, change) in self.shape.angles[1..].iter_mut().zip(&correction[angles..angles + n - 2]) {
            *angle += (*change).into();
        }
        let clamp = 4 * (n - CLAMPED);
        for (i, density) in self.shape.clamp_density.iter_mut().enumerate() {
            for a in 0..3 {
                density[a] += correction[clamp + 3 * i + a].into();
            }
        }
    }

    /// Returns the load of the fluid on the clamp, body axes, moment about the joint.
    pub fn fluid_load(&self, rod: &Rod, shaft: &Shaft, motion: &Kinematics) -> Load {
        let mut load = Load::default();
        for (i, f) in self.density.iter().enumerate() {
            let force = *f * -rod.nodal_length[i];
            let x = self.shape.nodes[i];
            load.force += force;
            load.axial_torque += x.x * force.y - x.y * force.x;
            load.moment += x.cross(&force);
        }
        for e in 0..rod.edges() {
            let torque = self.frames.tangent.at(e) * self.spin_torque(motion, e);
            load.axial_torque += torque.z;
            load.moment += torque;
        }
        load.force = shaft.to_body(load.force);
        load.moment = shaft.to_body(load.moment) + shaft.foot.cross(&load.force);
        load
    }

    /// Returns the flow (m/s) of point sources at this rod's nodes, with the near part for a nodal density (N/m) on the
    /// rod itself.
    pub fn flow_of(&mut self, own_density: Option<&[V3]>, sources: &Sources) -> Vec<V3> {
        let n = self.shape.nodes.len();
        self.targets.set(&self.shape.nodes);
        self.targets.add_flow(sources, self.epsilon);
        let factor = stokeslet_factor(self.viscosity);
        let mut flow: Vec<V3> = (0..n).map(|i| self.targets.flow(i) * factor).collect();
        if let Some(density) = own_density {
            self.near.multiply(density);
            for (i, u) in flow.iter_mut().enumerate() {
                *u += self.near.flow(i);
            }
        }
        flow
    }
}
