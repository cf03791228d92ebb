//! Effort of the solver: steps, sweeps and inverses of short trials, against those of `effort.txt`.
//!
//! `BIFLAG_WRITE_GOLDEN=1 cargo test --release -p sim --test all effort` writes the file again; its diff shows what a change of
//! the method costs. Processors round differently, so counts may differ by a little.

use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::fmt::Write;

/// Duration of a trial, s.
const RUN_S: f64 = 4.0;
/// Largest share by which the total of a count may differ, ...
const TOTAL: f64 = 0.02;
/// ... and a single one, beside the number below.
const SINGLE: f64 = 0.1;
const FEW: f64 = 3.0;

const SPEEDS: [[f64; 2]; 10] = [
    [50.0, 10.0],
    [0.0, 45.0],
    [90.0, 90.0],
    [-90.0, 90.0],
    [37.3, 52.91],
    [12.52, -8.65],
    [70.38, 48.79],
    [-45.96, -63.73],
    [-90.0, -80.0],
    [1.0, 90.0],
];

/// Steps, sweeps and inverses.
type Counts = [f64; 3];

fn counts(robot: &Robot, rpm: [f64; 2]) -> Counts {
    let profile = SpeedProfile::constant(rpm, RUN_S).expect("a profile");
    let mut trial = Trial::new(robot, Closure::Full, profile, Options::default()).expect("parameters");
    let summary = trial.finish().expect("a run");
    [summary.steps as f64, summary.sweeps as f64, trial.solver().inverses_used() as f64]
}

fn parse(line: &str) -> (String, Counts) {
    let words: Vec<&str> = line.split_whitespace().collect();
    let count = |i: usize| words[i].parse().expect("a count");
    (words[..3].join(" "), [count(3), count(4), count(5)])
}

#[test]
fn steps_sweeps_and_inverses_are_those_of_before() {
    let mut now = String::new();
    for name in ["published", "physical"] {
        let robot = Robot::built_in(name).expect(name);
        for rpm in SPEEDS {
            let [steps, sweeps, inverses] = counts(&robot, rpm);
            writeln!(now, "{name} {} {} {steps} {sweeps} {inverses}", rpm[0], rpm[1]).expect("a string");
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/effort.txt");
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        std::fs::write(path, &now).expect("a file");
    }
    let before = std::fs::read_to_string(path).expect("a file");
    println!("{now}");
    let (mut totals, mut totals_before) = ([0.0; 3], [0.0; 3]);
    assert_eq!(now.lines().count(), before.lines().count());
    for (now, before) in now.lines().zip(before.lines()) {
        let ((case, counts), (case_before, counts_before)) = (parse(now), parse(before));
        assert_eq!(case, case_before);
        for i in 0..3 {
            let (count, count_before): (f64, f64) = (counts[i], counts_before[i]);
            assert!((count - count_before).abs() <= SINGLE * count_before + FEW, "{now}, before {before}");
            totals[i] += count;
            totals_before[i] += count_before;
        }
    }
    for (total, total_before) in totals.into_iter().zip(totals_before) {
        assert!((total - total_before).abs() <= TOTAL * total_before + FEW, "{totals:?}, before {totals_before:?}");
    }
}
