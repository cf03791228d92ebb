//! Angles of the flagella: `align`, plans with starting phases, and what a log says of them.

use biflag_log::{BoardMeta, Body, Reader, last_meta};
use std::io::Write;
use std::path::Path;
use std::process::Stdio;
use tests::{Bench, Run, expect_error, logs, nano};

/// Runs `align` with these lines as its keys.
fn align(bench: &Bench, port: &str, keys: &str) -> Run {
    let mut child = bench.command(["align", "--port", port, "--json"]).stdin(Stdio::piped()).spawn().expect("biflag");
    child.stdin.take().expect("its input").write_all(keys.as_bytes()).expect("keys");
    Run::of(child)
}

/// Turns of both flagella in the first frame of a log, and their true ones, if it has them.
fn first_turns(log: &Path) -> ([f64; 2], Option<[f64; 2]>) {
    let messages = Reader::open(log).expect("a log");
    let (mut told, mut truth) = (None, None);
    for message in messages.flatten() {
        match message.body {
            Body::Telemetry(frame) => {
                let turns = |motor: Option<biflag_log::schema::biflag::Motor>| motor.expect("a motor").turns;
                told.get_or_insert([turns(frame.motor1), turns(frame.motor2)]);
            }
            Body::Truth(sample) => {
                truth.get_or_insert([sample.motor1_turns, sample.motor2_turns]);
            }
            _ => {}
        }
    }
    (told.expect("a frame"), truth)
}

/// Difference of angles given in turns, degrees, -180 to 180.
fn apart_deg(turns: f64, angle_deg: f64) -> f64 {
    let apart = turns - angle_deg / 360.0;
    (apart - apart.round()) * 360.0
}

const PLAN: &str = "[session]\nname = \"phases\"\n[trial]\ncalibrate = 0\npreroll = 0\nrun = 3\ndecay = 1\n\
                    phase_deg = [30, -110]\n[speeds]\npairs = [[41.5, -33], [-90, 90]]\n";

#[test]
fn trials_of_the_emulated_board_start_at_the_angles_of_their_plan() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    bench.run(["record".as_ref(), plan.as_os_str(), "--virtual".as_ref()]).expect_code(3);
    for log in logs(&bench.path().join("phases")) {
        let (told, truth) = first_turns(&log);
        let board = last_meta::<BoardMeta>(&log).unwrap().unwrap();
        let known = board.angle_deg.expect("known angles");
        let truth = truth.expect("the truth of a simulated robot");
        for (k, wanted) in [30.0, -110.0].into_iter().enumerate() {
            let apart = [told[k], truth[k], known[k] / 360.0].map(|turns| apart_deg(turns, wanted));
            // The board turns to within two counts, 1.2 degrees; truth and counts are within one.
            assert!(apart.iter().all(|apart| apart.abs() < 1.8), "{apart:?} in {}", log.display());
        }
    }
}

#[test]
fn a_plan_with_phases_needs_an_aligned_board() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    let nano = nano(["--speed", "max"]);
    let record = |out: &str| {
        bench.run([
            "record".as_ref(),
            plan.as_os_str(),
            "--port".as_ref(),
            nano.port().as_ref(),
            "--out".as_ref(),
            out.as_ref(),
        ])
    };
    expect_error(&record("a"), 1, &["does not know the angles of its flagella", "`biflag align --port"]);
    assert!(!bench.path().join("a").exists());

    let quit = align(&bench, nano.port(), "f\nq\n").expect_code(130).json();
    assert_eq!((&quit["aligned"], &quit["angles_known"]), (&false.into(), &false.into()));
    let wrong = align(&bench, nano.port(), "x\n");
    assert!(wrong.code == Some(130) && wrong.stderr.contains("other keys"), "{wrong:?}");

    let aligned = align(&bench, nano.port(), "ff+\n2b-\nok\n").expect_code(0).json();
    assert_eq!((&aligned["aligned"], &aligned["angles_known"]), (&true.into(), &true.into()));
    tests::golden::hold_keys("align", &aligned);
    // A step ends within two counts of its goal, 1.2 degrees.
    let turned = [0, 1].map(|k| aligned["turned_deg"][k].as_f64().unwrap());
    assert!((turned[0] - 20.6).abs() < 4.0 && (turned[1] + 10.6).abs() < 3.0, "{turned:?}");

    record("b").expect_code(3);
    for log in logs(&bench.path().join("b")) {
        let (told, _) = first_turns(&log);
        assert!(apart_deg(told[0], 30.0).abs() < 1.8 && apart_deg(told[1], -110.0).abs() < 1.8, "{told:?}");
    }
    let doctor = bench.run(["doctor", "--port", nano.port(), "--json"]);
    assert!(doctor.stdout.contains("from their marks"), "{}", doctor.stdout);
}
