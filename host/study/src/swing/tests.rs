//! Labels of motions that the model computes, with the errors of an instrument.

mod shares;

use super::*;
use crate::attitude::Columns;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::f64::consts::TAU;
use std::ops::Range;

pub(crate) const RATE_HZ: f64 = 20.0;
const SETTLING_S: f64 = 15.0;

/// Flagella of two turns with few edges, whose motion takes little time to compute.
pub(crate) fn quick() -> Robot {
    let mut robot = Robot::default();
    robot.flagellum.axial_length_m = 0.152;
    robot.flagellum.edge_length_m = 0.0075;
    robot
}

pub(crate) struct Truth {
    pub rpm: [f64; 2],
    /// Yaw, pitch and roll, °.
    pub angles_deg: [Vec<f64>; 3],
}

impl Truth {
    pub fn of(robot: &Robot, rpm: [f64; 2], until_s: f64, stops_s: f64) -> Self {
        let still = [0.0; 2];
        let profile =
            [(0.0, still), (0.5, rpm), (stops_s, rpm), (stops_s + 0.5, still), (until_s.max(stops_s + 1.0), still)];
        Self::by(robot, rpm, SpeedProfile::from_points(&profile).unwrap())
    }

    pub fn by(robot: &Robot, rpm: [f64; 2], profile: SpeedProfile) -> Self {
        let mut angles_deg: [Vec<f64>; 3] = Default::default();
        let trial = Trial::new(robot, Closure::Full, profile, Options { rate_hz: RATE_HZ, shapes: false }).unwrap();
        for sample in trial.map(Result::unwrap) {
            let angles = [sample.yaw_rad, sample.pitch_rad, sample.roll_rad];
            angles_deg.iter_mut().zip(angles).for_each(|(column, value)| column.push(value.to_degrees()));
        }
        Self { rpm, angles_deg }
    }
}

/// The instrument of a motion.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Way {
    Recorded,
    /// The speeds wander by 1 %, as with a battery that runs down.
    Wandering,
    /// A gear of 100.37:1 shakes the board once a turn of its motor, which 200 Hz fold to 44.4 rpm.
    Shaken,
    /// Angles with this noise, °, and speeds known within 2 %.
    Imported(f64),
}

struct Trace {
    angles_deg: Columns<3>,
    /// Angle turned by the motors, in s at the nominal speed.
    turned_s: Vec<f64>,
    is_import: bool,
}

/// Random numbers: seed, and how many were drawn.
pub(crate) struct Random(pub u64, pub u64);

impl Random {
    pub fn uniform(&mut self) -> f64 {
        self.1 += 1;
        sim::split_mix::uniform(self.0, self.1)
    }

    /// Twelve uniform numbers add up to a normal one.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

impl Trace {
    fn of(truth: &Truth, way: Way, seed: u64) -> Self {
        let mut random = Random(seed, 0);
        let count = truth.angles_deg[0].len();
        let time_s: Vec<f64> = (0..count).map(|i| i as f64 / RATE_HZ).collect();
        let mut turned_s = time_s.clone();
        if way == Way::Wandering {
            let held = (-1.0 / RATE_HZ / 10.0_f64).exp();
            let mut change = 0.01 * random.normal();
            for i in 1..count {
                turned_s[i] = turned_s[i - 1] + (1.0 + change) / RATE_HZ;
                change = held * change + 0.01 * (1.0 - held * held).sqrt() * random.normal();
            }
        }
        let at = |column: usize, i: usize| {
            let place = (turned_s[i] * RATE_HZ).clamp(0.0, (count - 2) as f64);
            let (k, part) = (place as usize, place.fract());
            truth.angles_deg[column][k] * (1.0 - part) + truth.angles_deg[column][k + 1] * part
        };
        let phase = std::f64::consts::TAU * random.uniform();
        // A recording drifts, and its noise is that of an integrated rate.
        let drift_dps = [0, 1, 2].map(|axis| if axis == 0 { 0.01 * random.normal() } else { 0.0 });
        let noise_deg = if let Way::Imported(noise_deg) = way { noise_deg } else { 0.002 };
        let shaken = |i: usize| if way == Way::Shaken { (4.65 * time_s[i] + phase).sin() / 4.65 } else { 0.0 };
        let values = [0, 1, 2].map(|axis| {
            let angle = |i: usize| at(axis, i) + drift_dps[axis] * time_s[i] + shaken(i);
            (0..count).map(|i| angle(i) + noise_deg * random.normal()).collect()
        });
        Self { angles_deg: Columns { time_s, values }, turned_s, is_import: matches!(way, Way::Imported(_)) }
    }

    fn label(&self, rpm: [f64; 2], settled_s: Range<f64>) -> Label {
        let off = if self.is_import { (0.03, 0.3) } else { (0.012, 0.1) };
        let touches = Robot::default().flagellum.mesh(rpm);
        let told_rpm = blind::speeds(&self.angles_deg, settled_s.clone(), None).ok().and_then(|told| told.rpm());
        let mut trial = Labelled {
            angles_deg: &self.angles_deg,
            settled_s,
            rpm,
            off,
            touches,
            told_rpm,
            has_yaw_alone: false,
            balance: None,
        };
        trial.balance = Some(Balance {
            yaw_deg: self.angles_deg.tracks()[0].mean(trial.settled_s.clone()).unwrap(),
            tilt_deg: [size(trial.lean_deg().unwrap()); 2],
            per_rpm: PerRpm::of(&Robot::default()).unwrap(),
        });
        label(&trial)
    }

    /// Returns the ratio of the mean speed to the nominal one.
    fn speed(&self, part_s: &Range<f64>) -> f64 {
        let turned = |time_s: f64| self.turned_s[((time_s * RATE_HZ) as usize).min(self.turned_s.len() - 1)];
        (turned(part_s.end) - turned(part_s.start)) / (part_s.end - part_s.start)
    }
}

/// Returns both speeds with their uncertainties.
fn both(speeds: &SwingSpeeds) -> [(f64, f64); 2] {
    let u = speeds.measured_w1_uncertainty_rpm.zip(speeds.measured_w2_uncertainty_rpm).unwrap();
    let rpm = speeds.rpm().unwrap();
    [(rpm[0], u.0), (rpm[1], u.1)]
}

/// Returns whether one of the causes explains the difference of a label from the truth.
fn says(causes: &[Cause], truth: [f64; 2], label: [f64; 2]) -> bool {
    causes.iter().any(|cause| {
        let of = |motors: [bool; 2], factor: f64| [0, 1].map(|k| if motors[k] { label[k] * factor } else { label[k] });
        let explained = match *cause {
            Cause::Factor { motors, factor } => of(motors, factor),
            Cause::Sign(motors) => of(motors, -1.0),
            Cause::Swapped => [label[1], label[0]],
            Cause::Reversed => [-label[1], -label[0]],
            Cause::Stands(k) => of([k == 0, k == 1], 0.0),
            Cause::Other(rpm) => rpm,
            Cause::Unknown { .. } | Cause::StopEarly { .. } => return false,
        };
        (0..2).all(|k| {
            (explained[k] - truth[k]).abs() < 0.012 * truth[k].abs() + 0.02 * label[k].abs().min(truth[k].abs())
        })
    })
}

#[test]
fn a_wrong_label_is_named_and_a_right_one_is_not() {
    let truth = Truth::of(&quick(), [37.3, -23.9], 37.0, 37.0);
    let settled_s = SETTLING_S..36.0;
    for (way, seed, least) in [(Way::Recorded, 1, 1.05), (Way::Imported(0.05), 2, 1.5)] {
        let trace = Trace::of(&truth, way, seed);
        let [a, b] = truth.rpm;
        assert_eq!(trace.label([a, b], settled_s.clone()), Label::Right, "{way:?}");
        let speeds = both(&blind::speeds(&trace.angles_deg, settled_s.clone(), None).unwrap());
        assert!((0..2).all(|k| (speeds[k].0 - truth.rpm[k]).abs() < speeds[k].1 && speeds[k].1 < 0.3), "{speeds:?}");
        let factors =
            [0.5, 1.5, 2.0, 4.0, 6.0, 1.0 / 9.55, 1.0 / 60.0, least, 0.8, 1.3].map(|factor| [a * factor, b * factor]);
        let others = [[-a, -b], [-a, b], [a, -b], [b, a], [2.0 * a, b], [22.4, -14.6]];
        for label in factors.into_iter().chain(others) {
            match trace.label(label, settled_s.clone()) {
                Label::Wrong(causes) => assert!(says(&causes, [a, b], label), "{way:?}, {label:?}: {causes:?}"),
                other => panic!("{way:?}, {label:?}: {other:?}"),
            }
        }
    }
}

/// At this ratio the sum of both lines is that of a motor that turns four times as fast.
#[test]
fn a_line_of_flagella_that_touch_is_not_that_of_a_faster_motor() {
    for (seed, rpm) in [(1, [-66.0, -22.0]), (2, [-66.0, -22.0]), (3, [-90.0, -30.0])] {
        let mut robot = Robot::default();
        let mut random = Random(100 + seed, 0);
        robot.flagellum.phase_deg = [0, 1].map(|_| 360.0 * random.uniform());
        let truth = Truth::of(&robot, rpm, 21.0, 21.0);
        let label = Trace::of(&truth, Way::Recorded, seed).label(rpm, 9.0..20.0);
        assert!(!matches!(label, Label::Wrong(_)), "{rpm:?}: {label:?}");
    }
}

/// Noise is then most of the motion, but its line is that of the label.
#[test]
fn equal_motors_whose_swings_cancel_are_right() {
    let mut robot = quick();
    robot.flagellum.phase_deg = [40.0, 220.0];
    let trace = Trace::of(&Truth::of(&robot, [20.0; 2], 76.0, 76.0), Way::Imported(0.2), 7);
    assert_eq!(trace.label([20.0; 2], 15.0..75.0), Label::Right);
}

/// Where both wrap, the double of the slow speed and the difference of both are nearly one line: that of a motor twice as fast.
#[test]
fn a_line_of_flagella_that_touch_is_told_as_no_speed() {
    let mut robot = Robot::default();
    robot.flagellum.phase_deg = [326.0, 218.0];
    let trace = Trace::of(&Truth::of(&robot, [-14.794, -45.279], 76.0, 76.0), Way::Recorded, 38);
    let told = blind::speeds(&trace.angles_deg, 15.0..75.0, None).map(|told| told.rpm());
    assert!(told.is_err(), "{told:?}");
}

#[test]
fn motors_that_stop_early_are_seen() {
    let truth = Truth::of(&quick(), [37.3, -23.9], 50.0, 30.0);
    let trace = Trace::of(&truth, Way::Recorded, 3);
    let Label::Wrong(causes) = trace.label(truth.rpm, SETTLING_S..48.0) else { panic!("not seen") };
    assert!(matches!(causes[..], [Cause::StopEarly { at_s }] if (27.0..36.0).contains(&at_s)), "{causes:?}");
    let mut still = trace;
    still.angles_deg.values = [0, 1, 2].map(|_| vec![0.0; still.turned_s.len()]);
    assert_eq!(still.label(truth.rpm, SETTLING_S..48.0), Label::HardlySwings(Swing::Whole));
    assert_eq!(blind::speeds(&still.angles_deg, SETTLING_S..48.0, None), Err("the robot hardly swings"));
    // One of two motors stops before the end: no mean speed of an earlier part is told.
    let (both, one) = ([50.3, -48.5], [50.3, 0.0]);
    let points = [(0.0, [0.0; 2]), (0.5, both), (57.5, both), (58.0, one), (76.0, one)];
    let truth = Truth::by(&Robot::default(), both, SpeedProfile::from_points(&points).unwrap());
    let trace = Trace::of(&truth, Way::Recorded, 4);
    let told = blind::speeds(&trace.angles_deg, SETTLING_S..75.0, None);
    assert!(told.is_err(), "{told:?}");
    let (both, one) = ([50.3, -20.2], [50.3, 0.0]);
    let points = [(0.0, [0.0; 2]), (0.5, both), (69.0, both), (69.5, one), (76.0, one)];
    let truth = Truth::by(&quick(), both, SpeedProfile::from_points(&points).unwrap());
    let told = blind::speeds(&Trace::of(&truth, Way::Recorded, 4).angles_deg, SETTLING_S..75.0, None);
    assert_eq!(told.map(|told| told.rpm()), Err("a motor stops, or changes its speed"));
    // The second motor stops, turns at half of its speed, or the other way.
    for part in [0.0, 0.5, -1.0] {
        let both = [52.4, -27.3];
        let points =
            [(0.0, [0.0; 2]), (0.5, both), (50.0, both), (50.5, [52.4, part * -27.3]), (76.0, [52.4, part * -27.3])];
        let truth = Truth::by(&quick(), both, SpeedProfile::from_points(&points).unwrap());
        for way in [Way::Recorded, Way::Imported(0.1)] {
            let Label::Wrong(causes) = Trace::of(&truth, way, 5).label(both, SETTLING_S..75.0) else {
                panic!("{way:?}, {part}")
            };
            let is_said = causes == [Cause::Stands(1)] || part != 0.0 && says(&causes, [52.4, part * -27.3], both);
            assert!(is_said, "{way:?}, {part}: {causes:?}");
        }
    }
}

#[test]
fn motors_that_wander_apart_are_told_alone_and_near_a_label() {
    let rpm = |t: f64| [41.2 * (1.0 - 0.0006 * t), -29.3 * (1.0 + 0.03 * (t / 14.0).sin())];
    let points: Vec<_> =
        (0..=120).map(|i| (0.5 * f64::from(i), if i == 0 { [0.0; 2] } else { rpm(0.5 * f64::from(i)) })).collect();
    let profile = SpeedProfile::from_points(&points).unwrap();
    let [from, to] = [SETTLING_S, 60.0].map(|t| profile.motors(t).map(|motor| motor.angle / TAU));
    let mean_rpm = [0, 1].map(|k| (to[k] - from[k]) / (60.0 - SETTLING_S) * 60.0);
    let truth = profile.clone();
    let Trace { angles_deg, .. } = Trace::of(&Truth::by(&quick(), mean_rpm, profile), Way::Recorded, 4);
    let label = Labelled {
        angles_deg: &angles_deg,
        settled_s: SETTLING_S..60.0,
        rpm: [46.0, -26.0],
        off: (0.25, 2.0),
        touches: false,
        told_rpm: None,
        has_yaw_alone: false,
        balance: None,
    };
    for near in [None, Some(&label)] {
        let speeds = blind::speeds(&angles_deg, SETTLING_S..60.0, near).unwrap();
        let told = both(&speeds);
        assert!(
            (0..2).all(|k| (told[k].0 - mean_rpm[k]).abs() < told[k].1 && told[k].1 < 0.2),
            "{told:?}, {mean_rpm:?}"
        );
        // Over the last seconds, of which the steady angles are, the speeds are others than in the mean.
        let end_s = 49.0..60.0;
        let [from, to] = [end_s.start, end_s.end].map(|t| truth.motors(t).map(|motor| motor.angle / TAU));
        for (k, track) in speeds.over_time.tracks().into_iter().enumerate() {
            let (rpm, at_the_end) = ((to[k] - from[k]) / 11.0 * 60.0, track.mean(end_s.clone()).unwrap());
            assert!((at_the_end - rpm).abs() < 0.003 * rpm.abs(), "{at_the_end} instead of {rpm}");
            assert!((told[k].0 - rpm).abs() > 0.01 * rpm.abs(), "{told:?}, {rpm}");
        }
    }
    // Readings with other senses than the label's are not accepted.
    let other = Labelled { rpm: [-46.0, -26.0], ..label };
    assert!(blind::speeds(&angles_deg, SETTLING_S..60.0, Some(&other)).is_err());
}

#[test]
fn speed_and_sense_of_a_motor_alone_are_told_from_noise_and_rest() {
    let noise = |i: usize| (i as f64 * 12.9898).sin() * 43758.5453 % 1.0 * 0.002;
    for (rpm, swing_dps) in [(31.7, 1.5), (-31.7, 1.5), (-118.4, 9.0), (12.3, 0.25), (45.0, 0.0)] {
        let mut angles = Columns::<3>::default();
        for i in 0..200 * 19 {
            let time_s = i as f64 / 200.0;
            let (turn, slow) = (TAU * rpm / 60.0 * time_s, 3.0 * (-time_s / 11.0).exp());
            let swing_deg = swing_dps / (TAU * rpm / 60.0);
            // wx = swing cos, wy = swing sin.
            let (roll, pitch) = (swing_deg * turn.sin() + slow, -swing_deg * turn.cos() - slow);
            angles.push(time_s, [20.0 + slow, pitch + noise(i), roll + noise(i + 7)]);
        }
        let told = speed_alone(&angles, 6.0..19.0);
        match swing_dps > 0.0 {
            true => assert!(told.is_ok_and(|(found, u)| (found - rpm).abs() < u && u < 1.0), "{rpm}: {told:?}"),
            false => assert!(told.is_err(), "{told:?}"),
        }
    }
}
