//! `biflag steer` on the emulated board, without a rest before the run.

use biflag_log::schema::biflag::Steering;
use biflag_log::{Body, End, Reader, summary};
use rustix::process::Signal;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tests::{Bench, Run, logs, signal, wait_for_line};

/// Turns both flagella at speeds that depend on the yaw, and notes what it reads.
const POLICY: &str = "while read line; do echo \"$line\" >> observed; y=${line#*'\"yaw_deg\":'}; y=${y%%.*}; \
                      echo \"{\\\"speeds_rpm\\\": [$((30 - y % 7)), 20]}\"; done";

/// Arguments of a run on a board that waits for the program.
fn lock_step<'a>(out: &'a str, policy: &'a str, run_s: &'a str) -> Vec<&'a str> {
    let attitude = ["steer", "--yaw=-50", "--pitch=-1", "--json", "--out", out];
    let board = ["--virtual", "--lock-step", "--rest", "0", "--for", run_s, "--policy", policy];
    [&attitude[..], &board].concat()
}

pub fn set_points(log: &Path) -> Vec<Steering> {
    let messages = Reader::open(log).unwrap().map(Result::unwrap);
    messages
        .filter_map(|message| if let Body::Steering(set_point) = message.body { Some(*set_point) } else { None })
        .collect()
}

pub fn log_of(run: &Run, bench: &Bench) -> PathBuf {
    bench.path().join(run.json()["log"].as_str().unwrap())
}

/// What a policy saw does not depend on the load of the computer, and its log has the same set-points.
#[test]
fn two_runs_in_lock_step_agree_bit_for_bit() {
    let observed = |out: &str| {
        let bench = Bench::new();
        let run = bench.run(lock_step(out, POLICY, "4"));
        let json = run.json();
        assert_eq!((json["steps"].as_u64(), json["late_steps"].as_u64()), (Some(80), Some(0)), "{json}");
        let of_log: Vec<_> =
            set_points(&log_of(&run, &bench)).iter().map(|s| (s.observed_us, s.in_force_us, s.yaw_deg)).collect();
        (std::fs::read_to_string(bench.path().join("observed")).unwrap(), of_log)
    };
    let begun = std::thread::scope(|scope| {
        let other = scope.spawn(|| observed("one"));
        (observed("two"), other.join().unwrap())
    });
    assert_eq!(begun.0, begun.1);
    let (lines, of_log) = begun.0;
    assert_eq!((lines.lines().count(), of_log.len()), (80, 80));
    let last: Value = serde_json::from_str(lines.lines().last().unwrap()).unwrap();
    assert!(last["yaw_deg"].as_f64().unwrap() < -5.0 && last["turns"][0].as_f64().unwrap() > 1.0, "{last}");
}

/// A policy that dies, is silent or writes nonsense stops the motors; the log is kept and says why.
#[test]
fn failing_policy_stops_the_motors_and_leaves_a_log() {
    let good =
        "read line; echo '{\"speeds_rpm\": [40, 20]}'; read line; echo '{\"speeds_rpm\": [41, 20]}'; read line; ";
    for (then, reason) in [
        ("kill -9 $$", "signal: 9"),
        ("exit 0", "the policy ended"),
        ("echo '{\"speeds_rpm\": [NaN, 0]}'", "NaN"),
        ("echo hello", "hello"),
        ("echo '{\"speeds_rpm\": [500, 0]}'", "500 and 0 rpm"),
    ] {
        let bench = Bench::new();
        let policy = format!("{good}{then}");
        let run = bench.run(lock_step("run", &policy, "60")).expect_code(1);
        let error = run.json()["error"].as_str().unwrap().to_owned();
        assert!(error.contains(reason), "{then}: {error}");
        let log = log_of(&run, &bench);
        let end = summary(&log).unwrap().unwrap();
        assert!(end.end == End::Failed && end.reason.contains(reason), "{end:?}");
        let targets: Vec<_> = set_points(&log).iter().map(|s| [s.target1_rpm, s.target2_rpm]).collect();
        assert_eq!(targets, [[40.0, 20.0], [41.0, 20.0]], "{then}");
    }
}

/// A time without a reading that the board bridged is a finding of a steered run, too.
#[test]
fn gap_of_the_sensor_is_named_at_the_end() {
    let bench = Bench::new();
    let mut arguments = lock_step("run", "while read line; do echo '{\"speeds_rpm\": [50, 10]}'; done", "3");
    // The board tries again in each tick, so that 34 transactions are 0.17 s.
    arguments.extend(["--fault", "nack=0,34@2"]);
    let json = bench.run(arguments).expect_code(3).json();
    let findings = json["findings"].as_array().unwrap();
    let gap = findings.iter().find(|finding| finding["text"].as_str().unwrap().contains("no reading for 0.1"));
    assert_eq!(gap.unwrap_or_else(|| panic!("no gap: {json}"))["grave"], true);
}

/// Ctrl-C stops the motors and closes the log.
#[test]
fn interrupted_run_is_closed() {
    let bench = Bench::new();
    let mut child = bench.start(["steer", "--yaw=-50", "--pitch=-1", "--virtual", "--rest", "0", "--out", "run"]);
    wait_for_line(&mut child, ": run");
    signal(&child, Signal::INT);
    Run::of(child).expect_code(130);
    let log = &logs(&bench.path().join("run"))[0];
    assert_eq!(summary(log).unwrap().unwrap().end, End::Aborted);
}

/// What disturbs the rig while it steers is made up for: the means over the last 30 s are those without it.
#[test]
#[ignore = "ten minutes of the emulated board"]
fn disturbed_run_recovers() {
    let held = |fault: Option<&str>| {
        let bench = Bench::new();
        let mut arguments =
            vec!["steer", "--yaw=-40", "--pitch", "3", "--virtual", "--lock-step", "--out", "run", "--json"];
        arguments.extend(fault.iter().flat_map(|fault| ["--fault", fault]));
        let json = bench.run(arguments).json();
        let value = |key: &str| json[key].as_f64().unwrap_or_else(|| panic!("no {key}: {json}"));
        let held = ["mean_yaw_deg", "mean_pitch_deg", "reached_s", "late_steps"].map(value);
        println!("| {} | {:.2} | {:.2} | {:.1} | {} |", fault.unwrap_or("none"), held[0], held[1], held[2], held[3]);
        held
    };
    println!(
        "| disturbance | mean yaw, ° | mean pitch, ° | reached, s | late steps |\n| --- | --- | --- | --- | --- |"
    );
    let [yaw_deg, pitch_deg, ..] = held(None);
    let faults = ["motor-supply=5@100", "no-frames=100@100", "frames-lost=10@0.5", "push=20,2@100", "push=20,3@100"];
    for fault in faults {
        let [yaw, pitch, ..] = held(Some(fault));
        assert!((yaw - yaw_deg).abs() < 0.5 && (pitch - pitch_deg).abs() < 0.5, "{fault}: {yaw}, {pitch}");
    }
}

/// The log of a steered run is an ordinary one: it is replayed with the speeds that it had, and compared.
#[test]
fn steered_model_is_replayed_and_compared() {
    let bench = Bench::new();
    let run = bench.run(["steer", "--yaw=-67", "--pitch=-4", "--model", "--out", "run", "--json"]).expect_code(0);
    let json = run.json();
    let error = |key: &str, wanted: f64| (json[key].as_f64().unwrap() - wanted).abs();
    assert!(error("mean_yaw_deg", -67.0) < 0.5 && error("mean_pitch_deg", -4.0) < 0.5, "{json}");
    bench.run(["info", "run", "--json"]).expect_code(0);
    bench.run(["report", "run"]).expect_code(0);
    let replay = bench.run(["simulate", "--from", "run", "--out", "replay", "--json"]).expect_code(0).json();
    let trial = &replay["trials"][0];
    assert!((trial["yaw_deg"].as_f64().unwrap() + 67.0).abs() < 0.5, "{trial}");
    let compared = bench.run(["compare", "run", "--json"]).expect_code(0).json();
    assert!(compared["trials"][0]["yaw_rmse_deg"].as_f64().unwrap() < 0.3, "{compared}");
}

/// An attitude out of reach is wrong use, before anything turns.
#[test]
fn impossible_attitude_is_refused() {
    let bench = Bench::new();
    let run = bench.run(["steer", "--yaw=-20", "--pitch=60", "--model"]);
    tests::expect_error(&run, 2, &["out of reach", "biflag aim"]);
    assert!(logs(bench.path()).is_empty());
}
