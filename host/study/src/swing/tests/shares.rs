//! Shares of labels that are judged, and of speeds that are told, over a population of motions.

use super::*;
use rayon::prelude::*;
use sim::params::Tank;
use std::collections::BTreeMap;
use std::fmt;

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
            let of = |(i, truth): (usize, &Truth)| {
                let trace = Trace::of(truth, way, i as u64);
                let mut labels = Counts::new();
                for part_s in &parts_s {
                    let rpm = truth.rpm.map(|rpm| rpm * trace.speed(part_s));
                    count_labels(&trace, part_s, rpm, &mut labels);
                }
                labels
            };
            let labels = truths.par_iter().enumerate().map(of).reduce(Counts::new, |mut sum, labels| {
                for (name, counts) in labels {
                    let sum = sum.entry(name).or_default();
                    (0..4).for_each(|i| sum[i] += counts[i]);
                }
                sum
            });
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
