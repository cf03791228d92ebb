//! Imports of many motions, with and without faults.
//!
//! Some robots are softer, or their fluid is thicker, than in the file of the import; some speeds wander.

use crate::attitude::Unwrap;
use crate::swing::tests::{RATE_HZ, Random, Truth, quick};
use crate::trial::Judged;
use crate::trial::findings::frame::tests::judged;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use sim::body::attitude::{euler_zyx, of_euler_zyx};
use sim::params::{Robot, Tank};
use std::collections::BTreeMap;

type Turn = UnitQuaternion<f64>;
type Rows = Vec<(f64, [f64; 3])>;

const RUN_S: f64 = 76.0;
const AFTER_S: f64 = 30.0;

const PAIRS: [[f64; 2]; 25] = [
    [37.3, 14.9],
    [52.7, -21.4],
    [-61.9, 33.2],
    [23.6, 71.8],
    [-31.4, -18.7],
    [-72.3, -25.6],
    [-45.2, -66.1],
    [-15.8, -38.4],
    [83.1, -12.6],
    [18.3, -17.6],
    [64.4, 28.9],
    [50.3, -49.1],
    [41.7, 41.7],
    [-27.4, 58.6],
    [20.2, 12.3],
    [-19.6, 12.1],
    [-60.0, 25.0],
    [12.0, 90.0],
    [63.7, -46.0],
    [-46.0, 63.7],
    [80.0, -20.0],
    [0.0, -72.5],
    [-41.3, 0.0],
    [0.0, 33.3],
    [-67.4, -64.9],
];

struct Motion {
    truth: Truth,
    file: Robot,
    name: &'static str,
}

fn motions() -> Vec<Motion> {
    let physical = Robot::default();
    let mut soft = physical.clone();
    soft.flagellum.young_pa *= 0.6;
    let mut stiff = physical.clone();
    stiff.flagellum.young_pa *= 1.67;
    let [mut thick, mut thin] = [physical.clone(), physical.clone()];
    thick.fluid.viscosity_pa_s *= 1.25;
    thin.fluid.viscosity_pa_s *= 0.8;
    let tank = Robot { tank: Some(Tank::published()), ..physical.clone() };
    let robots = [
        ("physical", physical.clone(), physical.clone()),
        ("published", Robot::published(), Robot::published()),
        ("tank", tank.clone(), physical.clone()),
        ("soft", soft, physical.clone()),
        ("quick", quick(), quick()),
        ("thick", thick, physical.clone()),
        ("stiff", stiff, physical.clone()),
        ("thin", thin, physical.clone()),
    ];
    let mut random = Random(77, 0);
    let all: Vec<_> = robots
        .iter()
        .flat_map(|robot| PAIRS.map(|rpm| (robot.clone(), rpm)))
        .map(|((name, mut robot, mut file), rpm)| {
            robot.flagellum.phase_deg = [0, 1].map(|_| 360.0 * random.uniform());
            file.flagellum.phase_deg = [0.0; 2];
            (name, robot, file, rpm)
        })
        .collect();
    all.into_par_iter()
        .map(|(name, robot, file, rpm)| Motion { truth: Truth::of(&robot, rpm, RUN_S + AFTER_S, RUN_S), file, name })
        .collect()
}

/// The conditions of a measurement.
#[derive(Clone, Copy, Debug)]
struct Way {
    rate_hz: f64,
    /// Of yaw, and of pitch and roll.
    noise_deg: [f64; 2],
    rest_s: f64,
    rest_deg: f64,
    /// Share by which the speeds wander.
    wander: f64,
}

impl Way {
    fn of(random: &mut Random) -> Self {
        let one = |of: &[f64], random: &mut Random| of[(random.uniform() * of.len() as f64) as usize];
        Self {
            rate_hz: one(&[20.0, 25.0, 30.0, 60.0, 120.0, 240.0], random),
            noise_deg: {
                let tilt = one(&[0.05, 0.1, 0.2, 0.5], random);
                [tilt * one(&[0.5, 1.0, 1.0, 2.0], random), tilt]
            },
            rest_s: one(&[3.0, 5.0, 10.0, 30.0], random),
            rest_deg: 360.0 * random.uniform() - 180.0,
            wander: one(&[0.0, 0.0, 0.003, 0.01], random),
        }
    }
}

/// Cubic interpolation of a motion.
fn at(truth: &Truth, time_s: f64) -> [f64; 3] {
    let count = truth.angles_deg[0].len();
    let place = (time_s * RATE_HZ).clamp(0.0, (count - 1) as f64);
    let (i, x) = (place as usize, place.fract());
    [0, 1, 2].map(|k| {
        let of = |j: i64| truth.angles_deg[k][(i as i64 + j).clamp(0, count as i64 - 1) as usize];
        let [a, b, c, d] = [-1, 0, 1, 2].map(of);
        b + 0.5 * x * (c - a + x * (2.0 * a - 5.0 * b + 4.0 * c - d + x * (3.0 * (b - c) + d - a)))
    })
}

fn rows(truth: &Truth, way: Way) -> Rows {
    let count = ((way.rest_s + RUN_S + AFTER_S) * way.rate_hz) as usize;
    let mut random = Random((way.rest_deg * 1e6) as u64, 7);
    let held = (-0.1 / way.rate_hz).exp();
    let mut change = way.wander * random.normal();
    let mut turned_s = 0.0;
    (0..count)
        .map(|i| {
            let time_s = i as f64 / way.rate_hz;
            // Wandering motors turn on a clock of their own.
            let run_s = time_s - way.rest_s;
            if run_s > 0.0 {
                turned_s += (1.0 + if turned_s < RUN_S { change } else { 0.0 }) / way.rate_hz;
            }
            change = held * change + way.wander * (1.0 - held * held).sqrt() * random.normal();
            let [yaw, pitch, roll] = if run_s < 0.0 { [0.0; 3] } else { at(truth, turned_s) };
            (time_s, [yaw + way.rest_deg, pitch, roll])
        })
        .collect()
}

fn noisy(rows: &Rows, way: Way, random: &mut Random) -> Rows {
    let [of_yaw, of_tilt] = way.noise_deg;
    let noise = [of_yaw, of_tilt, of_tilt];
    rows.iter().map(|(t, angles)| (*t, [0, 1, 2].map(|k| angles[k] + noise[k] * random.normal()))).collect()
}

fn import(rows: &Rows, way: Way, motion: &Motion) -> Judged {
    let table: String = rows.iter().map(|(t, [y, p, r])| format!("{t:.5},{y:.5},{p:.5},{r:.5}\n")).collect();
    let run_s = way.rest_s..way.rest_s + RUN_S - 1.5;
    let rpm = motion.truth.rpm.map(|w| (w * 100.0).round() / 100.0);
    judged(&table, "time=#1,yaw=#2,pitch=#3,roll=#4", rpm, run_s, &motion.file)
}

fn by_turn(rows: &Rows, of: impl Fn(usize, Turn) -> Turn) -> Rows {
    let mut unwrap = Unwrap::default();
    let row = |(i, (t, angles)): (usize, &(f64, [f64; 3]))| {
        let turn = of(i, of_euler_zyx(angles.map(f64::to_radians)));
        let [yaw, pitch, roll] = euler_zyx(&turn).map(f64::to_degrees);
        (*t, [unwrap.next(yaw), pitch, roll])
    };
    rows.iter().enumerate().map(row).collect()
}

fn about(axis: Vector3<f64>, deg: f64) -> Turn {
    UnitQuaternion::from_scaled_axis(axis * deg.to_radians())
}

const FAULTS: [&str; 22] = [
    "inverse",
    "order x-y-z",
    "order z-x-y",
    "order y-x-z",
    "quarter left",
    "quarter right",
    "half",
    "yaw clockwise",
    "yaw x2",
    "yaw x0.5",
    "pitch x2",
    "roll x2",
    "all x0.4",
    "all x2.5",
    "slip at once",
    "slip in 1 s",
    "pitch slips in 3 s",
    "flips of single rows",
    "flips of runs of rows",
    "two poses, a quarter of rows",
    "body about z by 40",
    "run named late by 0.4 s",
];

fn spoilt(fault: &str, rows: &Rows, way: Way, random: &mut Random) -> Rows {
    let scaled = |by: [f64; 3]| rows.iter().map(|(t, a)| (*t, [0, 1, 2].map(|k| a[k] * by[k]))).collect();
    let (z, x, y) = (Vector3::z(), Vector3::x(), Vector3::y());
    match fault {
        "inverse" => by_turn(rows, |_, q| q.inverse()),
        // The table has the angles of another order.
        "order x-y-z" => {
            other_order(rows, |m| [(-m[(0, 1)]).atan2(m[(0, 0)]), m[(0, 2)].asin(), (-m[(1, 2)]).atan2(m[(2, 2)])])
        }
        "order z-x-y" => {
            other_order(rows, |m| [(-m[(0, 1)]).atan2(m[(1, 1)]), (-m[(2, 0)]).atan2(m[(2, 2)]), m[(2, 1)].asin()])
        }
        "order y-x-z" => {
            other_order(rows, |m| [m[(1, 0)].atan2(m[(1, 1)]), m[(0, 2)].atan2(m[(2, 2)]), (-m[(1, 2)]).asin()])
        }
        "quarter left" => by_turn(rows, |_, q| about(z, 30.0) * q * about(z, 90.0)),
        "quarter right" => by_turn(rows, |_, q| q * about(z, -90.0)),
        "half" => by_turn(rows, |_, q| q * about(z, 180.0)),
        "body about z by 40" => by_turn(rows, |_, q| q * about(z, 40.0)),
        "run named late by 0.4 s" => rows.iter().map(|(t, a)| (t - 0.4, *a)).collect(),
        "yaw clockwise" => scaled([-1.0, 1.0, 1.0]),
        "yaw x2" => scaled([2.0, 1.0, 1.0]),
        "yaw x0.5" => scaled([0.5, 1.0, 1.0]),
        "pitch x2" => scaled([1.0, 2.0, 1.0]),
        "roll x2" => scaled([1.0, 1.0, 2.0]),
        "all x0.4" => scaled([0.4; 3]),
        "all x2.5" => scaled([2.5; 3]),
        "slip at once" | "slip in 1 s" | "pitch slips in 3 s" => {
            let (lasts_s, axis) = match fault {
                "slip at once" => (0.001, 0),
                "slip in 1 s" => (1.0, 0),
                _ => (3.0, 1),
            };
            let from_s = way.rest_s + 5.0 + (RUN_S - 25.0) * random.uniform();
            let deg = (4.0 + 2.0 * random.uniform()) * if random.uniform() < 0.5 { 1.0 } else { -1.0 };
            let share = |t: f64| ((t - from_s) / lasts_s).clamp(0.0, 1.0);
            let slipped = |t: f64, k: usize| if k == axis { deg * share(t) } else { 0.0 };
            rows.iter().map(|(t, a)| (*t, [0, 1, 2].map(|k| a[k] + slipped(*t, k)))).collect()
        }
        _ => {
            // A flat tag has two poses: its tilt against the line of sight may have the other sign.
            let sight = about(x, 8.0 + 14.0 * random.uniform()) * about(y, 10.0 * random.uniform() - 5.0);
            let mut is_flipped = vec![false; rows.len()];
            match fault {
                "flips of single rows" => {
                    (0..rows.len()).for_each(|i| is_flipped[i] = random.uniform() < 0.02);
                }
                "flips of runs of rows" => {
                    let mut i = 0;
                    while i < rows.len() {
                        i += (way.rate_hz * (1.0 + 12.0 * random.uniform())) as usize;
                        let lasts = (way.rate_hz * (0.2 + 2.0 * random.uniform())) as usize;
                        (i..(i + lasts).min(rows.len())).for_each(|k| is_flipped[k] = true);
                        i += lasts;
                    }
                }
                _ => (0..rows.len()).for_each(|i| is_flipped[i] = random.uniform() < 0.25),
            }
            by_turn(rows, |i, q| if is_flipped[i] { sight * q } else { q })
        }
    }
}

/// Returns yaw, pitch and roll in another order of the turns.
fn other_order(rows: &Rows, of: impl Fn(Matrix3<f64>) -> [f64; 3]) -> Rows {
    let mut unwrap = Unwrap::default();
    let row = |(t, angles): &(f64, [f64; 3])| {
        let turn = of_euler_zyx(angles.map(f64::to_radians));
        let [yaw, pitch, roll] = of(turn.to_rotation_matrix().into_inner()).map(f64::to_degrees);
        (*t, [unwrap.next(yaw), pitch, roll])
    };
    rows.iter().map(row).collect()
}

/// The swing of nearly equal motors hardly distinguishes them, but yaw and tilt do.
#[test]
fn a_nearly_equal_motor_that_stood_or_turned_the_other_way_is_named() {
    let way = Way { rate_hz: 30.0, noise_deg: [0.05; 2], rest_s: 5.0, rest_deg: 40.0, wander: 0.0 };
    let mut robot = quick();
    robot.flagellum.phase_deg = [40.0, 210.0];
    let said = |truth: &Truth, label: [f64; 2]| {
        let truth = Truth { rpm: label, angles_deg: truth.angles_deg.clone() };
        let motion = Motion { truth, file: quick(), name: "quick" };
        let rows = rows(&motion.truth, way);
        let found = import(&noisy(&rows, way, &mut Random(3, 0)), way, &motion).findings;
        found.iter().map(|one| one.text.clone()).filter(|text| !text.starts_with("not settled")).collect::<Vec<_>>()
    };
    for (turned, labels, cause) in [
        ([44.3, 0.0], &[[44.3, -44.3], [44.3, -42.1], [44.3, 44.3], [44.3, 41.2]][..], "motor 2 stood"),
        ([-52.1, 50.4], &[[52.1, 50.4]], "motor 1 turned the other way"),
        ([52.1, 50.4], &[[52.1, -50.4]], "motor 2 turned the other way"),
        ([-61.3, -44.7], &[[61.3, -44.7]], "motor 1 turned the other way"),
    ] {
        let truth = Truth::of(&robot, turned, RUN_S + AFTER_S, RUN_S);
        assert!(said(&truth, turned).is_empty(), "{turned:?}");
        for label in labels {
            let found = said(&truth, *label);
            assert!(found.iter().any(|text| text.contains(cause)), "{turned:?} as {label:?}: {found:?}");
        }
    }
}

/// The flagella of a fast motor bend, and a softer robot then leans elsewhere.
#[test]
fn a_lean_in_another_direction_is_named_unless_stiffness_explains_it() {
    let motion = |robot: Robot, rpm: [f64; 2]| {
        let truth = Truth::of(&robot, rpm, RUN_S + AFTER_S, RUN_S);
        Motion { truth, file: Robot::default(), name: "" }
    };
    let found = |motion: &Motion, fault: Option<&str>, rest_deg: f64, rate_hz: f64| {
        let way = Way { rate_hz, noise_deg: [0.05; 2], rest_s: 5.0, rest_deg, wander: 0.0 };
        let (clean, mut random) = (rows(&motion.truth, way), Random(3, 0));
        let rows = fault.map_or(clean.clone(), |fault| spoilt(fault, &clean, way, &mut random));
        let trial = import(&noisy(&rows, way, &mut random), way, motion);
        let texts = trial.findings.iter().filter(|one| one.grave).map(|one| one.text.clone());
        texts.filter(|text| !text.starts_with("not settled")).collect::<Vec<_>>()
    };
    let [opposite, slower, calm] =
        [[63.7, -46.0], [-60.0, 25.0], [37.3, 14.9]].map(|rpm| motion(Robot::default(), rpm));
    // A flagellum that wraps beside one that stands bends far, and swings the robot as two motors do.
    let mut stands = Robot::default();
    stands.flagellum.phase_deg = [30.8, 85.3];
    let stands = motion(stands, [0.0, -72.5]);
    for motion in [&opposite, &slower, &calm, &stands] {
        assert_eq!(found(motion, None, 0.0, 30.0), [""; 0]);
        // A slow camera has a reading in every second interval.
        assert_eq!(found(motion, None, 0.0, 8.3), [""; 0]);
    }
    for (motion, fault, rest_deg, cause) in [
        (&opposite, "inverse", 0.0, "turns the world's axes into the body's"),
        (&slower, "order x-y-z", 20.0, "turns in another order"),
        (&opposite, "half", 0.0, "turned by a half"),
        (&slower, "quarter left", 0.0, "turned by a quarter"),
        (&calm, "all x2.5", 0.0, "all angles had another scale"),
        (&calm, "all x0.4", 0.0, "all angles had another scale or were smoothed"),
    ] {
        for rate_hz in [30.0, 8.3] {
            let texts = found(motion, Some(fault), rest_deg, rate_hz);
            assert!(texts.iter().any(|text| text.contains(cause)), "{fault} at {rate_hz} Hz: {texts:?}");
        }
    }
    let mut soft = Robot::default();
    soft.flagellum.young_pa *= 0.6;
    assert_eq!(found(&motion(soft, [18.1, -79.9]), None, 0.0, 30.0), [""; 0]);
}

/// Unequal noise is that of a camera beside or above the robot.
#[test]
fn a_slow_swing_in_the_angles_with_less_noise_is_seen() {
    for (rpm, noise_deg) in [([20.0, 12.0], [0.3, 0.2]), ([-20.0, 12.0], [0.2, 0.1]), ([24.0, 20.0], [0.1, 0.2])] {
        let way = Way { rate_hz: 25.0, noise_deg, rest_s: 5.0, rest_deg: 40.0, wander: 0.0 };
        let file = Robot::default();
        let motion = Motion { truth: Truth::of(&file, rpm, RUN_S + AFTER_S, RUN_S), file, name: "physical" };
        let trial = import(&noisy(&rows(&motion.truth, way), way, &mut Random(3, 0)), way, &motion);
        let found: Vec<_> = trial.findings.iter().filter(|one| !one.text.starts_with("not settled")).collect();
        assert!(found.is_empty(), "{rpm:?}: {found:?}");
    }
}

const U_DEG: [f64; 3] = [0.5, 0.3, 0.3];

fn kind_of(text: &str) -> String {
    text.chars().filter(|c| !c.is_ascii_digit()).take(150).collect()
}

/// `cargo test --release -p study --lib swing -- --ignored --nocapture` prints how many right imports have an alarm, and how many
/// spoilt ones have none.
#[test]
#[ignore = "takes minutes"]
fn shares_of_spoilt_imports() {
    let motions = motions();
    let of = |i: usize| {
        let motion = &motions[i / RIGHT];
        let mut random = Random(1000 + i as u64, 0);
        let way = Way::of(&mut random);
        let trial = import(&noisy(&rows(&motion.truth, way), way, &mut random), way, motion);
        let found = trial.findings.iter().filter(|one| !one.text.starts_with("not settled"));
        let found: Vec<(bool, String)> = found.map(|one| (one.grave, one.text.clone())).collect();
        (found, format!("{} {:?} {way:?}", motion.name, motion.truth.rpm))
    };
    let right: Vec<_> = (0..motions.len() * RIGHT).into_par_iter().map(of).collect();
    let alarms = right.iter().filter(|(found, _)| found.iter().any(|(grave, _)| *grave)).count();
    let notes = right.iter().filter(|(found, _)| !found.is_empty()).count() - alarms;
    println!("\n{} right imports: alarms {alarms}, only notes {notes}", right.len());
    right.iter().filter(|(found, _)| !found.is_empty()).for_each(|(found, of)| println!("    {found:?}: {of}"));
    let mut unsaid = 0;
    for fault in FAULTS {
        let told: Vec<(bool, Told, String)> =
            motions.par_iter().enumerate().map(|(i, motion)| told(fault, motion, i as u64)).collect();
        for wraps in [false, true] {
            let count = |of: Told| told.iter().filter(|one| (one.0, one.1) == (wraps, of)).count();
            let all = [Told::Grave, Told::Note, Told::NotJudged, Told::Silent, Told::Harmless];
            let [grave, note, not_judged, silent, harmless] = all.map(count);
            let name = if wraps { "both wrap" } else { "clear" };
            println!(
                "{fault}, {name}: grave {grave}, noted {note}, not judged {not_judged}, silent {silent}, without an effect {harmless}"
            );
            let is_turn = ["quarter left", "quarter right", "half", "yaw clockwise"].contains(&fault);
            unsaid += if is_turn { silent } else { 0 };
        }
        let mut texts: BTreeMap<String, usize> = BTreeMap::new();
        told.iter().for_each(|(_, _, text)| *texts.entry(kind_of(text)).or_default() += 1);
        texts.iter().filter(|(text, _)| !text.is_empty()).for_each(|(text, count)| println!("    {count} x {text}"));
    }
    assert!(alarms <= 1, "{alarms}");
    // Turns about the vertical.
    assert_eq!(unsaid, 0);
}

/// Number of right imports of a motion.
const RIGHT: usize = 6;

/// Findings about a spoilt import that the right one does not have.
#[derive(Clone, Copy, PartialEq)]
enum Told {
    Grave,
    Note,
    /// Only that a turn about the vertical is not judged, as it is of the right import.
    NotJudged,
    Silent,
    /// Nothing, but no angle has changed by more than its uncertainty.
    Harmless,
}

/// Returns whether both flagella wrap, the kind of finding, and its text.
fn told(fault: &str, motion: &Motion, seed: u64) -> (bool, Told, String) {
    let mut random = Random(5000 + seed, 0);
    let way = Way::of(&mut random);
    let clean = rows(&motion.truth, way);
    let of = |rows: &Rows| import(&noisy(rows, way, &mut Random(9000 + seed, 0)), way, motion);
    let [right, wrong] = [of(&clean), of(&spoilt(fault, &clean, way, &mut random))];
    let [a, b] = [&right, &wrong].map(|trial| trial.steady_angles().unwrap());
    let off = [a.yaw_deg - b.yaw_deg, a.pitch_deg - b.pitch_deg, a.roll_deg - b.roll_deg];
    let usual: Vec<String> = right.findings.iter().map(|one| kind_of(&one.text)).collect();
    let new: Vec<_> = wrong.findings.iter().filter(|one| !usual.contains(&kind_of(&one.text))).collect();
    let first = new.iter().find(|one| one.grave).or(new.first());
    let told = match first {
        Some(one) if one.grave => Told::Grave,
        Some(_) => Told::Note,
        None if wrong.not_judged.contains(&super::NO_TURN) => Told::NotJudged,
        None if (0..3).any(|k| off[k].abs() > U_DEG[k]) => Told::Silent,
        None => Told::Harmless,
    };
    (motion.truth.rpm.iter().all(|w| *w <= 0.0), told, first.map_or(String::new(), |one| one.text.clone()))
}
