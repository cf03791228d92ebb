//! The base within a step: its angular velocity is the unknown, and its attitude follows from it.
//!
//! The time formula acts on rotation vectors in axes of the attitude at the step's start; their rate for an angular
//! velocity w is the inverse right Jacobian of the rotation group times w.

use super::state::State;
use super::time_step::TimeStep;
use crate::V3;
use crate::body::Body;
use crate::body::attitude::{euler_zyx, rotated, rotation_between, rotation_vector_rate, unwrap};
use crate::body::joint::RigidBase;
use crate::body::shaft::Shaft;
use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector6};

/// Newton iterations for a given moment.
const ITERATIONS: u32 = 50;
/// Relative change of the rate at which the iterations end.
const RATE_ERROR: f64 = 1e-10;
/// Added to the rate in this ratio, rad/s, because the rate of a base at rest is zero.
const LEAST_RATE: f64 = 1e-3;

/// The base's unknowns and its time formula.
#[derive(Clone, Debug)]
pub struct BodySolve {
    /// Trial attitude and rate.
    pub body: Body,
    start: UnitQuaternion<f64>,
    start_yaw: f64,
    /// Trial rotation since the start, rad.
    rotation: V3,
    /// Effective step h/a_0, s.
    h_eff: f64,
    /// Sum of the past's weighted rotations over a_0, rad.
    past_rotation: V3,
    /// Sum of the past's weighted rates over the step, rad/s2.
    past_rate: V3,
    /// Change of the rods' moment within the step for a unit rate, N m s.
    response: Matrix3<f64>,
    /// The imbalance of moments before the last correction, N m.
    pub error: f64,
}

impl BodySolve {
    /// Returns the base at its predicted rate.
    pub fn new(state: &State, step: &TimeStep) -> Self {
        let weights = &step.body.derivative[..step.points];
        let start = state.body.attitude;
        let mut past = vec![(V3::zeros(), state.body.rate)];
        past.extend(state.past.iter().map(|p| (rotation_between(&start, &p.attitude), p.rate)));
        let weighted = |weights: &[f64]| {
            (weights.iter().zip(&past))
                .map(|(w, (r, v))| (r * *w, v * *w))
                .fold((V3::zeros(), V3::zeros()), |a, b| (a.0 + b.0, a.1 + b.1))
        };
        let (past_rotation, past_rate) = weighted(&weights[1..]);
        let (rotation, rate) = weighted(&step.body.prediction[..step.prediction_points]);
        let mut solve = Self {
            body: state.body,
            start,
            start_yaw: state.body.yaw,
            rotation,
            h_eff: step.length / weights[0],
            past_rotation: past_rotation / weights[0],
            past_rate: past_rate / step.length,
            response: Matrix3::zeros(),
            error: 0.0,
        };
        solve.set_rate(rate);
        solve
    }

    /// Sets the response of the rods to a moving base within the step: their forces and torques for a unit motion of
    /// the clamps, shaft frames, negative where they resist.
    pub fn set_response(&mut self, shafts: &[Shaft; 2], responses: [&Matrix6<f64>; 2]) {
        self.response = Matrix3::zeros();
        for (shaft, response) in shafts.iter().zip(responses) {
            for axis in 0..3 {
                let mut unit = V3::zeros();
                unit[axis] = 1.0;
                let (u, w) = (shaft.to_shaft(unit.cross(&shaft.foot)), shaft.to_shaft(unit));
                let load = response * Vector6::new(u.x, u.y, u.z, w.x, w.y, w.z);
                let force = shaft.to_body(V3::new(load[0], load[1], load[2]));
                let torque = shaft.to_body(V3::new(load[3], load[4], load[5])) + shaft.foot.cross(&force);
                for a in 0..3 {
                    self.response[(a, axis)] += torque[a];
                }
            }
        }
    }

    /// Sets the rate (rad/s); the attitude follows by the time formula.
    pub fn set_rate(&mut self, rate: V3) {
        self.body.rate = rate;
        for _ in 0..2 {
            self.rotation = rotation_vector_rate(self.rotation, rate) * self.h_eff - self.past_rotation;
        }
        self.body.attitude = rotated(&self.start, self.rotation);
        self.body.yaw = unwrap(euler_zyx(&self.body.attitude)[0], self.start_yaw);
    }

    /// Corrects the rate for the flagella's `moment` (N m). Returns the change in rad/s, or `None` if there is no
    /// solution.
    pub fn update(&mut self, base: &RigidBase, moment: V3) -> Option<V3> {
        let acceleration = self.body.rate / self.h_eff + self.past_rate;
        let rest = moment + base.moment(&self.body) - base.inertial_moment(self.body.rate, acceleration);
        self.error = rest.norm();
        let stiffness = base.stiffness(&self.body, self.h_eff) - self.response;
        let change = stiffness.lu().solve(&rest)?;
        self.set_rate(self.body.rate + change);
        change.norm().is_finite().then_some(change)
    }

    /// Solves for a given moment (N m). Returns whether that succeeded.
    pub fn solve(&mut self, base: &RigidBase, moment: V3) -> bool {
        for _ in 0..ITERATIONS {
            let Some(change) = self.update(base, moment) else { return false };
            if change.norm() <= RATE_ERROR * (LEAST_RATE + self.body.rate.norm()) {
                return true;
            }
        }
        // Smoothed Coulomb friction may alternate in its last digits.
        self.error.is_finite()
    }

    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let q = self.body.attitude.coords;
        q.iter().all(|c| c.is_finite()) && self.body.rate.iter().all(|c| c.is_finite())
    }

    /// Returns the trial attitude and rate, normalised.
    pub fn finish(&self) -> Body {
        let attitude = UnitQuaternion::from_quaternion(self.body.attitude.into_inner());
        Body { attitude, ..self.body }
    }
}
