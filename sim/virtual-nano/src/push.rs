//! A push: something turns the robot about its joint, like a hand or a wave in the tank.
//!
//! The robot turns as a rigid body, and its flagella keep their shape. The rate of the turn rises from zero and falls
//! back to it smoothly, so that the gyroscope can follow. The simulator turns the robot in steps of its windows; the
//! sensor's readings in between are interpolated.

use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Duration of a push, s.
const LENGTH_S: f64 = 0.5;

/// The axis of a push, through the joint.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Axis {
    /// The horizontal direction of the base's x axis, given by its yaw.
    X,
    /// The horizontal direction of the base's y axis.
    Y,
    /// The vertical.
    Vertical,
}

impl Axis {
    /// Returns the axis in world axes, for a robot with this yaw (rad).
    pub fn at(self, yaw: f64) -> Vector3<f64> {
        match self {
            Self::X => Vector3::new(yaw.cos(), yaw.sin(), 0.0),
            Self::Y => Vector3::new(-yaw.sin(), yaw.cos(), 0.0),
            Self::Vertical => Vector3::z(),
        }
    }
}

/// A push that has begun.
#[derive(Clone, Copy, Debug)]
pub struct Push {
    begin_s: f64,
    /// The rotation vector of the whole push, world axes, rad.
    rotation: Vector3<f64>,
    /// The share that the simulator's robot has already turned.
    done: f64,
}

impl Push {
    /// Returns a push that begins at a time, s. `rotation`: rotation vector in world axes, rad.
    pub fn new(begin_s: f64, rotation: Vector3<f64>) -> Self {
        Self { begin_s, rotation, done: 0.0 }
    }

    /// Returns the rotation of the simulator's robot to its attitude at a time (s), world axes, rad. From then on it
    /// counts as turned.
    pub fn advance_to(&mut self, time_s: f64) -> Vector3<f64> {
        let rotation = self.from_simulated(time_s);
        self.done = self.share(time_s);
        rotation
    }

    /// Returns the rotation at a time (s) from the simulator's robot, world axes, rad.
    pub fn from_simulated(&self, time_s: f64) -> Vector3<f64> {
        self.rotation * (self.share(time_s) - self.done)
    }

    /// Returns its angular velocity at a time (s), world axes, rad/s.
    pub fn rate(&self, time_s: f64) -> Vector3<f64> {
        self.rotation * ((1.0 - (TAU * self.part(time_s)).cos()) / LENGTH_S)
    }

    /// Returns the part of its duration that has passed.
    fn part(&self, time_s: f64) -> f64 {
        ((time_s - self.begin_s) / LENGTH_S).clamp(0.0, 1.0)
    }

    /// Returns the share of its rotation that is done.
    fn share(&self, time_s: f64) -> f64 {
        let part = self.part(time_s);
        part - (TAU * part).sin() / TAU
    }
}
