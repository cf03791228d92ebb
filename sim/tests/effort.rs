//! Effort of the solver: steps, sweeps and inverses of short trials, which are those of `effort.txt` on every processor.
//!
//! `BIFLAG_WRITE_GOLDEN=1 cargo test --release -p sim --test all effort` writes the file again; its diff shows what a change of
//! the method costs.

use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::fmt::Write;

/// Duration of a trial, s.
const RUN_S: f64 = 4.0;

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

#[test]
fn steps_sweeps_and_inverses_are_those_of_before() {
    let mut now = String::new();
    for name in ["published", "physical"] {
        let robot = Robot::built_in(name).expect(name);
        for rpm in SPEEDS {
            let profile = SpeedProfile::constant(rpm, RUN_S).expect("a profile");
            let mut trial = Trial::new(&robot, Closure::Full, profile, Options::default()).expect("parameters");
            let summary = trial.finish().expect("a run");
            let inverses = trial.solver().inverses_used();
            writeln!(now, "{name} {} {} {} {} {inverses}", rpm[0], rpm[1], summary.steps, summary.sweeps)
                .expect("a string");
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/effort.txt");
    if std::env::var_os("BIFLAG_WRITE_GOLDEN").is_some() {
        std::fs::write(path, &now).expect("a file");
    }
    assert_eq!(now, std::fs::read_to_string(path).expect("a file"));
}
