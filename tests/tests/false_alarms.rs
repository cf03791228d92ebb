//! How often a comparison finds a difference where there is none. The example `false_alarms` prints more.

use host::plan::Phases;
use host::trial::Judged;
use host::twin::{Comparison, OnMismatch, compare};
use sim::params::Robot;
use tests::synthetic_rig::{Lot, Motion, Part, Random, Rig, Start, each};
use tests::whole_computer;

const TRIALS: usize = 100;

/// 100 trials at each point, each with another measured sensor: `cargo test --release -p tests --test all false_alarms --
/// --ignored --nocapture`, a minute on two cores.
#[test]
#[ignore = "takes a minute"]
fn same_robot_differs_by_chance_alone() {
    let _whole = whole_computer();
    let phases = Phases::default();
    let points = [[50.0, 10.0], [-90.0, 90.0], [90.0, 90.0], [0.0, 45.0], [37.3, 52.9], [-45.96, 63.73]];
    let mut all = Vec::new();
    for (i, rpm) in points.into_iter().enumerate() {
        let motion = Motion::of(&Robot::default(), rpm, phases.run_s);
        let model = Judged::of(motion.model(&phases));
        let of_point = each(TRIALS, |seed| {
            let mut random = Random((31_000 + 1_000 * i + seed) as u64);
            let part = Part::of(Lot::Typical, &mut random);
            let measured = Some(part.measured(&mut random));
            let recording = Rig { part, measured, phases, start: Start::AtRest }.record(&motion, &mut random);
            compare(&Judged::of(recording.data), &model, OnMismatch::Warn).unwrap().comparison
        });
        println!("{rpm:?} rpm: {:?} % of yaw, pitch, roll", alarms(&of_point));
        all.extend(of_point);
    }
    let found = alarms(&all);
    println!("all: {found:?} %");
    assert!(found.iter().all(|percent| (3.0..=7.0).contains(percent)), "{found:?}");
    let transients = percent(&all, |one| !one.transients_agree());
    println!("transients: {transients} %");
    assert!(transients < 7.0, "{transients}");
}

fn percent(all: &[Comparison], of: impl Fn(&Comparison) -> bool) -> f64 {
    100.0 * all.iter().filter(|one| of(one)).count() as f64 / all.len() as f64
}

fn alarms(all: &[Comparison]) -> [f64; 3] {
    ["yaw", "pitch", "roll"]
        .map(|angle| percent(all, |one| one.differences.iter().any(|difference| difference.angle == angle)))
}
