//! The base within a step: its attitude as a rotation from the step's start, its rate as the unknown.
//!
//! The time formula acts on rotation vectors in axes of the attitude at the step's start, whose rate
//! for an angular velocity w is the inverse right Jacobian of the rotation group times w.

use crate::V3;
use crate::robot::body::{Base, Body, euler_zyx, rotated, rotation_between, rotation_vector_rate, unwrap};
use crate::robot::clamp::Shaft;
use crate::state::State;
use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector6};

/// The base's unknowns and the parts of its time formula.
#[derive(Clone, Debug)]
pub(super) struct BodySolve {
    /// Trial attitude and rate.
    pub body: Body,
    start: UnitQuaternion<f64>,
    start_yaw: f64,
    rotation: V3,
    lag: f64,
    past_rotation: V3,
    past_rate: V3,
    response: Matrix3<f64>,
    error: f64,
}

impl BodySolve {
    /// `weights`: those of the derivative over the step, `prediction`: those of the extrapolation.
    pub(super) fn new(state: &State, weights: &[f64], prediction: &[f64], step: f64) -> Self {
        let start = state.body.attitude;
        let mut past = vec![(V3::zeros(), state.body.rate)];
        past.extend(state.past.iter().map(|p| (rotation_between(&start, &p.attitude), p.rate)));
        let weighted = |weights: &[f64]| {
            (weights.iter().zip(&past))
                .map(|(w, (r, v))| (r * *w, v * *w))
                .fold((V3::zeros(), V3::zeros()), |a, b| (a.0 + b.0, a.1 + b.1))
        };
        let (past_rotation, past_rate) = weighted(&weights[1..]);
        let (rotation, rate) = weighted(prediction);
        let mut solve = Self {
            body: state.body,
            start,
            start_yaw: state.body.yaw,
            rotation,
            lag: step / weights[0],
            past_rotation: past_rotation / weights[0],
            past_rate: past_rate / step,
            response: Matrix3::zeros(),
            error: 0.0,
        };
        solve.set_rate(rate);
        solve
    }

    /// Takes over the rods' answer to a moving base, negative where it resists.
    pub(super) fn set_response(&mut self, shafts: &[Shaft; 2], responses: [&Matrix6<f64>; 2]) {
        self.response = Matrix3::zeros();
        for (shaft, response) in shafts.iter().zip(responses) {
            for axis in 0..3 {
                let mut unit = V3::zeros();
                unit[axis] = 1.0;
                let (u, w) = (shaft.to_shaft(unit.cross(&shaft.foot)), shaft.to_shaft(unit));
                let answer = response * Vector6::new(u.x, u.y, u.z, w.x, w.y, w.z);
                let force = shaft.to_body(V3::new(answer[0], answer[1], answer[2]));
                let torque = shaft.to_body(V3::new(answer[3], answer[4], answer[5])) + shaft.foot.cross(&force);
                for a in 0..3 {
                    self.response[(a, axis)] += torque[a];
                }
            }
        }
    }

    /// Sets the rate and lets the attitude follow.
    pub(super) fn set_rate(&mut self, rate: V3) {
        self.body.rate = rate;
        for _ in 0..2 {
            self.rotation = rotation_vector_rate(self.rotation, rate) * self.lag - self.past_rotation;
        }
        self.body.attitude = rotated(&self.start, self.rotation);
        self.body.yaw = unwrap(euler_zyx(&self.body.attitude)[0], self.start_yaw);
    }

    fn imbalance(&mut self, base: &Base, moment: V3) -> V3 {
        let acceleration = self.body.rate / self.lag + self.past_rate;
        let rest = moment + base.moment(&self.body) - base.inertial_moment(self.body.rate, acceleration);
        self.error = rest.norm();
        rest
    }

    /// One correction of the rate for the flagella's `moment` (N m); returns its change in rad/s.
    pub(super) fn update(&mut self, base: &Base, moment: V3) -> Option<V3> {
        let rest = self.imbalance(base, moment);
        let stiffness = base.stiffness(&self.body, self.lag) - self.response;
        let change = stiffness.lu().solve(&rest)?;
        self.set_rate(self.body.rate + change);
        change.norm().is_finite().then_some(change)
    }

    /// Solves for a given moment; `false` when that fails.
    pub(super) fn solve(&mut self, base: &Base, moment: V3) -> bool {
        for _ in 0..50 {
            match self.update(base, moment) {
                Some(change) if change.norm() <= 1e-10 * (1e-3 + self.body.rate.norm()) => {
                    return true;
                }
                Some(_) => {}
                None => return false,
            }
        }
        // Smoothed Coulomb friction may alternate in its last digits.
        self.error.is_finite()
    }

    /// Imbalance of moments before the last correction, N m.
    pub(super) fn error(&self) -> f64 {
        self.error
    }

    /// Whether every number is finite.
    pub(super) fn is_finite(&self) -> bool {
        let q = self.body.attitude.coords;
        q.iter().all(|c| c.is_finite()) && self.body.rate.iter().all(|c| c.is_finite())
    }

    /// The trial attitude and rate, normalised.
    pub(super) fn finish(&self) -> Body {
        let attitude = UnitQuaternion::from_quaternion(self.body.attitude.into_inner());
        Body { attitude, ..self.body }
    }
}
