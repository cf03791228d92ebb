//! The state of a robot: rods, motors, base and contact, and the earlier steps that the time formulas use.
//!
//! A state can be saved and restored. A run that continues from a state and its
//! [`StepControl`](crate::step::StepControl) gives the same bits: everything else in the solver is scratch memory or a
//! function of the parameters.

use crate::V3;
use crate::body::attitude::{euler_zyx, of_vector, unwrap};
use crate::body::{Body, shaft::MotorState};
use crate::contact::pairs::Pair;
use crate::rod::{CLAMPED, Rod, frames::ReferenceFrames};
use crate::step::Linearisation;
use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};

/// Shape of a rod in its shaft frame and the drag at its clamp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// Nodes in m; the first two are held by the clamp.
    pub nodes: Vec<V3>,
    /// Angles of the edges in rad; the first is held.
    pub angles: Vec<f64>,
    /// Force density on the fluid at the clamped nodes, N/m.
    pub clamp_density: [V3; CLAMPED],
}

impl Shape {
    /// Returns the stress-free shape.
    pub fn at_rest(rod: &Rod) -> Self {
        Self { nodes: rod.shape.clone(), angles: vec![0.0; rod.edges()], clamp_density: [V3::zeros(); CLAMPED] }
    }

    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let finite = |v: &V3| v.iter().all(|c| c.is_finite());
        self.nodes.iter().all(finite)
            && self.angles.iter().all(|a| a.is_finite())
            && self.clamp_density.iter().all(finite)
    }
}

/// Shape and frames of a rod.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RodState {
    /// Shape.
    pub shape: Shape,
    /// Reference frames at this shape.
    pub frames: ReferenceFrames,
}

/// An earlier step, as the time formulas use it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Past {
    /// Time in s.
    pub time: f64,
    /// Shapes of both rods.
    pub shapes: [Shape; 2],
    /// Attitude.
    pub attitude: UnitQuaternion<f64>,
    /// Angular velocity, body axes, rad/s.
    pub rate: V3,
}

/// State of a robot at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Time in s.
    pub time: f64,
    /// Both rods.
    pub rods: [RodState; 2],
    /// Both motors.
    pub motors: [MotorState; 2],
    /// The base.
    pub body: Body,
    /// Up to four earlier steps, newest first.
    pub past: Vec<Past>,
    /// Contact pairs of the last step with their forces.
    pub pairs: Vec<Pair>,
    /// Contact stiffness in N/m; it grows with the largest force so far.
    pub contact_stiffness: f64,
    /// Shapes about which the equations of the rods are linearised.
    pub linearisation: Linearisation,
}

impl State {
    /// Returns a robot at rest at time 0: upright, with stress-free flagella. `contact_stiffness` in N/m.
    pub fn at_rest(rods: &[Rod; 2], contact_stiffness: f64) -> Self {
        let rods =
            [0, 1].map(|k: usize| RodState { shape: Shape::at_rest(&rods[k]), frames: rods[k].rest_frames.clone() });
        Self {
            time: 0.0,
            linearisation: Linearisation::new(rods.clone()),
            rods,
            motors: [MotorState::default(); 2],
            body: Body::default(),
            past: Vec::new(),
            pairs: Vec::new(),
            contact_stiffness,
        }
    }

    /// Clears the past, for instance after a jump of a motor's speed, so that the next step starts without earlier
    /// points.
    pub fn restart(&mut self) {
        self.past.clear();
    }

    /// Turns the whole robot about the joint like a rigid body. `rotation`: rotation vector in world axes, rad.
    ///
    /// Motors, strains and velocities in body axes do not change. The earlier steps turn too, so the time formulas
    /// continue smoothly. Only quantities that depend on the vertical change: weight, righting moment and the twist of
    /// the tether.
    pub fn turn(&mut self, rotation: V3) {
        let turn = of_vector(rotation);
        for past in &mut self.past {
            past.attitude = turn * past.attitude;
        }
        self.body.attitude = turn * self.body.attitude;
        self.body.yaw = unwrap(euler_zyx(&self.body.attitude)[0], self.body.yaw + rotation.z);
    }
}
