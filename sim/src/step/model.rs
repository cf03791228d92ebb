//! The constant data of a robot: its parameters, its rods at rest, its base and the limits of contact.

use super::limits::Limits;
use super::surroundings::Surroundings;
use crate::V3;
use crate::body::Body;
use crate::body::joint::RigidBase;
use crate::body::load::Load;
use crate::body::shaft::Shaft;
use crate::fluid::head::RigidSurface;
use crate::fluid::mobility::rigid_resistance;
use crate::params::{Closure, ParamError, Robot};
use crate::resistance::singular;
use crate::rod::Rod;
use nalgebra::Matrix3;
use std::f64::consts::PI;

/// A robot with one closure, prepared.
#[derive(Clone, Debug)]
pub struct Model {
    /// Its parameters, checked.
    pub robot: Robot,
    /// How the flagella act on the base.
    pub closure: Closure,
    /// The flagella at rest, shaft frames.
    pub rods: [Rod; 2],
    /// Feet of the shafts, body frame, m.
    pub feet: [V3; 2],
    /// The base on its joint.
    pub base: RigidBase,
    /// Its head, if it is a body in the flow.
    pub head: Option<RigidSurface>,
    /// Lengths and limits of contact.
    pub limits: Limits,
}

impl Model {
    /// Checks the parameters and prepares the robot.
    ///
    /// # Errors
    /// A parameter that is impossible.
    pub fn new(robot: &Robot, closure: Closure, rods: [Rod; 2]) -> Result<Self, ParamError> {
        robot.validate()?;
        let feet = robot.shaft_feet();
        let resistance = match closure {
            Closure::Lumped => pair_resistance(robot, &rods, &feet).ok_or_else(|| singular(robot))?,
            _ => Matrix3::zeros(),
        };
        let head = RigidSurface::of_head(robot)?;
        let base = RigidBase::new(robot, closure, resistance, head.as_ref());
        let limits = Limits::new(robot, &rods[0]);
        Ok(Self { robot: robot.clone(), closure, rods, feet, base, head, limits })
    }

    /// Returns whether the clamps of the elastic rods move with the body.
    pub fn two_way(&self) -> bool {
        self.closure.two_way()
    }

    /// Returns whether the flagella's net weight acts on the base. The printed equations leave it out.
    pub fn weight_on_base(&self) -> bool {
        self.robot.base.flagella_weight_on_base && self.closure != Closure::Paper
    }

    /// Returns the radius of a flagellum, m: the larger one of its helix and its rod.
    pub fn radius(&self) -> f64 {
        self.robot.flagellum.helix_radius_m.max(self.robot.flagellum.rod_radius_m)
    }

    /// Returns the head and the tank in the fluid, in their initial state.
    pub fn surroundings(&self) -> Surroundings {
        let line = |k: usize| {
            let shaft = Shaft::new(self.feet[k], 0.0);
            self.rods[k].shape.iter().map(|x| shaft.point_to_body(*x)).collect()
        };
        let lines: Vec<Vec<V3>> = (0..self.rods.len()).map(line).collect();
        Surroundings::new(&self.robot, self.head.as_ref(), &lines)
    }

    /// Returns the motion of the clamps: the body's, or none with a one-way closure.
    pub fn flagella_base(&self, body: &Body) -> Body {
        if self.two_way() { *body } else { Body::default() }
    }

    /// Returns the downward unit vector in the body frame; with a one-way closure it points along the base's axis.
    pub fn down(&self, body: &Body) -> V3 {
        if self.two_way() { body.attitude.inverse_transform_vector(&-V3::z()) } else { -V3::z() }
    }

    /// Returns the net weight of flagellum `k` with these nodes (shaft frame, m), body axes, moment about the joint.
    /// `down`: body axes.
    pub fn weight(&self, k: usize, nodes: &[V3], shaft: &Shaft, down: V3) -> Load {
        let mut load = Load::default();
        for (x, length) in nodes.iter().zip(&self.rods[k].nodal_length) {
            let force = down * (self.robot.net_weight() * length);
            load.force += force;
            load.moment += shaft.point_to_body(*x).cross(&force);
        }
        load
    }
}

/// Returns the rotational resistance about the joint of both rigid flagella, N m s: the mean over motor angles.
fn pair_resistance(robot: &Robot, rods: &[Rod; 2], feet: &[V3; 2]) -> Option<Matrix3<f64>> {
    let mut mean = Matrix3::zeros();
    let angles = [0.0, 0.5, 1.0, 1.5].map(|half_turns| half_turns * PI);
    for angle in angles {
        let lines = [0, 1].map(|k| -> Vec<V3> {
            let shaft = Shaft::new(feet[k], angle);
            rods[k].shape.iter().map(|x| shaft.point_to_body(*x)).collect()
        });
        let views = [lines[0].as_slice(), lines[1].as_slice()];
        let (epsilon, viscosity) = (robot.epsilon(), robot.fluid.viscosity());
        let spin_drag = robot.spin_drag().frame;
        let resistance = rigid_resistance(&views, V3::zeros(), epsilon, viscosity, spin_drag)?;
        mean += resistance.fixed_view::<3, 3>(3, 3).into_owned() / angles.len() as f64;
    }
    Some(0.5 * (mean + mean.transpose()))
}
