//! Levelling: measures the tilt of the attitude due to the accelerometer's bias at rest, and removes it.
//!
//! A bias of 20 mg of the accelerometer tilts the attitude by a degree. The robot hangs upright at rest, so the
//! difference between the accelerometer's vertical and the robot's axis is the bias, which is constant in body axes.
//! The attitude is corrected about a horizontal axis, because the accelerometer affects only the tilt: yaw comes from
//! the gyroscope alone.
//!
//! The filter follows the accelerometer with a time constant of 1/kp, and the gyroscope without delay: while the robot
//! turns, the filter's tilt shows the bias in world axes as it was about a second ago. Therefore the bias passes
//! through the same low-pass.
//!
//! The filter corrects its tilt about horizontal axes. A rotation about x, then y, then back about both also turns
//! about the vertical, by the area that the tilt encloses. So the filter's yaw is off by half the integral of c × dc,
//! where c is the levelling rotation and dc its increments in the filter: 0.5° for a bias of 70 mg and a turn of 186°.

use nalgebra::{UnitQuaternion, Vector3};
use sim::body::attitude::{aligning, of_vector, vector_of};
use sim::functions::{asin, atan2, exp};
use std::collections::VecDeque;

/// Largest tilt due to a bias. A larger tilt means that the mounting is wrong in the settings, or the robot not
/// upright.
pub(crate) const LARGEST_TILT_DEG: f64 = 10.0;

/// Largest error of gravity that an offset of the accelerometer explains. Boards as sold read 0.6 g to 1.4 g at rest, though the
/// data sheet of the MPU6050 has 0.08 g (PS-MPU-6000A, section 6.2). A wrong range halves or doubles the force.
pub const LARGEST_OFFSET_G: f64 = 0.5;

/// The vertical measured by the accelerometer of a robot at rest.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Level {
    /// Direction of up, a unit vector in body axes.
    pub up: Vector3<f64>,
    /// Magnitude of the mean specific force, in units of standard gravity.
    pub force_g: f64,
}

impl Level {
    /// Returns the vertical by a mean specific force, body axes; `None` if it is zero.
    pub fn of(force: Vector3<f64>, standard_gravity: f64) -> Option<Self> {
        Some(Self { up: force.try_normalize(0.0)?, force_g: force.norm() / standard_gravity })
    }

    /// Returns the angle between the accelerometer's vertical and the robot's axis, degrees.
    pub fn tilt_deg(&self) -> f64 {
        atan2(self.up.xy().norm(), self.up.z).to_degrees()
    }

    /// Returns whether the tilt is small enough to be a bias.
    pub fn is_bias(&self) -> bool {
        self.tilt_deg() <= LARGEST_TILT_DEG
    }

    /// Returns pitch and roll that the bias adds to the attitude at rest, degrees.
    pub fn angles_deg(&self) -> [f64; 2] {
        let [x, y, z] = self.up.into();
        [-asin(x.clamp(-1.0, 1.0)).to_degrees(), atan2(y, z).to_degrees()]
    }

    /// Returns the bias of the accelerometer, g, body axes.
    fn bias_g(&self) -> Vector3<f64> {
        let is_gravity = (self.force_g - 1.0).abs() < LARGEST_OFFSET_G;
        self.up * if is_gravity { self.force_g } else { 1.0 } - Vector3::z()
    }

    /// Removes the bias from an attitude at rest, body to world.
    pub fn levelled(&self, attitude: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        correction(attitude, self.bias_g()) * attitude
    }

    /// Returns the level measured by a sensor with axes turned by a rotation.
    #[must_use]
    pub fn turned(&self, by: UnitQuaternion<f64>) -> Self {
        Self { up: by * self.up, ..*self }
    }
}

/// Returns the rotation, about a horizontal axis of the world, that removes the tilt due to a bias of the accelerometer (g,
/// body axes) from an attitude, body to world.
///
/// The measured up is the direction of the sum of true up, of length 1 g, and the bias; true up is where the line in
/// that direction, shifted by the bias, meets the unit sphere.
fn correction(attitude: UnitQuaternion<f64>, bias: Vector3<f64>) -> UnitQuaternion<f64> {
    let seen = attitude.inverse() * Vector3::z();
    let along = seen.dot(&bias);
    let length = along + (along * along - bias.norm_squared() + 1.0).max(0.0).sqrt();
    let up = attitude * (seen * length - bias);
    aligning(up, Vector3::z()).unwrap_or_default()
}

/// Levels the attitudes of a moving robot in order of time.
#[derive(Clone, Debug)]
pub struct Leveller {
    bias: Vector3<f64>,
    /// Proportional gain of the board's filter, 1/s.
    gain: f64,
    /// Time, s, and the bias after the filter's low-pass, world axes; `None` before the first attitude.
    filtered_bias: Option<(f64, Vector3<f64>)>,
    /// The last correction, rad, and the area enclosed by the corrections so far, rad².
    last: Option<Vector3<f64>>,
    area: f64,
}

impl Leveller {
    /// Creates a leveller. `gain` is the proportional gain of the board's attitude filter, 1/s.
    pub fn new(level: &Level, gain: f64) -> Self {
        Self { bias: level.bias_g(), gain, filtered_bias: None, last: None, area: 0.0 }
    }

    /// Removes the bias from the attitude at a time, body to world.
    pub fn levelled(&mut self, attitude: UnitQuaternion<f64>, time_s: f64) -> UnitQuaternion<f64> {
        let now = attitude * self.bias;
        let bias = match self.filtered_bias {
            Some((before_s, bias)) => bias + (now - bias) * (1.0 - exp(-self.gain * (time_s - before_s).max(0.0))),
            None => now,
        };
        self.filtered_bias = Some((time_s, bias));
        let correction = correction(attitude, attitude.inverse() * bias);
        let moved = vector_of(&correction);
        self.area += self.last.replace(moved).map_or(0.0, |last| 0.5 * last.cross(&moved).z);
        of_vector(Vector3::z() * self.area) * correction * attitude
    }
}

/// The specific force of the last seconds at rest.
#[derive(Clone, Debug)]
pub struct RestForce {
    /// Specific forces, m/s², body axes, the latest first.
    forces: VecDeque<Vector3<f64>>,
    most: usize,
}

/// Averaging time of the force, s.
const REST_S: usize = 5;

impl RestForce {
    /// Creates an empty average for readings at `rate_hz`.
    pub fn new(rate_hz: u8) -> Self {
        Self { forces: VecDeque::new(), most: REST_S * usize::from(rate_hz) }
    }

    /// Adds a specific force, m/s², body axes.
    pub fn push(&mut self, force: [f64; 3]) {
        self.forces.truncate(self.most - 1);
        self.forces.push_front(Vector3::from(force));
    }

    /// Discards all readings, because the robot moved.
    pub fn clear(&mut self) {
        self.forces.clear();
    }

    /// Returns the vertical; `None` if the time at rest was shorter than a second.
    pub fn level(&self, standard_gravity_mps2: f64) -> Option<Level> {
        if self.forces.len() < self.most / REST_S {
            return None;
        }
        Level::of(self.forces.iter().sum::<Vector3<f64>>() / self.forces.len() as f64, standard_gravity_mps2)
    }
}

#[cfg(test)]
mod tests {
    use super::super::euler_deg;
    use super::*;

    const DT: f64 = 0.005;

    /// A board whose filter integrates the rotation and follows an accelerometer with a bias.
    struct Board {
        truth: UnitQuaternion<f64>,
        filter: UnitQuaternion<f64>,
        bias: Vector3<f64>,
    }

    impl Board {
        /// Rotates by a rotation vector in body axes; returns the filter's attitude and the specific force in g.
        fn turn(&mut self, turn: Vector3<f64>) -> (UnitQuaternion<f64>, [f64; 3]) {
            let turn = UnitQuaternion::from_scaled_axis(turn);
            (self.truth, self.filter) = (self.truth * turn, self.filter * turn);
            let force = self.truth.inverse() * Vector3::z() + self.bias;
            let correction = force.normalize().cross(&(self.filter.inverse() * Vector3::z())) * DT;
            self.filter *= UnitQuaternion::from_scaled_axis(correction);
            (self.filter, force.into())
        }
    }

    #[test]
    fn bias_is_removed_at_rest_and_in_motion() {
        // Offsets within the data sheet, and one of a board that reads 1.3 g at rest. The latter tilts the filter's world while
        // the robot tilts.
        is_removed(Vector3::new(0.03, -0.02, 0.01), 0.05);
        is_removed(Vector3::new(0.02, -0.01, 0.30), 0.3);
    }

    fn is_removed(bias: Vector3<f64>, in_motion_deg: f64) {
        let still = UnitQuaternion::identity();
        let mut board = Board { truth: still, filter: still, bias };
        let mut rest = RestForce::new(200);
        assert_eq!(rest.level(1.0), None, "no readings yet");
        let mut attitude = still;
        for _ in 0..2000 {
            let (filtered, force) = board.turn(Vector3::zeros());
            rest.push(force);
            attitude = filtered;
        }
        let leans_deg = (bias / (1.0 + bias.z)).xy().map(|lean| lean.atan().to_degrees());
        assert!((euler_deg(&attitude)[1] + leans_deg.x).abs() < 0.02, "{attitude:?}");
        let level = rest.level(1.0).unwrap();
        assert!(level.is_bias() && (level.tilt_deg() - leans_deg.norm()).abs() < 0.02, "{level:?}");
        let upright = euler_deg(&level.levelled(attitude));
        assert!(upright[1].abs() < 0.01 && upright[2].abs() < 0.01, "{upright:?}");

        let mut leveller = Leveller::new(&level, 1.0);
        let (mut worst, mut last) = (0f64, upright);
        // It pitches by 16°, turns by 120° about the vertical, and rests until the filter has settled.
        for i in 0..6000 {
            let rate = |from, to| if (from..to).contains(&i) { 1.0 / f64::from(to - from) } else { 0.0 };
            let vertical = board.truth.inverse() * Vector3::z() * (120_f64.to_radians() * rate(1000, 3000));
            let (filtered, _) = board.turn(Vector3::y() * (16_f64.to_radians() * rate(0, 1000)) + vertical);
            last = euler_deg(&leveller.levelled(filtered, f64::from(i) * DT));
            let truth = euler_deg(&board.truth);
            worst = worst.max((last[1] - truth[1]).abs()).max((last[2] - truth[2]).abs());
        }
        assert!(worst < in_motion_deg, "in motion: {worst}");
        assert!((last[1] - 16.0).abs() < 0.01 && last[2].abs() < 0.01, "{last:?}");
        assert!((last[0] - 120.0).abs() < 0.1, "{last:?}");
        rest.clear();
        assert_eq!(rest.level(1.0), None, "the robot moved");
    }

    /// The filter's correction describes a loop as the robot turns by 186°, as fast as a robot turns when its flagella
    /// start.
    #[test]
    fn tilt_of_a_bias_that_goes_round_is_no_yaw() {
        for bias in [Vector3::new(0.05, 0.05, 0.08), Vector3::new(-0.05, 0.05, -0.08), Vector3::new(0.05, 0.0, 0.0)] {
            let still = UnitQuaternion::identity();
            let mut board = Board { truth: still, filter: still, bias };
            let mut rest = RestForce::new(200);
            for _ in 0..4000 {
                let (_, force) = board.turn(Vector3::zeros());
                rest.push(force);
            }
            let level = rest.level(1.0).unwrap();
            let mut leveller = Leveller::new(&level, 1.0);
            let [zero, ..] = euler_deg(&level.levelled(board.filter));
            let mut last = 0.0;
            for i in 0..6000 {
                let rate = |t: f64| 186_f64.to_radians() * (-t / 1.5).exp() / 1.5;
                let (filtered, _) = board.turn(-Vector3::z() * rate(f64::from(i) * DT) * DT);
                [last, ..] = euler_deg(&leveller.levelled(filtered, f64::from(i) * DT));
            }
            let turned = last - zero - euler_deg(&board.truth)[0];
            let wrong = turned - 360.0 * (turned / 360.0).round();
            println!("{bias:?}: {wrong:.3} degrees");
            assert!(wrong.abs() < 0.03, "{bias:?}: {wrong} degrees");
        }
    }

    #[test]
    fn large_tilt_is_not_a_bias() {
        for force in [[1.0, 0.0, 0.02], [0.0, 0.0, -1.0]] {
            let mut rest = RestForce::new(200);
            (0..1000).for_each(|_| rest.push(force));
            let level = rest.level(1.0).unwrap();
            assert!(!level.is_bias() && level.tilt_deg() > 80.0, "{level:?}");
        }
    }
}
