//! Attitudes as unit quaternions, Euler angles and rotation vectors.
//!
//! Unit quaternion q from body to world, Hamilton, scalar first. Euler angles of the sequence z-y'-x'' (intrinsic; MATLAB's
//! `quat2eul` with 'ZYX'): yaw psi about the vertical z, then pitch theta about the turned y, then roll phi about the body's
//! own x, so that q = q_z(psi) q_y(theta) q_x(phi). All angles in rad.

use crate::V3;
use nalgebra::{Quaternion, UnitQuaternion};
use std::f64::consts::TAU;

/// Returns the Euler angles z-y'-x'' [yaw, pitch, roll] in rad: yaw and roll in -pi..pi, pitch in -pi/2..pi/2.
///
/// At a pitch of +-pi/2 yaw and roll are not unique.
pub fn euler_zyx(q: &UnitQuaternion<f64>) -> [f64; 3] {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    [
        (2.0 * (x * y + w * z)).atan2(w * w + x * x - y * y - z * z),
        (2.0 * (w * y - x * z)).clamp(-1.0, 1.0).asin(),
        (2.0 * (y * z + w * x)).atan2(w * w - x * x - y * y + z * z),
    ]
}

/// Returns the tilt: the angle between the body's z axis and the vertical, degrees.
pub fn tilt_deg(pitch_deg: f64, roll_deg: f64) -> f64 {
    (pitch_deg.to_radians().cos() * roll_deg.to_radians().cos()).acos().to_degrees()
}

/// Returns `angle` (rad) shifted by whole revolutions to be nearest to `near` (rad).
pub fn unwrap(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}

/// Returns the rotation vector (rad, in axes of `from`) that rotates `from` into `to` by at most half a revolution.
pub fn rotation_between(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> V3 {
    let mut q = (from.inverse() * to).into_inner();
    if q.w < 0.0 {
        q = -q;
    }
    let vector = q.imag();
    let sine = vector.norm();
    if sine < 1e-9 { vector * 2.0 } else { vector * (2.0 * sine.atan2(q.w) / sine) }
}

/// Returns the attitude reached from `from` by a rotation vector (rad) in its axes.
pub fn rotated(from: &UnitQuaternion<f64>, rotation: V3) -> UnitQuaternion<f64> {
    let angle = rotation.norm();
    let scale = if angle < 1e-4 { 0.5 - angle * angle / 48.0 } else { (0.5 * angle).sin() / angle };
    let change = Quaternion::from_parts((0.5 * angle).cos(), rotation * scale);
    UnitQuaternion::from_quaternion(from.into_inner() * change)
}

/// Returns the derivative (rad/s) of the rotation vector r whose angular velocity in body axes is `rate`, w.
///
/// The inverse right Jacobian of the rotation group: w + r x w/2 + (1/|r|^2 - cot(|r|/2)/(2 |r|)) r x (r x w).
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
}
