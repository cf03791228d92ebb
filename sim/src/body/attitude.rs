//! Attitudes as unit quaternions, Euler angles and rotation vectors.
//!
//! Unit quaternion q from body to world, Hamilton, scalar first. Euler angles of the sequence z-y'-x'' (intrinsic; MATLAB's
//! `quat2eul` with 'ZYX'): yaw psi about the vertical z, then pitch theta about the turned y, then roll phi about the body's
//! own x, so that q = q_z(psi) q_y(theta) q_x(phi). All angles in rad.

use crate::V3;
use crate::functions::{acos, asin, atan2, cos, sin, sin_cos, tan};
use nalgebra::{Quaternion, UnitQuaternion};
use std::f64::consts::TAU;

/// Returns the Euler angles z-y'-x'' [yaw, pitch, roll] in rad: yaw and roll in -pi..pi, pitch in -pi/2..pi/2.
///
/// At a pitch of +-pi/2 yaw and roll are not unique.
pub fn euler_zyx(q: &UnitQuaternion<f64>) -> [f64; 3] {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    [
        atan2(2.0 * (x * y + w * z), w * w + x * x - y * y - z * z),
        asin((2.0 * (w * y - x * z)).clamp(-1.0, 1.0)),
        atan2(2.0 * (y * z + w * x), w * w - x * x - y * y + z * z),
    ]
}

/// Returns the tilt: the angle between the body's z axis and the vertical, degrees.
pub fn tilt_deg(pitch_deg: f64, roll_deg: f64) -> f64 {
    acos(cos(pitch_deg.to_radians()) * cos(roll_deg.to_radians())).to_degrees()
}

/// Returns `angle` (rad) shifted by whole revolutions to be nearest to `near` (rad).
pub fn unwrap(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}

/// Returns the attitude with these Euler angles z-y'-x'' [yaw, pitch, roll] in rad.
pub fn of_euler_zyx(angles: [f64; 3]) -> UnitQuaternion<f64> {
    let [(sz, cz), (sy, cy), (sx, cx)] = angles.map(|angle| sin_cos(0.5 * angle));
    UnitQuaternion::from_quaternion(Quaternion::new(
        cx * cy * cz + sx * sy * sz,
        sx * cy * cz - cx * sy * sz,
        cx * sy * cz + sx * cy * sz,
        cx * cy * sz - sx * sy * cz,
    ))
}

/// Returns the rotation by a rotation vector, rad.
pub fn of_vector(rotation: V3) -> UnitQuaternion<f64> {
    rotated(&UnitQuaternion::identity(), rotation)
}

/// Returns the smallest rotation of a direction into another one; `None` if they are opposite or zero. They need not be unit
/// vectors.
pub fn aligning(from: V3, to: V3) -> Option<UnitQuaternion<f64>> {
    let (from, to) = (from.try_normalize(0.0)?, to.try_normalize(0.0)?);
    let twice = Quaternion::from_parts(1.0 + from.dot(&to), from.cross(&to));
    UnitQuaternion::try_new(twice, 1e-8)
}

/// Returns the rotation vector (rad) of a rotation by at most half a revolution.
pub fn vector_of(rotation: &UnitQuaternion<f64>) -> V3 {
    rotation_between(&UnitQuaternion::identity(), rotation)
}

/// Returns the rotation vector (rad, in axes of `from`) that rotates `from` into `to` by at most half a revolution.
pub fn rotation_between(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>) -> V3 {
    let mut q = (from.inverse() * to).into_inner();
    if q.w < 0.0 {
        q = -q;
    }
    let vector = q.imag();
    let sine = vector.norm();
    if sine < 1e-9 { vector * 2.0 } else { vector * (2.0 * atan2(sine, q.w) / sine) }
}

/// Returns the attitude reached from `from` by a rotation vector (rad) in its axes.
pub fn rotated(from: &UnitQuaternion<f64>, rotation: V3) -> UnitQuaternion<f64> {
    let angle = rotation.norm();
    let scale = if angle < 1e-4 { 0.5 - angle * angle / 48.0 } else { sin(0.5 * angle) / angle };
    let change = Quaternion::from_parts(cos(0.5 * angle), rotation * scale);
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
        1.0 / (angle * angle) - 0.5 / (angle * tan(0.5 * angle))
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
    fn angles_and_directions_make_rotations() {
        let angles = [2.5, -0.4, 0.3];
        for (got, want) in euler_zyx(&of_euler_zyx(angles)).into_iter().zip(angles) {
            assert!((got - want).abs() < 1e-14);
        }
        let (from, to) = (V3::new(1.0, -2.0, 0.5), V3::new(0.3, 0.1, -4.0));
        let turn = aligning(from, to).expect("not opposite");
        assert!((turn * from.normalize() - to.normalize()).norm() < 1e-14);
        assert!((vector_of(&turn).norm() - from.angle(&to)).abs() < 1e-14);
        assert!(aligning(from, -from).is_none() && aligning(from, V3::zeros()).is_none());
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
