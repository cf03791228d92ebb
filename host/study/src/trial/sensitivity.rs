//! How errors of the sensor become errors of yaw, pitch and roll: derivatives by each error, to first order.
//!
//! Let u be up in body axes, and z its value at rest, where the trial has its zero. Then, with the integrals of
//! [`crate::attitude::ROTATIONS`]:
//!
//! - Gyroscope, yaw: the vertical part of the error of the rate, integrated since the zero.
//! - Gyroscope, tilt: the board's filter follows gravity with a time constant τ, so that a lasting error δω of the rate
//!   turns up by u × δω τ.
//! - Accelerometer: an error of the force at rest is part of the zero; what changes with the tilt remains, so that a
//!   matrix S of errors turns up by S (u - z).
//! - Mounting by a small rotation μ: the rotation about the vertical is wrong by (u - z) · μ, and up by (u - z) × μ. The
//!   lean at rest, z × μ, is removed as an offset of the accelerometer, which lags by τ in the world; that of the mounting
//!   does not lag, so that at a rate ω up is wrong by τ ω × (z × μ) besides.

use crate::attitude::ROTATIONS;
use crate::sensor::PARAMETERS;
use nalgebra::{Matrix3, Vector3};

/// The state of a trial over a time of which the mean attitude is stated.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Stated {
    /// See [`crate::attitude::ROTATIONS`], since the zero.
    pub rotations: [f64; ROTATIONS],
    /// Mean pitch and roll, degrees.
    pub tilt_deg: [f64; 2],
    /// Mean rates about the body's axes, °/s.
    pub rates_dps: [f64; 3],
    /// Warming of the sensor since the zero, °C.
    pub warming_c: f64,
    /// Time constant of the board's filter, s.
    pub filter_s: f64,
}

/// Derivatives of yaw, pitch and roll by each of a sensor's errors ([`crate::sensor::Sensor::parameters`]), degrees per
/// unit.
type Sensitivity = [[f64; PARAMETERS]; 3];

impl Stated {
    /// Returns up in body axes.
    fn up(&self) -> Vector3<f64> {
        let [pitch, roll] = self.tilt_deg.map(f64::to_radians);
        Vector3::new(-pitch.sin(), pitch.cos() * roll.sin(), pitch.cos() * roll.cos())
    }

    /// Returns degrees of pitch and roll for a small change of up, which remains a unit vector.
    fn tilt(&self, moved: Vector3<f64>) -> [f64; 2] {
        let up = self.up();
        let moved = moved - up * up.dot(&moved);
        let across = up.y * up.y + up.z * up.z;
        [-moved.x / across.sqrt(), (up.z * moved.y - up.y * moved.z) / across].map(f64::to_degrees)
    }

    /// Returns the change of up for a lasting error of 1 °/s of the rate about an axis.
    fn turned(&self, i: usize) -> Vector3<f64> {
        self.up().cross(&Vector3::ith(i, 1.0)) * self.filter_s.to_radians()
    }

    /// Returns the derivatives of pitch and roll by a bias about each axis that was not there at rest, degrees per °/s.
    pub fn tilts_by_bias(&self) -> [[f64; 3]; 2] {
        let by = [0, 1, 2].map(|i| self.tilt(self.turned(i)));
        [0, 1].map(|k| by.map(|tilts| tilts[k]))
    }

    /// Returns the derivatives.
    pub fn sensitivity(&self) -> Sensitivity {
        let pitch = self.tilt_deg[0].to_radians();
        let change = self.up() - Vector3::z();
        let axis = |i: usize| Vector3::ith(i, 1.0);
        let turned = |i: usize| self.turned(i);
        let rate = Vector3::from(self.rates_dps.map(f64::to_radians));
        let mut of = [[0.0; PARAMETERS]; 3];
        let mut set = |parameter: usize, turned_deg: f64, moved: Vector3<f64>| {
            let [pitch_deg, roll_deg] = self.tilt(moved);
            // Rate about the vertical: yaw' - sin pitch roll'.
            let yaw_deg = turned_deg + pitch.sin() * roll_deg;
            [yaw_deg, pitch_deg, roll_deg].into_iter().zip(&mut of).for_each(|(value, row)| row[parameter] = value);
        };
        for i in 0..3 {
            set(i, self.rotations[4 * i], turned(i) * self.rates_dps[i]);
            set(21 + i, 0.0, axis(i) * change[i]);
            set(33 + i, 0.0, axis(i) * self.warming_c);
            let lag = rate.cross(&Vector3::z().cross(&axis(i))) * self.filter_s;
            set(36 + i, change[i], (change.cross(&axis(i)) + lag) * 1f64.to_radians());
            for j in 0..3 {
                set(12 + 3 * i + j, self.rotations[9 + 3 * i + j], turned(i) * change[j]);
                if i != j {
                    set(3 + 3 * i + j, self.rotations[3 * i + j], turned(i) * self.rates_dps[j]);
                    set(24 + 3 * i + j, 0.0, axis(i) * change[j]);
                }
            }
        }
        of
    }

    /// Returns the derivative of the yaw by a relative error of the board's clock, degrees: its rotation about the
    /// vertical.
    pub fn rotation_deg(&self) -> f64 {
        Matrix3::from_row_slice(&self.rotations[..9]).trace()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Euler;
    use nalgebra::{Rotation3, UnitQuaternion};

    fn stated() -> Stated {
        let mut rotations = [0.0; ROTATIONS];
        rotations[8] = -70.0;
        Stated { rotations, tilt_deg: [8.0, -15.0], rates_dps: [0.0; 3], warming_c: 0.0, filter_s: 1.0 }
    }

    fn body() -> UnitQuaternion<f64> {
        UnitQuaternion::from_euler_angles((-15f64).to_radians(), 8f64.to_radians(), 1.0)
    }

    #[test]
    fn accelerometer_that_reads_too_much_of_an_axis_leans() {
        let of = stated().sensitivity();
        let up = body().inverse() * Vector3::z();
        for (parameter, error) in [
            (21, Matrix3::from_diagonal(&Vector3::new(1e-4, 0.0, 0.0))),
            (22, Matrix3::from_diagonal(&Vector3::new(0.0, 1e-4, 0.0))),
            (25, Matrix3::new(0.0, 1e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            (31, Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-4, 0.0)),
        ] {
            // What is read, less what is read at rest.
            let seen = up + error * (up - Vector3::z());
            let read = Rotation3::rotation_between(&seen, &up).unwrap();
            let leaning = body() * UnitQuaternion::from_rotation_matrix(&read);
            let (was, is) = (Euler::of(&body()), Euler::of(&leaning));
            assert!((is.pitch_deg - was.pitch_deg - 1e-4 * of[1][parameter]).abs() < 2e-6, "{parameter}: {is:?}");
            assert!((is.roll_deg - was.roll_deg - 1e-4 * of[2][parameter]).abs() < 2e-6, "{parameter}: {is:?}");
        }
    }

    #[test]
    fn mounting_that_is_levelled_at_rest_remains_in_yaw_and_tilt() {
        let of = stated().sensitivity();
        for k in 0..3 {
            let small = 1e-3;
            let mounting = UnitQuaternion::from_scaled_axis(Vector3::ith(k, small));
            let read = |attitude: UnitQuaternion<f64>| attitude * mounting;
            // Levelling adds what makes the rest upright, and the yaw starts at zero there.
            let offset = read(UnitQuaternion::identity()).inverse() * Vector3::z() - Vector3::z();
            let level = |attitude: UnitQuaternion<f64>| {
                let up = attitude.inverse() * Vector3::z();
                let correction = UnitQuaternion::rotation_between(&up, &(up - offset)).unwrap();
                attitude * correction.inverse()
            };
            let (rest, leaning) =
                (Euler::of(&level(read(UnitQuaternion::identity()))), Euler::of(&level(read(body()))));
            let was = Euler::of(&body());
            let wrong = [
                leaning.yaw_deg - rest.yaw_deg - was.yaw_deg,
                leaning.pitch_deg - was.pitch_deg,
                leaning.roll_deg - was.roll_deg,
            ];
            for angle in 0..3 {
                let expected = of[angle][36 + k] * small.to_degrees();
                assert!(
                    (wrong[angle] - expected).abs() < 0.01 * small.to_degrees(),
                    "{k}, {angle}: {} {expected}",
                    wrong[angle]
                );
            }
        }
    }

    /// A robot that turns at half a radian per second, its sensor turned about the body's x by a degree: the lean about x is
    /// removed where it was a second ago.
    #[test]
    fn mounting_does_not_lag_as_an_offset_does() {
        let turning = Stated { tilt_deg: [0.0; 2], rates_dps: [0.0, 0.0, 0.5_f64.to_degrees()], ..stated() };
        let of = turning.sensitivity();
        assert!((of[1][36].abs() - 0.5).abs() < 1e-9 && of[2][36].abs() < 1e-9, "{} {}", of[1][36], of[2][36]);
        assert_eq!((of[1][38], of[2][38]), (0.0, 0.0));
    }

    #[test]
    fn clock_and_scale_are_in_proportion_to_the_rotation() {
        let stated = stated();
        assert_eq!((stated.rotation_deg(), stated.sensitivity()[0][2]), (-70.0, -70.0));
    }
}
