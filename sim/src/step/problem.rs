//! One step's problem: the inputs of its sweeps, and how its parts act on each other.

use super::flagellum::{Flagellum, Kinematics};
use super::model::Model;
use super::preconditioner::Preconditioner;
use super::state::State;
use super::time_step::TimeStep;
use crate::V3;
use crate::body::Body;

/// The data that stay the same in all sweeps of a step.
#[derive(Clone, Copy)]
pub struct StepProblem<'a> {
    /// The robot.
    pub model: &'a Model,
    /// Its state at the start of the step.
    pub state: &'a State,
    /// Time formulas, and motors and shafts at the end of the step.
    pub step: &'a TimeStep,
    /// Frozen inverses of both rods.
    pub inverses: [&'a Preconditioner; 2],
}

impl StepProblem<'_> {
    /// Returns the motion of both shaft frames on a base with the angular velocity `rate` (body axes, rad/s).
    pub fn kinematics(&self, rate: V3) -> [Kinematics; 2] {
        let rate = if self.model.two_way() { rate } else { V3::zeros() };
        [0, 1].map(|k| {
            let (base_velocity, rotation) = self.base_motion(k, rate);
            Kinematics {
                base_velocity,
                rotation: rotation + V3::z() * self.step.motors[k].speed,
                kappa: self.step.kappa(k),
            }
        })
    }

    /// Returns the velocity of shaft `k`'s origin, m/s, and the angular velocity of the base, rad/s, both in the shaft's frame.
    pub fn base_motion(&self, k: usize, rate: V3) -> (V3, V3) {
        let shaft = &self.step.shafts[k];
        (shaft.to_shaft(rate.cross(&self.model.feet[k])), shaft.to_shaft(rate))
    }

    /// Updates frames, elastic forces and force densities of flagellum `k` at its trial shape.
    pub fn update_forces(&self, flagellum: &mut Flagellum, k: usize, body: &Body) {
        let down = self.step.shafts[k].to_shaft(self.model.down(body));
        let weight = down * self.model.robot.net_weight();
        flagellum.update_forces(&self.model.rods[k], weight);
    }

    /// Returns the moment of both flagella on the base about the joint, body axes, N m. Contact between them cancels.
    pub fn flagella_moment(&self, flagella: &[Flagellum; 2], body: &Body) -> V3 {
        let (model, shafts) = (self.model, &self.step.shafts);
        let motion = self.kinematics(body.rate);
        let mut moment = V3::zeros();
        for k in 0..2 {
            moment += flagella[k].fluid_load(&model.rods[k], &shafts[k], &motion[k]).moment;
            if model.weight_on_base() {
                moment += model.weight(k, &flagella[k].shape.nodes, &shafts[k], model.down(body)).moment;
            }
        }
        moment
    }
}
