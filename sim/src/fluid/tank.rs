//! The flow of a tank's walls and surface about a robot that turns in it: the images of all its forces, at all its points.
//!
//! Inputs and outputs are in body axes. Inside, world axes are used, in which the tank stands still. Images are at
//! least twice as far away as the wall, so their flow is smooth. It is computed between every few nodes of a flagellum
//! and eight points of the head ([`super::coarse`]); the nodes are closer together near a wall. The matrix between
//! these points is kept until they have moved. Far images, and the flow missing from the images in single walls, are a
//! polynomial ([`super::reflections`]).

use super::coarse::Coarse;
use super::reflections::Reflections;
use super::walls::{Images, Walls};
use super::{Line, stokeslet_factor};
use crate::V3;
use crate::params::{Robot, Tank};
use nalgebra::UnitQuaternion;

/// Largest spacing of coarse nodes, over the distance of the nearest wall and over a turn of the helix: errors are then
/// below 1 % of the images' flow.
const SPACING: f64 = 0.25;
/// Distance of the nearest wall, relative to the size of the head, above which eight points represent the head.
const FAR_HEAD: f64 = 1.0;
/// Distance that a point may move before the matrix is recomputed, over the distance of the nearest wall.
const MOVED: f64 = 2e-3;

/// The images' flow about one robot.
#[derive(Clone, Debug, Default)]
pub struct TankFlow {
    walls: Walls,
    /// The walls whose images are summed.
    near: Walls,
    /// The other images, and the flow missing from the images in single walls.
    reflections: Option<Reflections>,
    epsilon: f64,
    factor: f64,
    rod_radius: f64,
    /// A turn of the helix along its rod, m.
    turn: f64,
    flagella: Vec<CoarseNodes>,
    head: CoarseSurface,
    /// Coarse points of all flagella, then of the head, world axes, m.
    points: Vec<V3>,
    /// The coarse points for which the matrix was computed.
    assembled: Vec<V3>,
    /// Distance of the nearest wall or surface, m.
    clearance: f64,
    /// Forces of coarse points, of the flagella or of the head, world axes, N.
    forces: Vec<V3>,
    /// Flow of the images of the flagella's forces at the coarse points, world axes, and their moments.
    of_flagella: (Vec<V3>, Vec<f64>),
    /// Flow at the coarse points: summed in world axes, then rotated to body axes.
    coarse_flow: Vec<V3>,
    images: Images,
    /// The flow at the nodes of all flagella, one after the other, and then at the points of the head, body axes, m/s.
    pub flow: Vec<V3>,
}

/// The coarse nodes of a flagellum.
#[derive(Clone, Debug)]
struct CoarseNodes {
    /// Half of the adjacent edges, m: forces of the nodes over their densities.
    nodal_length: Vec<f64>,
    stride: usize,
    coarse: Coarse,
    picks: Vec<usize>,
}

/// The points that represent the head.
#[derive(Clone, Debug, Default)]
struct CoarseSurface {
    surface: Vec<V3>,
    far: bool,
    coarse: Coarse,
    /// Body frame, m.
    points: Vec<V3>,
}

impl TankFlow {
    /// Returns the flow about a robot. `at_rest`: nodes of the flagella in the body frame; `head`: points of the head's
    /// surface, none without a head; m.
    pub fn new(robot: &Robot, tank: &Tank, at_rest: &[Vec<V3>], head: &[V3]) -> Self {
        let (walls, space) = (Walls::of(tank), tank.space_of(robot));
        let near = walls.near(space);
        let reflections = Reflections::new(&walls, &near, space);
        let helix = robot.flagellum.helix(0);
        let count = at_rest.iter().map(Vec::len).sum::<usize>() + head.len();
        Self {
            near: if reflections.is_some() { near } else { walls.clone() },
            reflections,
            walls,
            epsilon: robot.epsilon(),
            factor: stokeslet_factor(robot.fluid.viscosity()),
            rod_radius: robot.flagellum.rod_radius_m,
            turn: helix.contour_length() * helix.pitch / helix.axial_length,
            flagella: at_rest.iter().map(|nodes| CoarseNodes::new(nodes)).collect(),
            head: CoarseSurface::new(head),
            flow: vec![V3::zeros(); count],
            ..Self::default()
        }
    }

    /// Chooses the coarse points for a step that starts from these shapes, and computes their matrix.
    pub fn begin(&mut self, lines: &[Line], attitude: &UnitQuaternion<f64>) {
        let [flagella, head] = self.clearances(lines, attitude);
        let clearance = flagella.min(head);
        for flagellum in &mut self.flagella {
            flagellum.choose(SPACING * clearance.min(self.turn));
        }
        self.head.choose(clearance);
        self.clearance = clearance;
        self.place(lines, attitude);
        self.assemble();
    }

    /// Returns whether a rod or the head touches a wall or the surface.
    pub fn is_touched(&self, lines: &[Line], attitude: &UnitQuaternion<f64>) -> bool {
        let [flagella, head] = self.clearances(lines, attitude);
        flagella < self.rod_radius || head < 0.0
    }

    /// Returns the least distances of the flagella's nodes and of the head's points from walls and surface, m.
    fn clearances(&self, lines: &[Line], attitude: &UnitQuaternion<f64>) -> [f64; 2] {
        let to_world = attitude.to_rotation_matrix();
        let least = |clearance: f64, x: &V3| clearance.min(self.walls.clearance(to_world * x));
        let nodes = lines.iter().flat_map(|line| &line.nodes);
        [nodes.fold(f64::INFINITY, least), self.head.surface.iter().fold(f64::INFINITY, least)]
    }

    /// Updates the flow for the densities of the flagella and the forces of the head's points, three numbers each (N, body
    /// axes).
    pub fn update(&mut self, lines: &[Line], head_forces: &[f64], attitude: &UnitQuaternion<f64>) {
        self.set_flagella(lines, attitude);
        self.respond(head_forces, attitude);
    }

    /// Sets shapes and densities of the flagella.
    pub fn set_flagella(&mut self, lines: &[Line], attitude: &UnitQuaternion<f64>) {
        self.place(lines, attitude);
        let bound = MOVED * self.clearance;
        if self.points.iter().zip(&self.assembled).any(|(x, y)| (x - y).norm() > bound) {
            self.assemble();
        }
        self.forces.clear();
        for (flagellum, line) in self.flagella.iter().zip(lines) {
            let start = self.forces.len();
            self.forces.resize(start + flagellum.picks.len(), V3::zeros());
            let own = &mut self.forces[start..];
            flagellum.coarse.gather(|i| line.density[i] * flagellum.nodal_length[i], own);
        }
        self.rotate_forces(attitude);
        self.images.multiply(0, &self.forces);
        let (flow, moments) = &mut self.of_flagella;
        flow.clear();
        flow.extend((0..self.points.len()).map(|i| self.images.flow(i)));
        moments.clear();
        if let Some(reflections) = &mut self.reflections {
            reflections.set_points(&self.points);
            reflections.add_moments(0, &self.forces, moments);
        }
    }

    /// Updates the flow for these forces of the head's points.
    pub fn respond(&mut self, head_forces: &[f64], attitude: &UnitQuaternion<f64>) {
        let first = self.points.len() - self.head.points.len();
        self.forces.clear();
        self.forces.resize(self.head.points.len(), V3::zeros());
        self.head.coarse.gather(|i| V3::from_column_slice(&head_forces[3 * i..3 * i + 3]), &mut self.forces);
        self.rotate_forces(attitude);
        self.images.multiply(first, &self.forces);

        let (of_flagella, moments) = &self.of_flagella;
        self.coarse_flow.clear();
        self.coarse_flow.extend(of_flagella.iter().enumerate().map(|(i, flow)| flow + self.images.flow(i)));
        if let Some(reflections) = &self.reflections {
            let mut moments = moments.clone();
            reflections.add_moments(first, &self.forces, &mut moments);
            reflections.add_flow(&moments, &mut self.coarse_flow);
        }
        let to_body = attitude.inverse().to_rotation_matrix();
        for flow in &mut self.coarse_flow {
            *flow = to_body * *flow * self.factor;
        }

        self.flow.fill(V3::zeros());
        let (mut coarse, mut fine) = (self.coarse_flow.as_slice(), self.flow.as_mut_slice());
        let flagella = self.flagella.iter().map(|f| (&f.coarse, f.nodal_length.len()));
        for (weights, count) in flagella.chain([(&self.head.coarse, self.head.surface.len())]) {
            let (own, others) = fine.split_at_mut(count);
            weights.spread(|c| coarse[c], own);
            (coarse, fine) = (&coarse[weights.count..], others);
        }
    }

    /// Returns the flow at the points of the head alone.
    pub fn at_head(&self) -> &[V3] {
        &self.flow[self.flow.len() - self.head.surface.len()..]
    }

    /// Rotates the forces from body axes to world axes.
    fn rotate_forces(&mut self, attitude: &UnitQuaternion<f64>) {
        let to_world = attitude.to_rotation_matrix();
        for force in &mut self.forces {
            *force = to_world * *force;
        }
    }

    /// Moves the coarse points.
    fn place(&mut self, lines: &[Line], attitude: &UnitQuaternion<f64>) {
        let to_world = attitude.to_rotation_matrix();
        self.points.clear();
        for (flagellum, line) in self.flagella.iter().zip(lines) {
            self.points.extend(flagellum.picks.iter().map(|i| to_world * line.nodes[*i]));
        }
        self.points.extend(self.head.points.iter().map(|x| to_world * x));
    }

    fn assemble(&mut self) {
        self.images.assemble(&self.near, &self.points, &self.points, self.epsilon);
        self.assembled.clone_from(&self.points);
    }
}

impl CoarseNodes {
    fn new(nodes: &[V3]) -> Self {
        let half = |i: usize| 0.5 * (nodes[i + 1] - nodes[i]).norm();
        let last = nodes.len() - 1;
        let nodal_length =
            (0..=last).map(|i| if i > 0 { half(i - 1) } else { 0.0 } + if i < last { half(i) } else { 0.0 }).collect();
        let (coarse, picks) = Coarse::line(nodes.len(), 1);
        Self { nodal_length, stride: 1, coarse, picks }
    }

    /// Chooses the coarse nodes. `spacing`: largest length between them, m.
    fn choose(&mut self, spacing: f64) {
        // An inner node has a whole edge.
        let stride = (spacing / self.nodal_length[1]).max(1.0) as usize;
        if stride != self.stride {
            (self.coarse, self.picks) = Coarse::line(self.nodal_length.len(), stride);
            self.stride = stride;
        }
    }
}

impl CoarseSurface {
    fn new(surface: &[V3]) -> Self {
        let coarse = Coarse::identity(surface.len());
        Self { surface: surface.to_vec(), far: false, coarse, points: surface.to_vec() }
    }

    /// Chooses the coarse points. `clearance`: distance of the nearest wall, m.
    fn choose(&mut self, clearance: f64) {
        let Some(first) = self.surface.first() else { return };
        let size = self.surface.iter().map(|x| (x - first).norm()).fold(0.0, f64::max);
        let far = clearance > FAR_HEAD * size;
        if far != self.far {
            (self.coarse, self.points) = match far {
                true => Coarse::body(&self.surface),
                false => (Coarse::identity(self.surface.len()), self.surface.clone()),
            };
            self.far = far;
        }
    }
}
