//! Sensitivities of yaw, pitch and roll to errors of the sensor: the derivative with respect to each error, over a
//! trial.
//!
//! One pass over the attitudes integrates them, to first order in the errors. Let u be up in the sensor's axes, z its
//! value at rest (the trial's zero), ω the rate, and τ the time constant with which the board's filter follows gravity.
//!
//! - Gyroscope, yaw: an error δω of the rate turns the estimated attitude by ∫ R δω dt. Gravity corrects the horizontal part;
//!   the vertical part, ∫ u · δω dt, remains. With δω_i = m ω_j it is m ∫ u_i dθ_j, and with δω_i = g (u_j - z_j), the change
//!   of a sensitivity to gravity since rest, g ∫ u_i (u_j - z_j) dt. These integrals include the coning of a wobbling
//!   robot, so they may differ from its yaw.
//! - Gyroscope, tilt: the filter's up turns at u × δω, and returns to the accelerometer's up with τ.
//! - Accelerometer: an error of the force at rest is part of the zero. The filter follows the change with the tilt, S
//!   (u - z) for a matrix S of errors, with τ.
//! - Mounting by a small rotation μ: the rotation about the vertical is wrong by (u - z) · μ, and up by (u - z) × μ.
//!   The lean at rest, z × μ, is removed as an offset of the accelerometer. The filter follows this offset with τ in
//!   the world, while the gyroscope turns the sensor immediately, so up is also wrong by the difference of the two.
//!
//! The quantities that the filter follows are integrated in the world's axes, e' = (a - e)/τ, which is also correct
//! while a turn begins or ends.

use super::over_time::SENSOR_ERRORS;
use crate::attitude::Columns;
use crate::sensor::{PARAMETERS, index};
use nalgebra::{UnitQuaternion, Vector3};
use sim::body::attitude::rotation_between;
use sim::functions::{cos, exp, sin};
use std::ops::Range;

/// Derivatives of yaw, pitch and roll with respect to each of a sensor's errors ([`crate::sensor::Sensor::parameters`])
/// and the board's clock, degrees per unit.
pub(super) type Sensitivity = [[f64; SENSOR_ERRORS]; 3];

const COLUMNS: usize = 3 * SENSOR_ERRORS;

/// Shortest interval between rows, s. One turn of a robot takes 0.7 s or more.
const INTERVAL_S: f64 = 0.05;

/// The derivatives over a trial, and the integrals from which they follow. `[3 i + j]`: for the error of axis i in proportion to
/// j. Leans are changes of up in the world's axes, per unit of an error in SI.
#[derive(Clone, Debug, Default)]
pub(super) struct Sensitivities {
    /// Of yaw, then pitch, then roll, for each error.
    columns: Columns<COLUMNS>,
    /// Time constant of the board's filter, s.
    filter_s: f64,
    /// Rotation from the body's to the sensor's axes.
    mounting: UnitQuaternion<f64>,
    last: Option<(f64, UnitQuaternion<f64>)>,
    /// ∫ u_i dθ_j, degrees.
    turned_deg: [f64; 9],
    /// ∫ u_i (u_j - z_j) dt, s.
    gravity_s: [f64; 9],
    /// Leans due to the gyroscope's rates, its sensitivity to gravity, and the accelerometer.
    leans: [[Vector3<f64>; 9]; 3],
    /// The body's x and y in the world, low-passed like the filter's attitude.
    followed: [Vector3<f64>; 2],
}

impl Sensitivities {
    /// Starts at rest. `mounting`: the known rotation from the body's to the sensor's axes.
    pub fn new(filter_s: f64, mounting: UnitQuaternion<f64>) -> Self {
        Self { filter_s, mounting, ..Self::default() }
    }

    /// Adds an attitude of the body at a time. `warming_c`: warming of the sensor since the zero.
    pub fn push(&mut self, time_s: f64, attitude: UnitQuaternion<f64>, warming_c: f64) {
        match self.last {
            Some((before_s, before)) => self.advance(before, attitude, (time_s - before_s).max(0.0)),
            None => self.followed = [Vector3::x(), Vector3::y()].map(|axis| attitude * axis),
        }
        self.last = Some((time_s, attitude));
        if self.columns.time_s.last().is_none_or(|last| time_s - last >= INTERVAL_S) {
            let row = self.derivatives(attitude, warming_c);
            self.columns.push(time_s, std::array::from_fn(|i| row[i / SENSOR_ERRORS][i % SENSOR_ERRORS]));
        }
    }

    fn advance(&mut self, before: UnitQuaternion<f64>, now: UnitQuaternion<f64>, passed_s: f64) {
        let kept = exp(-passed_s / self.filter_s);
        let at_rest = self.mounting.inverse() * Vector3::z();
        let [before, sensor] = [before, now].map(|attitude| attitude * self.mounting);
        let turned = rotation_between(&before, &sensor);
        let up = 0.5 * (before.inverse() * Vector3::z() + sensor.inverse() * Vector3::z());
        let change = up - at_rest;
        let Self { turned_deg, gravity_s, leans, followed, .. } = self;
        for i in 0..3 {
            let axis = sensor * Vector3::ith(i, 1.0);
            let across = sensor * up.cross(&Vector3::ith(i, 1.0));
            for j in 0..3 {
                turned_deg[3 * i + j] += up[i] * turned[j].to_degrees();
                gravity_s[3 * i + j] += up[i] * change[j] * passed_s;
                let added = [across * turned[j], across * (change[j] * passed_s), axis * (change[j] * (1.0 - kept))];
                for (leans, added) in leans.iter_mut().zip(added) {
                    leans[3 * i + j] = leans[3 * i + j] * kept + added;
                }
            }
        }
        for (followed, axis) in followed.iter_mut().zip([Vector3::x(), Vector3::y()]) {
            *followed = *followed * kept + now * axis * (1.0 - kept);
        }
    }

    /// Returns the derivatives at the last attitude.
    fn derivatives(&self, attitude: UnitQuaternion<f64>, warming_c: f64) -> Sensitivity {
        let to_body = attitude.inverse();
        let up = to_body * Vector3::z();
        let Self { turned_deg, gravity_s, leans, followed, .. } = self;
        let mut of = [[0.0; SENSOR_ERRORS]; 3];
        // `moved`: the change of up in body axes.
        let mut set = |parameter: usize, turned_deg: f64, moved: Vector3<f64>| {
            let [pitch_deg, roll_deg] = tilt(up, moved);
            // Rate about the vertical: yaw' - sin pitch roll', where sin pitch = -u_x.
            let yaw_deg = turned_deg - up.x * roll_deg;
            [yaw_deg, pitch_deg, roll_deg].into_iter().zip(&mut of).for_each(|(value, row)| row[parameter] = value);
        };
        let change = up - Vector3::z();
        for i in 0..3 {
            let axis = Vector3::ith(i, 1.0);
            let lean = |kind: usize, j: usize| to_body * leans[kind][3 * i + j];
            set(index::GYRO_SCALE + i, turned_deg[4 * i], lean(0, i));
            set(index::ACCEL_SCALE + i, 0.0, lean(2, i));
            set(index::ACCEL_DRIFT + i, 0.0, self.mounting * axis * warming_c);
            // The lean at rest, z × μ, minus the part that the filter has followed.
            let lag = match i {
                0 => Vector3::y() - to_body * followed[1],
                1 => to_body * followed[0] - Vector3::x(),
                _ => Vector3::zeros(),
            };
            set(index::MOUNTING + i, change[i], (change.cross(&axis) + lag) * 1f64.to_radians());
            for j in 0..3 {
                set(index::GYRO_G + 3 * i + j, gravity_s[3 * i + j], lean(1, j) * 1f64.to_radians());
                if i != j {
                    set(index::GYRO_CROSS + 3 * i + j, turned_deg[3 * i + j], lean(0, j));
                    set(index::ACCEL_CROSS + 3 * i + j, 0.0, lean(2, j));
                }
            }
        }
        // A fast clock makes all rates too large.
        of.iter_mut().for_each(|row| row[PARAMETERS] = row[..3].iter().sum());
        of
    }

    /// Returns the time range of the trial.
    pub fn span(&self) -> Range<f64> {
        self.columns.span()
    }

    /// Returns the times at which the derivatives are known.
    pub fn times_s(&self) -> &[f64] {
        &self.columns.time_s
    }

    /// Returns the derivatives at one of these times.
    pub fn at(&self, row: usize) -> Sensitivity {
        std::array::from_fn(|angle| std::array::from_fn(|i| self.columns.values[angle * SENSOR_ERRORS + i][row]))
    }

    /// Returns the mean derivatives over a time.
    pub fn mean(&self, over: &Range<f64>) -> Sensitivity {
        let of = |i: usize| self.columns.track(i).mean(over.clone()).unwrap_or_default();
        std::array::from_fn(|angle| std::array::from_fn(|i| of(angle * SENSOR_ERRORS + i)))
    }

    /// Shifts the derivatives of the yaw to be zero at a time.
    #[must_use]
    pub fn with_zero_at(mut self, time_s: f64) -> Self {
        for i in 0..SENSOR_ERRORS {
            let zero = self.columns.track(i).at(time_s).unwrap_or_default();
            self.columns.values[i].iter_mut().for_each(|value| *value -= zero);
        }
        self
    }
}

/// Returns the changes of pitch and roll, degrees, for a small change of up in body axes; up remains a unit vector.
fn tilt(up: Vector3<f64>, moved: Vector3<f64>) -> [f64; 2] {
    let moved = moved - up * up.dot(&moved);
    let across = up.y * up.y + up.z * up.z;
    [-moved.x / across.sqrt(), (up.z * moved.y - up.y * moved.z) / across].map(f64::to_degrees)
}

/// Returns the derivatives of pitch and roll with respect to a change of the bias about each axis since the rest,
/// degrees per °/s, at a mean pitch and roll. `filter_s`: time constant of the board's filter.
pub(super) fn tilts_by_bias(tilt_deg: [f64; 2], filter_s: f64) -> [[f64; 3]; 2] {
    let [pitch, roll] = tilt_deg.map(f64::to_radians);
    let up = Vector3::new(-sin(pitch), cos(pitch) * sin(roll), cos(pitch) * cos(roll));
    let by = [0, 1, 2].map(|i| tilt(up, up.cross(&Vector3::ith(i, 1.0)) * filter_s.to_radians()));
    [0, 1].map(|k| by.map(|tilts| tilts[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::euler_deg;
    use nalgebra::{Matrix3, Rotation3};

    const DT: f64 = 0.005;

    fn z() -> Vector3<f64> {
        Vector3::z()
    }

    /// Returns the derivatives at the end of a motion that begins upright.
    fn at_end(seconds: f64, motion: impl Fn(f64) -> UnitQuaternion<f64>) -> Sensitivity {
        let mut sensitivities = Sensitivities::new(1.0, UnitQuaternion::identity());
        let steps = (seconds / DT).round() as usize;
        (0..=steps).for_each(|i| sensitivities.push(i as f64 * DT, motion(i as f64 * DT), 0.0));
        sensitivities.derivatives(motion(seconds), 0.0)
    }

    /// Leans to a pitch of 8° and a roll of -15° within two seconds, and stays.
    fn leans(time_s: f64) -> UnitQuaternion<f64> {
        let share = (0.5 * time_s).min(1.0);
        UnitQuaternion::from_euler_angles((-15.0 * share).to_radians(), (8.0 * share).to_radians(), 1.0)
    }

    /// Turns by 186° within four seconds and leans a little, as a robot does when its flagella start.
    fn starts(time_s: f64) -> UnitQuaternion<f64> {
        let share = 1.0 - (-time_s / 1.5).exp();
        UnitQuaternion::from_euler_angles(0.03 * share, -0.02 * share, (-186.0 * share).to_radians())
    }

    /// A board whose filter integrates rates and follows an accelerometer, both with errors.
    fn filtered(
        seconds: f64,
        motion: impl Fn(f64) -> UnitQuaternion<f64>,
        gyro: impl Fn(Vector3<f64>, Vector3<f64>) -> Vector3<f64>,
        accel: impl Fn(Vector3<f64>) -> Vector3<f64>,
    ) -> UnitQuaternion<f64> {
        let mut filter = motion(0.0);
        for i in 0..(seconds / DT).round() as usize {
            let (before, now) = (motion(i as f64 * DT), motion((i + 1) as f64 * DT));
            let rate = (before.inverse() * now).scaled_axis() / DT;
            let up = now.inverse() * z();
            filter *= UnitQuaternion::from_scaled_axis((rate + gyro(rate, up)) * DT);
            let correction = (up + accel(up)).normalize().cross(&(filter.inverse() * z()));
            filter *= UnitQuaternion::from_scaled_axis(correction * DT);
        }
        filter
    }

    fn difference_deg(one: UnitQuaternion<f64>, other: UnitQuaternion<f64>) -> [f64; 3] {
        let (one, other) = (euler_deg(&one), euler_deg(&other));
        [0, 1, 2].map(|k| one[k] - other[k])
    }

    #[test]
    fn accelerometer_that_reads_too_much_of_an_axis_leans() {
        let of = at_end(20.0, leans);
        let body = leans(20.0);
        let up = body.inverse() * z();
        for (parameter, error) in [
            (21, Matrix3::from_diagonal(&Vector3::new(1e-4, 0.0, 0.0))),
            (22, Matrix3::from_diagonal(&Vector3::new(0.0, 1e-4, 0.0))),
            (25, Matrix3::new(0.0, 1e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
            (31, Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-4, 0.0)),
        ] {
            // The reading minus the reading at rest.
            let seen = up + error * (up - z());
            let read = UnitQuaternion::from_rotation_matrix(&Rotation3::rotation_between(&seen, &up).unwrap());
            let wrong = difference_deg(body * read, body);
            for angle in 1..3 {
                let expected = 1e-4 * of[angle][parameter];
                assert!((wrong[angle] - expected).abs() < 2e-6, "{parameter}, {angle}: {wrong:?} {expected}");
            }
        }
    }

    #[test]
    fn mounting_that_is_levelled_at_rest_remains_in_yaw_and_tilt() {
        let of = at_end(20.0, leans);
        let (upright, leaning) = (leans(0.0), leans(20.0));
        for k in 0..3 {
            let small = 1e-3;
            let mounting = UnitQuaternion::from_scaled_axis(Vector3::ith(k, small));
            // Levelling makes the attitude at rest upright, with a yaw of zero.
            let offset = (upright * mounting).inverse() * z() - z();
            let level = |attitude: UnitQuaternion<f64>| {
                let up = attitude.inverse() * z();
                attitude * UnitQuaternion::rotation_between(&up, &(up - offset)).unwrap().inverse()
            };
            let rest = difference_deg(level(upright * mounting), upright);
            let wrong = difference_deg(level(leaning * mounting), leaning);
            for angle in 0..3 {
                let (wrong, expected) = (wrong[angle] - rest[angle], of[angle][36 + k] * small.to_degrees());
                assert!((wrong - expected).abs() < 0.01 * small.to_degrees(), "{k}, {angle}: {wrong} {expected}");
            }
        }
    }

    /// In a turn, the lean of a mounting is removed in the direction of a second ago. The error ends with the turn.
    #[test]
    fn lean_of_a_mounting_is_wrong_in_a_turn_alone() {
        for (time_s, largest_deg) in [(1.0, 2.0), (2.0, 2.0), (12.0, 0.003)] {
            let [_, pitch, roll] = at_end(time_s, starts);
            // The body's y after the filter; the mounting about x turns it upwards.
            let mut followed = starts(0.0) * Vector3::y();
            for i in 1..=(time_s / DT).round() as usize {
                followed += (starts(i as f64 * DT) * Vector3::y() - followed) * DT;
            }
            let lean = Vector3::y() - starts(time_s).inverse() * followed;
            let found = pitch[36].hypot(roll[36]);
            assert!((found - lean.norm()).abs() < 0.01, "{time_s} s: {found} {}", lean.norm());
            assert!(found < largest_deg && (time_s > 10.0 || found > 0.5), "{time_s} s: {found}");
        }
    }

    /// With cross-axis errors of the gyroscope the attitude leans while the robot turns, and the accelerometer brings
    /// it back.
    #[test]
    fn errors_of_the_rates_lean_as_the_filter_does() {
        for time_s in [0.5, 2.0, 6.0] {
            let truth = filtered(time_s, starts, |_, _| Vector3::zeros(), |_| Vector3::zeros());
            let of = at_end(time_s, starts);
            for (i, j) in [(0, 2), (1, 2), (2, 0), (2, 1), (0, 1)] {
                let error = |rate: Vector3<f64>, _| Vector3::ith(i, 1e-3 * rate[j]);
                let wrong = difference_deg(filtered(time_s, starts, error, |_| Vector3::zeros()), truth);
                for angle in 0..3 {
                    let expected = 1e-3 * of[angle][3 + 3 * i + j];
                    assert!((wrong[angle] - expected).abs() < 2e-3, "{i}{j}, {time_s} s: {wrong:?} {expected}");
                }
            }
        }
    }

    /// A body that leans by 20° and turns about the vertical, while the direction of its lean rotates (coning).
    #[test]
    fn scale_error_of_a_coning_body_is_that_of_its_rate() {
        let (lean, cone, yaw) = (20_f64.to_radians(), 6.0, 0.1);
        let attitude = |t: f64| {
            let axis = Vector3::new((cone * t).cos(), (cone * t).sin(), 0.0);
            UnitQuaternion::from_scaled_axis(z() * yaw * t) * UnitQuaternion::from_scaled_axis(axis * lean)
        };
        let mut sensitivities = Sensitivities::new(1.0, UnitQuaternion::identity());
        // The integral of a gyroscope whose rate about z is 2 % too large.
        let mut wrong = 0.0;
        for i in 0..=20_000 {
            let t = f64::from(i) * 1e-3;
            sensitivities.push(t, attitude(t), 0.0);
            let rate = (attitude(t).inverse() * attitude(t + 1e-3)).scaled_axis() / 1e-3;
            wrong += 0.02 * (attitude(t).inverse() * z()).z * rate.z * 1e-3;
        }
        let Sensitivities { turned_deg: sums, gravity_s, .. } = &sensitivities;
        let yaw_deg = (yaw * 20.0).to_degrees();
        assert!((0.02 * sums[8] / wrong.to_degrees() - 1.0).abs() < 1e-3, "{} {}", 0.02 * sums[8], wrong.to_degrees());
        assert!((sums[8] / yaw_deg - 1.0).abs() > 1.0, "coning is not yaw: {} {yaw_deg}", sums[8]);
        // The three axes together turn about the vertical by the yaw and the solid angle of the cone.
        let coning_deg = (cone * 20.0 * (1.0 - lean.cos())).to_degrees();
        assert!((sums[0] + sums[4] + sums[8] - yaw_deg - coning_deg).abs() < 1.0, "{sums:?}");
        assert!((gravity_s[8] - 20.0 * lean.cos() * (lean.cos() - 1.0)).abs() < 1e-3);
    }
}
