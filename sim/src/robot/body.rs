//! Attitude and angular velocity of the base: quaternion kinematics and J dw/dt + w x J w = M.
//!
//! Unit quaternion q from body to world, Hamilton. Angular velocity and moments in body axes. Euler
//! angles in the order ZYX (MATLAB's `quat2eul`): yaw psi about z, pitch theta about y, roll phi about x.

use super::closure::Closure;
use crate::V3;
use crate::params::Robot;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Attitude and rate of the base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Body to world.
    pub attitude: UnitQuaternion<f64>,
    /// Angular velocity in body axes, rad/s.
    pub rate: V3,
    /// Yaw in rad, unwrapped: the tether counts turns.
    pub yaw: f64,
}

impl Default for Body {
    fn default() -> Self {
        Self { attitude: UnitQuaternion::identity(), rate: V3::zeros(), yaw: 0.0 }
    }
}

/// Yaw, pitch, roll of an attitude in rad, yaw in -pi..pi.
pub fn euler_zyx(q: &UnitQuaternion<f64>) -> [f64; 3] {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    [
        (2.0 * (x * y + w * z)).atan2(w * w + x * x - y * y - z * z),
        (2.0 * (w * y - x * z)).clamp(-1.0, 1.0).asin(),
        (2.0 * (y * z + w * x)).atan2(w * w - x * x - y * y + z * z),
    ]
}

/// The value of `angle` modulo whole turns that lies nearest to `near`.
pub fn unwrap(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}

/// Rotation vector in rad that turns `from` into `to`, in axes of `from`.
pub fn rotation_between(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> V3 {
    let mut q = (from.inverse() * to).into_inner();
    if q.w < 0.0 {
        q = -q;
    }
    let vector = q.imag();
    let sine = vector.norm();
    if sine < 1e-9 { vector * 2.0 } else { vector * (2.0 * sine.atan2(q.w) / sine) }
}

/// The attitude reached from `from` by a rotation vector in its axes.
pub fn rotated(from: &UnitQuaternion<f64>, rotation: V3) -> UnitQuaternion<f64> {
    let angle = rotation.norm();
    let scale = if angle < 1e-4 { 0.5 - angle * angle / 48.0 } else { (0.5 * angle).sin() / angle };
    let turn = Quaternion::from_parts((0.5 * angle).cos(), rotation * scale);
    UnitQuaternion::from_quaternion(from.into_inner() * turn)
}

/// Rate of a rotation vector whose body-axes angular velocity is `rate`: the inverse right Jacobian of
/// the rotation group, w + r x w/2 + (1/|r|^2 - cot(|r|/2)/(2 |r|)) r x (r x w).
pub fn rotation_vector_rate(rotation: V3, rate: V3) -> V3 {
    let angle = rotation.norm();
    let factor = if angle < 1e-3 {
        1.0 / 12.0 + angle * angle / 720.0
    } else {
        1.0 / (angle * angle) - 0.5 / (angle * (0.5 * angle).tan())
    };
    let once = rotation.cross(&rate);
    rate + once * 0.5 + rotation.cross(&once) * factor
}

/// What acts on the base besides its flagella.
#[derive(Clone, Debug)]
pub struct Base {
    inertia: V3,
    drag: f64,
    flagella_resistance: Matrix3<f64>,
    righting: f64,
    tether: f64,
    viscous: f64,
    coulomb: f64,
    closure: Closure,
}

/// Rate in rad/s below which Coulomb friction is smoothed.
const SLIP: f64 = 0.01 * PI / 180.0;

impl Base {
    /// From the parameters; `flagella_resistance` (N m s) is used by the `lumped` closure alone.
    pub fn new(robot: &Robot, closure: Closure, flagella_resistance: Matrix3<f64>) -> Self {
        let base = &robot.base;
        Self {
            inertia: V3::from(base.inertia_kg_m2),
            drag: robot.base_drag(),
            flagella_resistance,
            righting: base.mass_kg * base.gravity_m_s2 * base.mass_centre_below_joint_m,
            tether: robot.joint.tether(closure),
            viscous: robot.joint.viscous_nms,
            coulomb: robot.joint.coulomb_nm,
            closure,
        }
    }

    /// Moment of everything but the flagella's loads, body axes, N m.
    pub fn moment(&self, body: &Body) -> V3 {
        let mut moment = -body.rate * self.drag;
        if self.closure == Closure::Paper {
            let pitch = euler_zyx(&body.attitude)[1];
            moment.y -= self.righting * pitch.sin();
            return moment;
        }
        let up = body.attitude.inverse_transform_vector(&V3::z());
        // The mass centre hangs below the joint: r_com x m g.
        moment += V3::z().cross(&up) * self.righting;
        moment -= up * (self.tether * body.yaw);
        moment -= body.rate * self.viscous;
        moment -= body.rate * (self.coulomb / (body.rate.norm_squared() + SLIP * SLIP).sqrt());
        if self.closure == Closure::Lumped {
            moment -= self.flagella_resistance * body.rate;
        }
        moment
    }

    /// J a + w x J w for a rate w and its derivative a, body axes, N m.
    pub fn inertial_moment(&self, rate: V3, acceleration: V3) -> V3 {
        self.inertia.component_mul(&acceleration) + rate.cross(&self.inertia.component_mul(&rate))
    }

    /// Derivative of (inertial moment - moment) with respect to the rate, when the attitude follows
    /// the rate by `lag` (s) and the acceleration by 1/`lag`.
    pub fn stiffness(&self, body: &Body, lag: f64) -> Matrix3<f64> {
        let up = body.attitude.inverse_transform_vector(&V3::z());
        let mut s = Matrix3::from_diagonal(&(self.inertia / lag));
        s += Matrix3::identity() * self.drag;
        if self.closure == Closure::Paper {
            s[(1, 1)] += self.righting * lag;
            return s;
        }
        let friction = (body.rate.norm_squared() + SLIP * SLIP).sqrt();
        s += Matrix3::identity() * (self.viscous + self.coulomb / friction);
        // A turn d moves `up` by up x d, and the tether's twist by about up.d.
        s += (Matrix3::identity() * up.z - up * V3::z().transpose()) * (self.righting * lag);
        s += up * up.transpose() * (self.tether * lag);
        if self.closure == Closure::Lumped {
            s += self.flagella_resistance;
        }
        s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn euler_angles_follow_the_zyx_order() {
        let (yaw, pitch, roll) = (2.5, -0.4, 0.3);
        let q = UnitQuaternion::from_axis_angle(&V3::z_axis(), yaw)
            * UnitQuaternion::from_axis_angle(&V3::y_axis(), pitch)
            * UnitQuaternion::from_axis_angle(&V3::x_axis(), roll);
        for (got, want) in euler_zyx(&q).into_iter().zip([yaw, pitch, roll]) {
            assert!((got - want).abs() < 1e-14);
        }
    }

    #[test]
    fn rotation_vectors_go_both_ways_and_their_rate_is_the_derivative() {
        let from = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.1);
        let (r, w) = (V3::new(0.4, -0.7, 0.2), V3::new(-0.3, 0.5, 0.9));
        let to = rotated(&from, r);
        assert!((rotation_between(&from, &to) - r).norm() < 1e-14);
        let h = 1e-6;
        let ahead = rotation_between(&from, &rotated(&to, w * h));
        let behind = rotation_between(&from, &rotated(&to, w * -h));
        let rate = rotation_vector_rate(r, w);
        assert!(((ahead - behind) / (2.0 * h) - rate).norm() < 1e-9);
    }

    #[test]
    fn the_righting_moment_rights() {
        let base = Base::new(&Robot::default(), Closure::Full, Matrix3::zeros());
        let body = Body { attitude: UnitQuaternion::from_axis_angle(&V3::y_axis(), 0.2), ..Body::default() };
        assert!(base.moment(&body).y < 0.0);
    }
}
