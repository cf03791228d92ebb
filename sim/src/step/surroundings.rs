//! The flow between the flagella and the other bodies in the fluid: the rigid head and the walls of the tank.
//!
//! The forces of the head's points on the fluid are F = R (u_rigid - u), with the resistance R of [`RigidSurface`], the
//! velocity u_rigid of the rigid body at its points and the flow u of the flagella there. The flow of these forces acts
//! on the flagella's nodes, their sum on the base. Every sweep of a step updates them once.
//!
//! A tank adds the flow of the images of all these forces ([`crate::fluid::tank`]), at the flagella and at the head.
//!
//! Units SI, body frame, where the head is constant. The flow between a flagellum and the head is smooth: each group of
//! edges acts on it as one point force, and groups are longer the farther away they are. Both directions use the
//! regularisation of the flagella, with which a line represents a round rod, so the coupling is reciprocal.

use crate::V3;
use crate::body::Body;
use crate::body::load::Load;
use crate::fluid::far::{Sources, Targets, gauss_rule};
use crate::fluid::head::RigidSurface;
use crate::fluid::tank::TankFlow;
use crate::fluid::{Line, stokeslet_factor};
use crate::functions::powi;
use crate::linear::multiply;
use crate::params::Robot;
use nalgebra::Matrix3;
use std::ops::Range;

/// Largest length of a group of edges over its distance from the head, unless the group is a single edge.
const GROUP_LENGTH: f64 = 0.25;

/// Relative error of the head's forces below which they agree with the images of all forces, in tolerances of the
/// solver.
const AGREED: f64 = 0.05;
/// Largest number of exchanges between the head's forces and the images in a sweep. Each leaves a share of the error:
/// the head's width over the distance of the walls.
const EXCHANGES: u32 = 10;

/// The head, the tank, and their flow at the flagella.
#[derive(Clone, Debug)]
pub struct Surroundings {
    head: Option<HeadFlow>,
    tank: Option<TankFlow>,
    /// Groups of edges of each flagellum.
    groups: Vec<Vec<Range<usize>>>,
    /// The groups as point forces.
    sources: Sources,
    /// Nodes of all flagella, one after the other.
    targets: Targets,
    nodes: Vec<V3>,
    /// The flow at the nodes of all flagella, one after the other, body axes, m/s.
    pub flow: Vec<V3>,
    epsilon: f64,
    factor: f64,
    /// [`AGREED`] times the robot's tolerance.
    agreed: f64,
    /// Share of the error that an exchange between head and images leaves, as measured in the step.
    left: f64,
}

/// The head, with its changing forces and flow.
#[derive(Clone, Debug)]
struct HeadFlow {
    surface: RigidSurface,
    /// Torque on the fluid for a unit angular velocity, about the joint.
    drag: Matrix3<f64>,
    targets: Targets,
    /// Velocity of the surface relative to the flow of everything else, three numbers per point.
    slip: Vec<f64>,
    /// Forces on the fluid, three numbers per point.
    forces: Vec<f64>,
    /// The forces before the last update.
    before: Vec<f64>,
    sources: Sources,
    load: Load,
    /// Rate of the base at the last update, rad/s.
    rate: V3,
}

impl Surroundings {
    /// Returns the surroundings in a robot's fluid. `at_rest`: nodes of the flagella in the body frame, m.
    pub fn new(robot: &Robot, head: Option<&RigidSurface>, at_rest: &[Vec<V3>]) -> Self {
        let precision = robot.solver.far_field;
        let count = at_rest.iter().map(Vec::len).sum();
        let points: &[V3] = head.map_or(&[], |h| &h.points);
        let groups = |line: &Vec<V3>| groups(line, points);
        Self {
            tank: robot.tank.as_ref().map(|tank| TankFlow::new(robot, tank, at_rest, points)),
            groups: at_rest.iter().map(groups).collect(),
            head: head.map(|surface| HeadFlow {
                drag: surface.rotational_resistance(),
                targets: Targets::new(surface.points.len(), precision),
                slip: vec![0.0; 3 * surface.points.len()],
                forces: vec![0.0; 3 * surface.points.len()],
                before: vec![0.0; 3 * surface.points.len()],
                sources: Sources::default(),
                load: Load::default(),
                rate: V3::zeros(),
                surface: surface.clone(),
            }),
            sources: Sources::default(),
            targets: Targets::new(count, precision),
            nodes: vec![V3::zeros(); count],
            flow: vec![V3::zeros(); count],
            agreed: AGREED * robot.solver.tolerance,
            left: 1.0,
            epsilon: robot.epsilon(),
            factor: stokeslet_factor(robot.fluid.viscosity()),
        }
    }

    /// Returns whether there is neither head nor tank.
    pub fn is_empty(&self) -> bool {
        self.head.is_none() && self.tank.is_none()
    }

    /// Starts a step: discards the flow of the last step and recomputes it.
    pub fn begin(&mut self, lines: &[Line], body: &Body) {
        if let Some(tank) = &mut self.tank {
            tank.begin(lines, &body.attitude);
        }
        if let Some(head) = &mut self.head {
            head.forces.fill(0.0);
        }
        self.left = 1.0;
        self.update(lines, body);
    }

    /// Returns whether flagella or head touch the tank.
    pub fn touch_tank(&self, lines: &[Line], body: &Body) -> bool {
        self.tank.as_ref().is_some_and(|tank| tank.is_touched(lines, &body.attitude))
    }

    /// Updates the head's forces and the flow at the flagella's nodes. Returns the largest change of the flow at a node, m/s.
    pub fn update(&mut self, lines: &[Line], body: &Body) -> f64 {
        self.sources.clear();
        let mut start = 0;
        for (line, groups) in lines.iter().zip(&self.groups) {
            push_groups(line, groups, &mut self.sources);
            self.nodes[start..start + line.nodes.len()].copy_from_slice(&line.nodes);
            start += line.nodes.len();
        }
        self.targets.set(&self.nodes);
        let Self { head, tank, .. } = self;
        if let Some(tank) = tank {
            tank.set_flagella(lines, &body.attitude);
        }
        if let Some(head) = head {
            head.set_flow(&self.sources, self.epsilon);
            match tank {
                None => {
                    head.respond(&[], body.rate, self.factor);
                }
                Some(tank) => {
                    // Until they agree: a flow that depended on earlier sweeps would spoil the acceleration of the
                    // sweeps.
                    let mut last = None;
                    for _ in 0..EXCHANGES {
                        tank.respond(&head.forces, &body.attitude);
                        let change = head.respond(tank.at_head(), body.rate, self.factor);
                        if let Some(last) = last.replace(change) {
                            self.left = (change / last).min(1.0);
                        }
                        if change * self.left < self.agreed {
                            break;
                        }
                    }
                }
            }
            self.targets.add_flow(&head.sources, self.epsilon);
        } else if let Some(tank) = tank {
            tank.respond(&[], &body.attitude);
        }
        let images = self.tank.as_ref().map(|tank| &tank.flow);
        let mut change = 0f64;
        for (i, flow) in self.flow.iter_mut().enumerate() {
            let mut new = self.targets.flow(i) * self.factor;
            if let Some(images) = images {
                new += images[i];
            }
            change = change.max((new - *flow).norm_squared());
            *flow = new;
        }
        change.sqrt()
    }

    /// Returns the load of the fluid on the head at the last update, body axes, moment about the joint.
    pub fn load(&self) -> Load {
        self.head.as_ref().map_or(Load::default(), |head| head.load)
    }

    /// Returns the moment (N m) on the head from the flow of everything else. The moment from the head's own rotation
    /// is not included; [`crate::body::joint::RigidBase`] has it.
    pub fn induced_moment(&self) -> V3 {
        self.head.as_ref().map_or(V3::zeros(), |head| head.load.moment + head.drag * head.rate)
    }
}

impl HeadFlow {
    /// Computes the flow of the flagella at the points.
    fn set_flow(&mut self, flagella: &Sources, epsilon: f64) {
        self.targets.set(&self.surface.points);
        self.targets.add_flow(flagella, epsilon);
    }

    /// Updates the forces on the fluid in the flow of the flagella and of the `images` (m/s at the points, empty without a tank).
    /// `rate`: angular velocity of the base. Returns the relative change of the forces.
    fn respond(&mut self, images: &[V3], rate: V3, factor: f64) -> f64 {
        let points = &self.surface.points;
        for (i, x) in points.iter().enumerate() {
            let mut slip = rate.cross(x) - self.targets.flow(i) * factor;
            if let Some(image) = images.get(i) {
                slip -= image;
            }
            self.slip[3 * i..3 * i + 3].copy_from_slice(slip.as_slice());
        }
        std::mem::swap(&mut self.forces, &mut self.before);
        let columns = self.surface.resistance.as_slice();
        multiply(columns, &self.slip, &mut self.forces);
        self.sources.clear();
        self.load = Load::default();
        self.rate = rate;
        for (x, f) in points.iter().zip(self.forces.chunks_exact(3)) {
            let force = V3::new(f[0], f[1], f[2]);
            self.sources.push(*x, force);
            self.load.force -= force;
            self.load.moment -= x.cross(&force);
        }
        let (mut change, mut size) = (0.0, f64::MIN_POSITIVE);
        for (new, old) in self.forces.iter().zip(&self.before) {
            change += powi(new - old, 2);
            size += new * new;
        }
        (change / size).sqrt()
    }
}

/// Returns groups of neighbouring edges of a line: short ones close to the `points` of the head, longer ones far from it.
fn groups(line: &[V3], points: &[V3]) -> Vec<Range<usize>> {
    let edges = line.len() - 1;
    let distance = |x: V3| points.iter().map(|p| (p - x).norm()).fold(f64::INFINITY, f64::min);
    let mut groups: Vec<Range<usize>> = Vec::new();
    let mut start = 0;
    let mut length = 0.0;
    for e in 0..edges {
        length += (line[e + 1] - line[e]).norm();
        let next = if e + 1 < edges { (line[e + 2] - line[e + 1]).norm() } else { f64::INFINITY };
        if length + next > GROUP_LENGTH * distance(line[e + 1]) {
            groups.push(start..e + 1);
            (start, length) = (e + 1, 0.0);
        }
    }
    if start < edges {
        groups.push(start..edges);
    }
    groups
}

/// Adds each group of a line's edges as one force in its middle. Single edges are close to the head and become two
/// forces.
fn push_groups(line: &Line, groups: &[Range<usize>], sources: &mut Sources) {
    for group in groups {
        if group.len() == 1 {
            sources.push_edges(group.clone(), gauss_rule(2), |i| line.nodes[i], |i| line.density[i]);
            continue;
        }
        let (mut force, mut place, mut total) = (V3::zeros(), V3::zeros(), 0.0);
        for e in group.clone() {
            let (x, y) = (line.nodes[e], line.nodes[e + 1]);
            let length = (y - x).norm();
            force += (line.density[e] + line.density[e + 1]) * (0.5 * length);
            place += (x + y) * (0.5 * length);
            total += length;
        }
        sources.push(place / total, force);
    }
}
