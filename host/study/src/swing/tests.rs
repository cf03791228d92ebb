//! Labels of motions that the model computes, with the errors of an instrument.

use super::*;
use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::{Robot, Tank};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt;

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
        label(&Labelled { angles_deg: &self.angles_deg, settled_s, rpm, off, touches, told_rpm, has_yaw_alone: false })
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

/// Motions of random robots at random and at published speeds.
fn population(seed: u64, count: usize) -> Vec<Truth> {
    let robots = {
        let physical = Robot::default();
        let mut soft = physical.clone();
        soft.flagellum.young_pa *= 0.6;
        let tank = Robot { tank: Some(Tank::published()), ..physical.clone() };
        [physical, Robot::published(), tank, soft, quick()]
    };
    let published = [
        [50.0, 10.0],
        [-90.0, 90.0],
        [90.0, 90.0],
        [30.0, 60.0],
        [20.0, -40.0],
        [-40.0, -20.0],
        [60.0, 0.0],
        [-66.0, -22.0],
    ];
    let mut random = Random(seed, 0);
    let trials: Vec<(Robot, [f64; 2])> = (0..count)
        .map(|i| {
            let signs = [[1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0]][i / 2 % 4];
            let drawn = signs.map(|sign| sign * (500.0 + 8500.0 * random.uniform()).round() / 100.0);
            let mut robot = robots[i % robots.len()].clone();
            robot.flagellum.phase_deg = [0, 1].map(|_| 360.0 * random.uniform());
            (robot, if i % 4 == 3 { published[i / 4 % published.len()] } else { drawn })
        })
        .collect();
    trials.par_iter().map(|(robot, rpm)| Truth::of(robot, *rpm, 76.0, 76.0)).collect()
}

/// `cargo test --release -p study --lib swing -- --ignored --nocapture`: prints shares over robots and speeds.
#[test]
#[ignore = "takes minutes"]
fn shares_of_labels() {
    let truths = population(11, TRIALS);
    let ways = [Way::Recorded, Way::Wandering, Way::Shaken, Way::Imported(0.05), Way::Imported(0.5)];
    for way in ways {
        for parts_s in [vec![15.0..35.0, 35.0..55.0, 55.0..75.0], vec![15.0..75.0]] {
            let mut labels = BTreeMap::new();
            for (i, truth) in truths.iter().enumerate() {
                let trace = Trace::of(truth, way, i as u64);
                for part_s in &parts_s {
                    let rpm = truth.rpm.map(|rpm| rpm * trace.speed(part_s));
                    count_labels(&trace, part_s, rpm, &mut labels);
                }
            }
            let length_s = parts_s[0].end - parts_s[0].start;
            println!("\n{way:?}, {length_s} s");
            labels.iter().for_each(|(name, n)| {
                println!("{name}: named {}, otherwise {}, not {}, not judged {}", n[0], n[1], n[2], n[3])
            });
            let alarms = labels["the label is right"];
            assert!(alarms[0] * 100 <= alarms.iter().sum::<usize>(), "{way:?}, {length_s} s: {alarms:?}");
        }
    }
}

const TRIALS: usize = 60;

type Counts = BTreeMap<String, [usize; 4]>;

fn count_labels(trace: &Trace, part_s: &Range<f64>, rpm: [f64; 2], counts: &mut Counts) {
    let nominal = if trace.is_import { rpm.map(|w| w * 1.02) } else { rpm };
    let [a, b] = nominal;
    let mut cases = vec![("the label is right".to_owned(), nominal)];
    if rpm.iter().all(|w| w.abs() >= SLOWEST_RPM) {
        let factors = [0.5, 1.5, 2.0, 4.0, 6.0, 9.55, 60.0];
        cases.extend(factors.map(|factor| (format!("both x {factor}"), nominal.map(|w| w * factor))));
        if rpm.iter().all(|w| w.abs() >= 15.0) {
            cases.extend([
                ("both x 1.05".to_owned(), nominal.map(|w| w * 1.05)),
                ("one x 1.05".to_owned(), [a * 1.05, b]),
            ]);
        }
        cases.extend([0.5, 1.5, 2.0].map(|factor| (format!("one x {factor}"), [a * factor, b])));
        cases.extend([("both signs".to_owned(), [-a, -b]), ("one sign".to_owned(), [-a, b])]);
        if a.to_bits() != b.to_bits() {
            cases.push(("swapped".to_owned(), [b, a]));
        }
    }
    for (name, label) in cases {
        let place = match trace.label(label, part_s.clone()) {
            Label::Wrong(causes) if name == "the label is right" => {
                println!("{rpm:?} at {part_s:?}: {causes:?}");
                0
            }
            Label::Wrong(causes) => usize::from(!says(&causes, rpm, label)),
            Label::Right => 2,
            Label::HardlySwings(_) | Label::NotJudged(_) => 3,
        };
        counts.entry(name).or_default()[place] += 1;
    }
}

/// Estimated speeds of trials of one kind.
#[derive(Default)]
struct Told {
    asked: usize,
    /// With a wrong sense or motor, or off by more than 1 rpm.
    wrong: usize,
    /// Errors of single motors, and the number within their uncertainty.
    errors_rpm: Vec<f64>,
    covered: usize,
}

/// The same command prints how many speeds are estimated from the motion alone, and how well.
#[test]
#[ignore = "takes minutes"]
fn shares_of_speeds() {
    let truths = population(102, TRIALS);
    for way in [Way::Recorded, Way::Wandering, Way::Shaken, Way::Imported(0.05)] {
        for parts_s in [vec![15.0..35.0, 35.0..55.0, 55.0..75.0], vec![15.0..75.0]] {
            let length_s = parts_s[0].end - parts_s[0].start;
            println!("\n{way:?}, {length_s} s");
            for (regime, told) in told(&truths, way, &parts_s) {
                let count = told.errors_rpm.len();
                println!("{regime}: {told}");
                assert!(told.wrong * 30 <= told.asked, "{way:?}, {regime}");
                // In the other regimes few speeds are estimated, and their lines are pulled.
                let least = if CLEAR.contains(&regime) { 90 } else { 70 };
                assert!(told.covered * 100 >= count * least, "{way:?}, {regime}");
                // Where the fast one of two motors wraps, its flagellum hides the swing of a slow one.
                let least = if regime == "one much slower" { 70 } else { 90 };
                assert!(!CLEAR.contains(&regime) || count * 100 >= 2 * told.asked * least, "{way:?}, {regime}");
            }
        }
    }
}

/// Regimes in which nearly all speeds are told.
const CLEAR: [&str; 3] = ["opposite", "both unwrap", "one much slower"];

fn told(truths: &[Truth], way: Way, parts_s: &[Range<f64>]) -> BTreeMap<&'static str, Told> {
    let mut all: BTreeMap<_, Told> = BTreeMap::new();
    for (i, truth) in truths.iter().enumerate() {
        let trace = Trace::of(truth, way, i as u64);
        for part_s in parts_s {
            all.entry(regime(truth.rpm, part_s)).or_default().add(truth, &trace, part_s);
        }
    }
    all
}

fn regime(rpm: [f64; 2], part_s: &Range<f64>) -> &'static str {
    let [a, b] = rpm.map(f64::abs);
    match ((a - b).abs() / 60.0 * (part_s.end - part_s.start) < 2.0, rpm[0] < 0.0, rpm[1] < 0.0) {
        _ if a.min(b) < SLOWEST_RPM => "a slow one",
        (true, ..) => "equally fast",
        (_, true, true) => "both wrap",
        _ if a.min(b) < 0.4 * a.max(b) => "one much slower",
        (_, false, false) => "both unwrap",
        _ => "opposite",
    }
}

impl fmt::Display for Told {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { asked, wrong, errors_rpm, covered } = self;
        let mut errors_rpm = errors_rpm.clone();
        errors_rpm.sort_by(f64::total_cmp);
        let count = errors_rpm.len();
        let [middle, most] = [count / 2, count.max(1) - 1].map(|i| errors_rpm.get(i).copied().unwrap_or(f64::NAN));
        write!(f, "told {} of {asked}, wrong {wrong}, U holds {covered} of {count}, ", count / 2)?;
        write!(f, "error in the median {middle:.4} rpm, at most {most:.4} rpm")
    }
}

impl Told {
    fn add(&mut self, truth: &Truth, trace: &Trace, part_s: &Range<f64>) {
        let rpm = truth.rpm.map(|rpm| rpm * trace.speed(part_s));
        self.asked += 1;
        let Ok(speeds) = blind::speeds(&trace.angles_deg, part_s.clone(), None) else { return };
        let speeds = both(&speeds);
        let errors = [0, 1].map(|k| (speeds[k].0 - rpm[k]).abs());
        if errors.iter().any(|error| *error > 1.0) {
            self.wrong += 1;
            println!("{rpm:?} at {part_s:?}: {speeds:?}");
            return;
        }
        self.covered += (0..2).filter(|&k| errors[k] <= speeds[k].1).count();
        self.errors_rpm.extend(errors);
    }
}

/// The same command prints a population's false alarms, the share of speeds that are estimated, and the coverage of their
/// uncertainties.
#[test]
#[ignore = "takes half an hour"]
fn a_population_is_told_and_not_doubted() {
    let truths = population(207, 900);
    let part_s = 15.0..75.0;
    let imports = [0.05, 0.1, 0.2, 0.5].map(Way::Imported);
    for (name, count, ways, most) in
        [("recordings", 900, &[Way::Recorded, Way::Wandering, Way::Shaken][..], 3), ("imports", 500, &imports[..], 1)]
    {
        let one = |(i, truth): (usize, &Truth)| {
            let trace = Trace::of(truth, ways[i % ways.len()], 5000 + i as u64);
            let nominal = if trace.is_import { 1.02 } else { 1.0 } * trace.speed(&part_s);
            (trace.label(truth.rpm.map(|rpm| rpm * nominal), part_s.clone()), trace)
        };
        let labels: Vec<(Label, Trace)> = truths[..count].par_iter().enumerate().map(one).collect();
        let (mut all, mut alarms): (BTreeMap<_, Told>, _) = (BTreeMap::new(), 0);
        for (i, (truth, (label, trace))) in truths.iter().zip(&labels).enumerate() {
            if matches!(label, Label::Wrong(_) | Label::HardlySwings(_)) {
                alarms += 1;
                println!("{name}: {:?}, {:?}: {label:?}", truth.rpm, ways[i % ways.len()]);
            }
            all.entry(regime(truth.rpm, &part_s)).or_default().add(truth, trace, &part_s);
        }
        println!("\n{count} {name}: false alarms {alarms}");
        all.iter().for_each(|(regime, told)| println!("{regime}: {told}"));
        let clear = || CLEAR.iter().filter_map(|regime| all.get(regime));
        let (asked, told): (usize, usize) =
            (clear().map(|told| 2 * told.asked).sum(), clear().map(|told| told.errors_rpm.len()).sum());
        println!("all clear ones: told {} of {}", told / 2, asked / 2);
        assert!(alarms <= most && told * 100 >= 95 * asked, "{alarms} alarms, told {told} of {asked}");
    }
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
