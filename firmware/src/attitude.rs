//! Attitude by the explicit complementary filter of Mahony, Hamel and Pflimlin, "Nonlinear complementary filters on the
//! special orthogonal group", IEEE Transactions on Automatic Control 53(5), 2008, doi:10.1109/TAC.2008.923738, section V.
//!
//! The quaternion `[w, x, y, z]` takes body to world; the world's z axis points up, and its yaw starts at zero. At rest an
//! accelerometer reads +1 g along the axis that points up; its unit does not matter.
//!
//! The quaternion takes one Euler step per update and is normalised: a rotation by a half-angle h comes out as atan(h),
//! too small by 0.004 % at 250 °/s and 0.25 % at 2000 °/s. It stays within 1e-5 of unit length.

use protocol::units::{Q15, Quaternion};

use crate::{TICK_S, round_to_i16};

/// The filter's state.
#[derive(Debug)]
pub struct Attitude {
    quaternion: [f32; 4],
    /// Integral term: the estimate of the gyroscope's bias, negated, rad/s.
    correction: [f32; 3],
    started: bool,
}

/// Gains of the filter.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Gains {
    /// Proportional gain on the direction of gravity, 1/s.
    pub kp: f32,
    /// Integral gain, 1/s².
    pub ki: f32,
}

impl Default for Attitude {
    fn default() -> Self {
        Self { quaternion: [1.0, 0.0, 0.0, 0.0], correction: [0.0; 3], started: false }
    }
}

impl Attitude {
    /// Advances by `ticks`, in which the body rotated by twice `half_turn` (rad, body axes). The first call, and the first
    /// after [`Attitude::restart`], levels the quaternion by `acceleration` instead. The reading's direction of up counts for
    /// one tick only: in a swing, its error would otherwise count for all `ticks`.
    #[inline(never)]
    pub fn update(&mut self, mut half_turn: [f32; 3], acceleration: [f32; 3], ticks: u8, gains: Gains) {
        let mut up = acceleration;
        let is_up_known = normalise(&mut up);
        if !self.started {
            // Without a direction (free fall, a dead accelerometer) the filter waits.
            if is_up_known {
                self.level(up);
                self.started = true;
            }
            return;
        }
        if is_up_known {
            self.correct(&mut half_turn, up, ticks, gains);
        }
        self.turn(half_turn);
    }

    /// Sets the quaternion to the smallest rotation that takes the unit vector `up`, in body axes, to the world's z axis.
    #[inline(never)]
    fn level(&mut self, [x, y, z]: [f32; 3]) {
        self.quaternion = [1.0 + z, y, -x, 0.0];
        // Upside down, every horizontal axis will do; take x.
        if z < -0.9999 || !normalise(&mut self.quaternion) {
            self.quaternion = [0.0, 1.0, 0.0, 0.0];
        }
    }

    /// Adds to a rotation the correction that moves the estimated direction of gravity towards `up`.
    #[inline(never)]
    fn correct(&mut self, half_turn: &mut [f32; 3], up: [f32; 3], ticks: u8, gains: Gains) {
        let half_error = cross(up, self.half_up());
        let mut half_angle = half_error;
        scale(&mut half_angle, gains.kp * TICK_S);
        add(half_turn, &half_angle);
        if gains.ki != 0.0 {
            let (half, ki) = (0.5 * TICK_S * f32::from(ticks), 2.0 * TICK_S * gains.ki);
            for ((half_angle, correction), half_error) in half_turn.iter_mut().zip(&mut self.correction).zip(half_error)
            {
                *correction += ki * half_error;
                *half_angle += *correction * half;
            }
        }
    }

    /// Rotates by twice these small angles: multiplies by the quaternion `[1, x, y, z]`.
    #[inline(never)]
    fn turn(&mut self, mut half_turn: [f32; 3]) {
        let [w, vector @ ..] = self.quaternion;
        let mut moved = cross(vector, half_turn);
        let scalar = w - dot(&vector, &half_turn);
        scale(&mut half_turn, w);
        add(&mut moved, &half_turn);
        add(&mut moved, &vector);
        let [x, y, z] = moved;
        self.quaternion = [scalar, x, y, z];
        if !normalise(&mut self.quaternion) {
            // Extreme gains and gaps overflow single precision: start again rather than continue without an attitude.
            self.restart();
        }
    }

    /// Resets the filter.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Returns the attitude at the resolution of the wire.
    pub fn quaternion(&self) -> Quaternion {
        Quaternion(self.quaternion.map(|part| Q15(round_to_i16(part, 15))))
    }

    /// Returns half the world's z axis in body axes: the last row of the rotation matrix, halved.
    #[inline(never)]
    fn half_up(&self) -> [f32; 3] {
        let [q0, q1, q2, q3] = self.quaternion;
        [q1 * q3 - q0 * q2, q0 * q1 + q2 * q3, q0 * q0 + q3 * q3 - 0.5]
    }
}

// Slices, so that the compiler does not unroll the loops.

/// Multiplies a vector by a number.
#[inline(never)]
pub fn scale(vector: &mut [f32], factor: f32) {
    for part in vector {
        *part *= factor;
    }
}

/// Adds a vector to another one.
#[inline(never)]
pub fn add(vector: &mut [f32], other: &[f32]) {
    for (part, other) in vector.iter_mut().zip(other) {
        *part += other;
    }
}

/// Replaces half the turn in a gap of the readings by its tangent, which [`Attitude::update`] expects; for small turns the
/// two are equal. To the third order: the error is 0.02 degrees for a turn of 30.
#[inline(never)]
pub fn lengthen(half_turn: &mut [f32; 3]) {
    let factor = 1.0 + dot(half_turn, half_turn) * (1.0 / 3.0);
    scale(half_turn, factor);
}

#[inline(never)]
fn cross([ax, ay, az]: [f32; 3], [bx, by, bz]: [f32; 3]) -> [f32; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

#[inline(never)]
fn dot(vector: &[f32], other: &[f32]) -> f32 {
    let mut sum = 0.0;
    for (part, other) in vector.iter().zip(other) {
        sum += part * other;
    }
    sum
}

/// Normalises `vector`. Returns whether it has a direction and is finite; if not, it is unchanged.
#[inline(never)]
fn normalise(vector: &mut [f32]) -> bool {
    let square = dot(vector, vector);
    // Positive numbers are in the order of their bits, and comparing bits takes a tenth of the time.
    let factor = match square.to_bits() {
        // One Newton step from 1, enough for a quaternion after each rotation.
        bits if (const { 0.995f32.to_bits() }..const { 1.005f32.to_bits() }).contains(&bits) => 1.5 - 0.5 * square,
        bits if (const { 1e-12f32.to_bits() }..const { 1e24f32.to_bits() }).contains(&bits) => inverse_sqrt(square),
        _ => return false,
    };
    self::scale(vector, factor);
    true
}

/// Returns 1/√x to 5 millionths for positive normal x: a guess by halving the exponent, then two Newton steps. On a
/// processor without floating point it costs a third of a square root and a division. Its result is the same on every
/// processor.
#[inline(never)]
pub(crate) fn inverse_sqrt(x: f32) -> f32 {
    let mut root = f32::from_bits(0x5F37_59DF - (x.to_bits() >> 1));
    for _ in 0..2 {
        root *= 1.5 - 0.5 * x * root * root;
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GAINS: Gains = Gains { kp: 1.0, ki: 0.0 };
    const NONE: Gains = Gains { kp: 0.0, ki: 0.0 };
    const DT: f32 = 0.005;
    const DOWN: [f32; 3] = [0.0, 0.0, 16384.0];

    fn started(acceleration: [f32; 3]) -> Attitude {
        let mut attitude = Attitude::default();
        attitude.update([0.0; 3], acceleration, 1, GAINS);
        attitude
    }

    fn estimated_up(attitude: &Attitude) -> [f32; 3] {
        attitude.half_up().map(|part| 2.0 * part)
    }

    #[test]
    fn a_large_turn_is_lengthened_to_its_tangent() {
        for angle in [0.0_f32, 12.7, 30.0].map(f32::to_radians) {
            let mut half_turn = [0.6, 0.0, -0.8].map(|part| part * 0.5 * angle);
            lengthen(&mut half_turn);
            let off = (2.0 * norm(&half_turn).atan() - angle).to_degrees();
            assert!(off.abs() < 0.03, "{off}");
        }
    }

    /// Returns half the rotation of a tick at these rates.
    fn half(rates: [f32; 3]) -> [f32; 3] {
        rates.map(|rate| 0.5 * DT * rate)
    }

    fn norm(vector: &[f32]) -> f32 {
        vector.iter().map(|part| part * part).sum::<f32>().sqrt()
    }

    #[test]
    fn inverse_square_roots_are_exact_to_five_millionths() {
        for exponent in -30..60 {
            for mantissa in 0..50 {
                let x = 1.3f64.powi(exponent) * (1.0 + f64::from(mantissa) / 50.0);
                let relative = f64::from(inverse_sqrt(x as f32)) * f64::from(x as f32).sqrt() - 1.0;
                assert!(relative.abs() < 5e-6, "{relative} at {x}");
            }
        }
    }

    #[test]
    fn the_first_reading_levels_the_body_without_yaw() {
        for up in [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8], [0.3, -0.4, -0.87], [0.0, 0.0, -1.0]] {
            let attitude = started(up.map(|part| part * 16384.0));
            for (have, want) in estimated_up(&attitude).iter().zip(up) {
                assert!((have - want / norm(&up)).abs() < 2e-5, "{:?} for {up:?}", estimated_up(&attitude));
            }
            assert_eq!(attitude.quaternion[3], 0.0);
        }
    }

    #[test]
    fn without_gravity_it_waits_for_a_direction() {
        let mut attitude = started([0.0; 3]);
        attitude.update([1.0, 2.0, 3.0], [0.0; 3], 1, GAINS);
        assert!(!attitude.started);
        attitude.update([0.0; 3], [0.0, 16384.0, 0.0], 1, GAINS);
        assert!((estimated_up(&attitude)[1] - 1.0).abs() < 2e-5);
    }

    #[test]
    fn two_turns_about_the_vertical_are_two_turns() {
        let mut attitude = started(DOWN);
        let rate = 200.0f32.to_radians();
        let (mut yaw, mut last) = (0.0f64, 0.0f64);
        for _ in 0..720 {
            attitude.update(half([0.0, 0.0, rate]), DOWN, 1, GAINS);
            let [q0, .., q3] = attitude.quaternion.map(f64::from);
            let now = 2.0 * q3.atan2(q0);
            let step = now - last;
            yaw += step - (step / std::f64::consts::TAU).round() * std::f64::consts::TAU;
            last = now;
        }
        assert!((yaw.to_degrees() - 720.0).abs() < 0.05, "{}", yaw.to_degrees());
    }

    #[test]
    fn gravity_pulls_a_tilt_back_at_the_gain() {
        let mut attitude = started([0.0, 0.5, 0.866_025_4]);
        for _ in 0..200 {
            attitude.update([0.0; 3], DOWN, 1, GAINS);
        }
        // After one second at 1/s, 30° have become about 30°/e.
        let tilt = estimated_up(&attitude)[2].acos().to_degrees();
        assert!((tilt - 30.0 / std::f32::consts::E).abs() < 0.5, "{tilt}");
    }

    #[test]
    fn the_integral_finds_a_bias_of_the_horizontal_rates() {
        let mut attitude = started(DOWN);
        for _ in 0..200 * 60 {
            attitude.update(half([0.02, -0.01, 0.0]), DOWN, 1, Gains { kp: 1.0, ki: 0.3 });
        }
        assert!((attitude.correction[0] + 0.02).abs() < 1e-4 && (attitude.correction[1] - 0.01).abs() < 1e-4);
        assert!(estimated_up(&attitude)[2] > 0.9999);
    }

    #[test]
    fn the_integral_grows_by_its_gain_times_the_tilt() {
        let mut attitude = started(DOWN);
        // 30° about x, for 0.1 s.
        for _ in 0..20 {
            attitude.update([0.0; 3], [0.0, 8192.0, 14_189.0], 1, Gains { kp: 0.0, ki: 0.3 });
        }
        let [x, y, z] = attitude.correction;
        assert!((x - 0.3 * 0.1 * 0.5).abs() < 1e-4 && y == 0.0 && z == 0.0, "{:?}", attitude.correction);
        // The tilt follows from the integral alone: 0.3/s² * 0.5 over 0.1 s.
        let tilt = estimated_up(&attitude)[1];
        assert!((tilt - 0.5 * 0.3 * 0.5 * 0.1 * 0.1).abs() < 1e-4, "{tilt}");
    }

    /// The estimated bias counts for the whole time, the direction of gravity for one tick.
    #[test]
    fn a_longer_time_is_no_longer_look_at_gravity() {
        let mut attitude = started([0.0, 8192.0, 14_189.0]);
        attitude.correction = [0.0, 0.0, 0.1];
        attitude.update([0.0; 3], DOWN, 20, Gains { kp: 1.0, ki: 1e-9 });
        let tilt = estimated_up(&attitude)[2].acos().to_degrees();
        assert!((30.0 - tilt - 0.005 * 0.5f32.to_degrees()).abs() < 0.01, "{tilt}");
        let yaw = 2.0 * attitude.quaternion[3].to_degrees();
        assert!((yaw - (0.1f32 * 0.1).to_degrees() * 0.866).abs() < 0.1, "{yaw}");
    }

    #[test]
    fn up_stays_up_in_a_tilted_body_that_turns_about_the_vertical() {
        let up = [0.48, -0.6, 0.64];
        let mut attitude = started(up.map(|part| part * 16384.0));
        for _ in 0..400 {
            attitude.update(half(up), [0.0; 3], 1, NONE);
            for (have, want) in estimated_up(&attitude).iter().zip(up) {
                assert!((have - want).abs() < 5e-5, "{:?}", estimated_up(&attitude));
            }
        }
        assert!(attitude.quaternion[3] > 0.6, "it has turned by 2 rad");
    }

    #[test]
    fn a_turn_keeps_the_quaternions_length_to_the_digits_of_a_number() {
        let mut attitude = started(DOWN);
        for _ in 0..1000 {
            attitude.update(half([0.5, -2.0, 3.0]), [0.0; 3], 1, NONE);
            let length = attitude.quaternion.iter().map(|part| f64::from(*part).powi(2)).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() < 3e-7, "{length}");
        }
    }

    #[test]
    fn an_attitude_survives_the_wire_to_its_resolution() {
        let attitude = started([0.0, 16384.0, 0.0]);
        let [w, x, y, z] = attitude.quaternion().to_f64();
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert!((w - half).abs() < 5e-5 && (x - half).abs() < 5e-5 && y == 0.0 && z == 0.0);
        assert_eq!(started(DOWN).quaternion(), Quaternion::IDENTITY);
    }

    proptest! {
        /// Saturated rates, no gravity, gaps, absurd gains: always a unit quaternion.
        #[test]
        fn it_never_leaves_the_unit_sphere(
            steps in prop::collection::vec(
                (prop::array::uniform3(-35.0f32..35.0), prop::array::uniform3(-32768i16..=32767), 0u8..4),
                1..60,
            ),
            kp in 0.0f32..1000.0,
            ki in 0.0f32..1000.0,
        ) {
            let mut attitude = Attitude::default();
            for (rates, acceleration, kind) in steps {
                let acceleration = if kind == 0 { [0.0; 3] } else { acceleration.map(f32::from) };
                let ticks = if kind == 1 { 255 } else { 1 };
                let half_turn = rates.map(|rate| 0.5 * DT * f32::from(ticks) * rate);
                attitude.update(half_turn, acceleration, ticks, Gains { kp, ki });
                prop_assert!((norm(&attitude.quaternion) - 1.0).abs() < 1e-5);
            }
        }

        #[test]
        fn rates_alone_turn_about_their_axis(axis in prop::array::uniform3(-1.0f32..1.0), angle in 0.01f32..3.0) {
            prop_assume!(norm(&axis) > 0.1);
            let axis = axis.map(|part| part / norm(&axis));
            let mut attitude = Attitude { started: true, ..Attitude::default() };
            for _ in 0..400 {
                attitude.update(half(axis.map(|part| part * angle / 2.0)), [0.0; 3], 1, NONE);
            }
            let [w, x, y, z] = attitude.quaternion;
            prop_assert!((w - (angle / 2.0).cos()).abs() < 3e-5);
            for (part, axis) in [x, y, z].into_iter().zip(axis) {
                prop_assert!((part - axis * (angle / 2.0).sin()).abs() < 3e-5);
            }
        }
    }
}
