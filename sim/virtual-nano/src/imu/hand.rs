//! The sensor in a person's hand: it lies still, z up, until it is turned or posed.
//!
//! An attitude rotates vectors from body axes to world axes, z up. A movement leads from one nominal attitude to the next
//! along one rotation, with the minimum-jerk speed profile, as people move (Flash and Hogan 1985, doi
//! 10.1523/JNEUROSCI.05-07-01688.1985). Two human errors are added and can be set: the hand sways on its way, and it stops
//! beside the mark. Stops err about the nominal attitude, so their errors do not add up. The sensor turns about its own
//! centre and feels no centripetal force.

use super::noise::Noise;
use super::part::ROOM_C;
use crate::plant::Movement;
use nalgebra::{Unit, UnitQuaternion, Vector3};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};
use std::str::FromStr;

/// Frequency of the sway, Hz: slow corrections, not tremor.
const SWAY_HZ: f64 = 0.7;

/// Half the interval of the difference quotient for the rate, s.
const DIFFERENCE_S: f64 = 0.5e-3;

/// Errors of the hand.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Grip {
    /// Standard deviation of the attitude after a movement about each body axis, °.
    pub stop_deg: f64,
    /// Amplitude of the sway about each body axis in the middle of a movement, °.
    pub sway_deg: f64,
}

impl Default for Grip {
    /// Assumed: a box with the board, turned on a table to a line drawn on it.
    fn default() -> Self {
        Self { stop_deg: 0.5, sway_deg: 0.5 }
    }
}

impl Grip {
    /// A hand without errors.
    pub const EXACT: Self = Self { stop_deg: 0.0, sway_deg: 0.0 };
}

/// A nominal attitude to pose the sensor in.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Pose {
    /// The body axis that points up; the sensor gets there by the shortest rotation.
    Up(Vector3<f64>),
    /// The whole attitude.
    Attitude(UnitQuaternion<f64>),
}

impl FromStr for Pose {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let problem = || format!("{text:?} is no pose: give the axis that is up, such as +x, or a quaternion W,X,Y,Z");
        if let Some((sign, axis)) = text.split_at_checked(1).filter(|(sign, _)| matches!(*sign, "+" | "-"))
            && let Ok(axis) = parse_axis(axis)
        {
            return Ok(Self::Up(*axis * if sign == "-" { -1.0 } else { 1.0 }));
        }
        let parts: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>().map_err(|_| problem())?;
        let [w, x, y, z] = parts[..] else { return Err(problem()) };
        let quaternion = nalgebra::Quaternion::new(w, x, y, z);
        UnitQuaternion::try_new(quaternion, 1e-6)
            .filter(|unit| unit.w.is_finite())
            .map(Self::Attitude)
            .ok_or_else(problem)
    }
}

/// Returns the body axis of the name `x`, `y` or `z`.
///
/// # Errors
/// Any other name.
pub fn parse_axis(name: &str) -> Result<Unit<Vector3<f64>>, String> {
    match name {
        "x" => Ok(Vector3::x_axis()),
        "y" => Ok(Vector3::y_axis()),
        "z" => Ok(Vector3::z_axis()),
        _ => Err(format!("{name:?} is no axis: give x, y or z")),
    }
}

/// A movement that is under way or waits.
#[derive(Clone, Debug)]
struct Step {
    begin_s: f64,
    end_s: f64,
    /// The nominal attitude at its begin.
    from: UnitQuaternion<f64>,
    /// The nominal rotation, about an axis of the body; more than half a turn is allowed.
    turn: Vector3<f64>,
    /// Errors of the attitude at its begin and end: rotation vectors in body axes, rad.
    off: [Vector3<f64>; 2],
    sway_rad: f64,
    /// Phases of the sway about the body axes, rad.
    phases: Vector3<f64>,
}

impl Step {
    fn attitude(&self, time_s: f64) -> UnitQuaternion<f64> {
        let length_s = self.end_s - self.begin_s;
        let u = ((time_s - self.begin_s) / length_s).clamp(0.0, 1.0);
        let share = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let envelope = self.sway_rad * (PI * u).sin().powi(2);
        let sway = self.phases.map(|phase| envelope * (TAU * SWAY_HZ * length_s * u + phase).sin());
        let off = self.off[0] * (1.0 - share) + self.off[1] * share + sway;
        self.from * UnitQuaternion::from_scaled_axis(self.turn * share) * UnitQuaternion::from_scaled_axis(off)
    }
}

/// The start and end of a movement.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Span {
    /// The board's time at its begin, s.
    pub begin_s: f64,
    /// The board's time at its end, s.
    pub end_s: f64,
    /// Error of the stop about the nominal attitude: rotation vector in body axes, °.
    pub off_deg: [f64; 3],
}

/// The hand.
#[derive(Clone, Debug)]
pub struct Hand {
    /// The errors of later movements.
    pub grip: Grip,
    /// The hand's own random numbers, so that a movement does not change the sensor's noise.
    noise: Noise,
    /// The nominal attitude after the last movement.
    nominal: UnitQuaternion<f64>,
    /// The error of that attitude.
    off: Vector3<f64>,
    /// In the order of time, including the last one that has ended.
    steps: VecDeque<Step>,
}

impl Hand {
    /// Returns a hand that holds the sensor still, z up. The seed gives its errors.
    pub fn new(grip: Grip, seed: u64) -> Self {
        let (nominal, off) = (UnitQuaternion::identity(), Vector3::zeros());
        Self { grip, noise: Noise::new(seed ^ 0x4841_4E44), nominal, off, steps: VecDeque::new() }
    }

    /// Turns the sensor about one of its body axes by an angle within a time, at the board's time `now_s` or after
    /// earlier movements.
    pub fn turn(&mut self, now_s: f64, axis: Unit<Vector3<f64>>, angle_deg: f64, length_s: f64) -> Span {
        self.go(now_s, *axis * angle_deg.to_radians(), length_s)
    }

    /// Brings the sensor into a pose, by the shortest rotation.
    pub fn pose(&mut self, now_s: f64, pose: Pose, length_s: f64) -> Span {
        let turn = match pose {
            Pose::Attitude(attitude) => (self.nominal.inverse() * attitude).scaled_axis(),
            Pose::Up(axis) => {
                let up = self.nominal.inverse_transform_vector(&Vector3::z());
                // In body axes `up` is to become `axis`, so the body turns the other way.
                let upset = || UnitQuaternion::from_axis_angle(&perpendicular(&axis), PI);
                UnitQuaternion::rotation_between(&axis, &up).unwrap_or_else(upset).scaled_axis()
            }
        };
        self.go(now_s, turn, length_s)
    }

    fn go(&mut self, now_s: f64, turn: Vector3<f64>, length_s: f64) -> Span {
        let before_s = self.steps.back().map_or(0.0, |step| step.end_s);
        let begin_s = now_s.max(before_s);
        let end_s = begin_s + length_s;
        let mut three = |draw: fn(&mut Noise) -> f64| Vector3::from_fn(|_, _| draw(&mut self.noise));
        let off = three(Noise::normal) * self.grip.stop_deg.to_radians();
        let phases = three(Noise::uniform) * TAU;
        let off_before = std::mem::replace(&mut self.off, off);
        let sway_rad = self.grip.sway_deg.to_radians();
        let from = self.nominal;
        self.steps.push_back(Step { begin_s, end_s, from, turn, off: [off_before, off], sway_rad, phases });
        self.nominal *= UnitQuaternion::from_scaled_axis(turn);
        self.nominal.renormalize();
        Span { begin_s, end_s, off_deg: off.map(f64::to_degrees).into() }
    }

    /// Returns whether a movement is under way or waits at a time.
    pub fn is_moving(&self, time_s: f64) -> bool {
        self.steps.back().is_some_and(|step| time_s < step.end_s)
    }

    /// Returns the attitude at a time. [`Self::movement`] drops the movements before the last one that has ended.
    pub fn attitude(&self, time_s: f64) -> UnitQuaternion<f64> {
        let begun = self.steps.iter().rev().find(|step| step.begin_s <= time_s);
        begun.or(self.steps.front()).map_or(self.nominal, |step| step.attitude(time_s))
    }

    /// Returns the sensor's movement at a time. Times must not decrease.
    pub fn movement(&mut self, time_s: f64) -> Movement {
        while self.steps.get(1).is_some_and(|next| next.end_s < time_s) {
            self.steps.pop_front();
        }
        let [before, after] = [-DIFFERENCE_S, DIFFERENCE_S].map(|shift_s| self.attitude(time_s + shift_s));
        let rate = (before.inverse() * after).scaled_axis() / (2.0 * DIFFERENCE_S);
        let up = self.attitude(time_s).inverse_transform_vector(&Vector3::z());
        Movement { rate_dps: rate.map(f64::to_degrees).into(), specific_force_g: up.into(), temperature_c: ROOM_C }
    }
}

fn perpendicular(axis: &Vector3<f64>) -> Unit<Vector3<f64>> {
    let other = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    Unit::new_normalize(axis.cross(&other))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Integrates the rates over a span. Returns the attitude that follows.
    fn follow(hand: &mut Hand, start: UnitQuaternion<f64>, span: Span) -> UnitQuaternion<f64> {
        const STEP_S: f64 = 1e-3;
        let steps = ((span.end_s - span.begin_s) / STEP_S).round() as usize;
        (0..steps).fold(start, |attitude, i| {
            let rate = hand.movement(span.begin_s + (i as f64 + 0.5) * STEP_S).rate_dps;
            attitude * UnitQuaternion::from_scaled_axis(Vector3::from(rate).map(f64::to_radians) * STEP_S)
        })
    }

    #[test]
    fn the_rates_lead_to_the_attitude_that_the_hand_has() {
        for grip in [Grip::EXACT, Grip::default()] {
            let mut hand = Hand::new(grip, 7);
            let mut attitude = hand.attitude(0.0);
            let tilted: Pose = "0.5,-0.1,0.7,0.2".parse().unwrap();
            let mut turned = 0.0;
            let spans = [
                hand.turn(1.0, Vector3::z_axis(), 723.5, 9.3),
                hand.pose(1.0, tilted, 2.5),
                hand.turn(1.0, Vector3::y_axis(), -361.0, 7.0),
            ];
            assert_eq!((spans[0].begin_s, spans[1].begin_s, spans[2].end_s), (1.0, 10.3, 19.8));
            for (i, span) in spans.into_iter().enumerate() {
                if i == 0 {
                    // Also with sway, the rate about the axis adds up to the whole turn, except for the sway's coning.
                    let mut other = hand.clone();
                    turned =
                        (0..9300).map(|ms| other.movement(1.0 + (f64::from(ms) + 0.5) * 1e-3).rate_dps[2] * 1e-3).sum();
                }
                attitude = follow(&mut hand, attitude, span);
                let off = attitude.angle_to(&hand.attitude(span.end_s)).to_degrees();
                assert!(off < 1e-3, "{grip:?}, movement {i}: {off} deg");
                assert!(hand.movement(span.end_s).rate_dps.iter().all(|dps| dps.abs() < 0.01), "does not stop");
            }
            let expected = 723.5 + spans[0].off_deg[2];
            assert!((turned - expected).abs() < if grip == Grip::EXACT { 1e-3 } else { 1.5 }, "{turned} of {expected}");
            assert!(!hand.is_moving(19.8) && hand.is_moving(19.7));
        }
    }

    #[test]
    fn every_axis_can_point_up_from_every_other() {
        let mut hand = Hand::new(Grip::EXACT, 1);
        let mut now_s = 0.0;
        for name in ["-z", "+x", "-x", "+y", "+z", "-y", "+y", "-z", "-z"] {
            let Pose::Up(axis) = name.parse().unwrap() else { panic!("{name}") };
            let span = hand.pose(now_s, Pose::Up(axis), 1.5);
            let force = Vector3::from(hand.movement(span.end_s + 0.01).specific_force_g);
            assert!((force - axis).norm() < 1e-9, "{name}: {force}");
            now_s = span.end_s + 3.0;
        }
    }

    #[test]
    fn stops_err_about_the_mark_by_what_the_grip_says() {
        let mut hand = Hand::new(Grip { stop_deg: 0.8, sway_deg: 3.0 }, 11);
        let mut squares = 0.0;
        for i in 0..400 {
            let span = hand.turn(0.0, Vector3::x_axis(), 90.0, 1.0);
            let nominal = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), f64::from(i + 1).to_radians() * 90.0);
            let real = hand.attitude(span.end_s);
            let off = (nominal.inverse() * real).scaled_axis().map(f64::to_degrees);
            assert!((off - Vector3::from(span.off_deg)).norm() < 1e-6, "{i}");
            squares += off.norm_squared();
        }
        let deviation = (squares / 1200.0).sqrt();
        assert!((deviation - 0.8).abs() < 0.08, "{deviation}");
    }

    #[test]
    fn a_pose_is_an_axis_or_a_quaternion() {
        for wrong in ["", "x", "+w", "+", "é", "1,2,3", "0,0,0,0", "nan,1,0,0", "inf,1,0,0", "1,0,0,0,0", "1,0,,0"] {
            assert!(wrong.parse::<Pose>().is_err(), "{wrong}");
        }
    }
}
