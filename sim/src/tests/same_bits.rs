//! Results have the same bits on every machine: short trials of each kind, by every kind of vector instructions that this
//! machine has, against hashes from another machine.
//!
//! `BIFLAG_WRITE_GOLDEN=1 cargo test --release -p sim --lib same_bits` writes the hashes again, for a change of the model.
//! With `-- --nocapture` it prints the cost of each trial.

use crate::params::{Closure, Precision, Robot, Tank};
use crate::simd::paths;
use crate::steady::{Problem, solve};
use crate::trial::profile::SpeedProfile;
use crate::trial::{Options, Trial};
use serde::Serialize;
use std::time::Instant;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/tests/same_bits.txt");

/// A robot, the speeds of its motors in rpm, and the duration in s.
type Case = (&'static str, Robot, [f64; 2], f64);

/// Short trials, which need not settle.
fn trials() -> [Case; 9] {
    let physical = |change: &dyn Fn(&mut Robot)| {
        let mut robot = Robot::default();
        change(&mut robot);
        robot
    };
    let soft = |young_pa: f64| physical(&|robot| robot.flagellum.young_pa = young_pa);
    let tank = |robot: &mut Robot| robot.tank = Some(Tank::published());
    let double = |robot: &mut Robot| robot.solver.far_field = Precision::Double;
    [
        ("free", physical(&|_| ()), [50.0, 10.0], 2.0),
        ("opposite", physical(&|_| ()), [-70.0, 80.0], 2.0),
        ("touching", Robot::published(), [90.0, 60.0], 4.0),
        ("wrapped", soft(4.3e5), [-90.0, -90.0], 2.5),
        ("self-contact", soft(4e4), [-90.0, 20.0], 4.0),
        ("tank", physical(&tank), [50.0, 10.0], 2.0),
        ("soft", soft(1.5e5), [-80.0, -80.0], 1.5),
        ("published", Robot::published(), [-45.0, 30.0], 2.0),
        ("double", physical(&double), [30.0, 45.0], 1.0),
    ]
}

/// Hashes the output of a trial: its samples, its results and its last state.
fn of_trial((name, robot, rpm, seconds): &Case) -> u64 {
    let profile = SpeedProfile::constant(*rpm, *seconds).expect("a profile");
    let options = Options { shapes: true, ..Options::default() };
    let mut trial = Trial::new(robot, Closure::Full, profile, options).expect("parameters");
    let samples: Vec<_> = trial.by_ref().map(|sample| sample.expect(name)).collect();
    let summary = trial.summary();
    let is_apart = !["touching", "wrapped", "self-contact"].contains(name);
    assert_eq!(summary.largest_contact_n == 0.0, is_apart, "{name}");
    hash(&(samples, summary, trial.checkpoint()))
}

fn of_search() -> u64 {
    let problem = Problem {
        robot: &Robot::default(),
        closure: Closure::Full,
        rpm: [60.0, -60.0],
        start_rad: [0.0; 2],
        longest_s: 5.0,
        output: None,
        at_rest: None,
    };
    let found = solve(&problem, &|_| true).expect("a motion");
    hash(&(found.kind, found.summary, found.simulated_s))
}

/// Hashes a value (FNV-1a). Zero has no sign, and NaN one pattern.
fn hash(value: &impl Serialize) -> u64 {
    let text = [",", "]", "}"].iter().fold(serde_json::to_string(value).expect("JSON"), |text, end| {
        text.replace(&format!("-0.0{end}"), &format!("0.0{end}"))
    });
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[test]
fn results_do_not_depend_on_the_processor() {
    let cases = trials();
    let mut lines = String::new();
    for k in 0..=cases.len() {
        let name = cases.get(k).map_or("search", |case| case.0);
        let hashes: Vec<u64> = (paths::all().into_iter())
            .map(|path| {
                let start = Instant::now();
                let hash = path.with(|| cases.get(k).map_or_else(of_search, of_trial));
                println!("{name:12} {:6.3} s, {hash:016x}, {}", start.elapsed().as_secs_f64(), path.name());
                hash
            })
            .collect();
        assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{name}: the paths of one processor differ");
        lines += &format!("{name} {:016x}\n", hashes[0]);
    }
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        std::fs::write(FILE, &lines).expect("the file of hashes");
    } else {
        assert_eq!(lines, include_str!("same_bits.txt"), "another machine had other bits, or the model has changed");
    }
}
