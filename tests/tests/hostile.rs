//! Trials with a faulty emulated board, from the command line.

use serde_json::Value;
use std::path::{Path, PathBuf};
use tests::{Bench, Run, data};

/// Records 4 s at +50 and +30 rpm on an emulated board with a fault, whose sensor lies still.
fn record(bench: &Bench, fault: &str) -> Run {
    let plan = bench.short_plan(4.0, [50.0, 30.0]);
    let imu = format!("--virtual={}", still(bench).display());
    let plan = plan.to_str().unwrap();
    bench.run(["record", plan, &imu, "--fault", fault, "--out", &format!("session-{fault}"), "--json"])
}

/// The beginning of the recording of a sensor at rest.
fn still(bench: &Bench) -> PathBuf {
    let all = std::fs::read_to_string(data("mpu6050/still-655s.csv")).unwrap();
    let beginning: Vec<&str> = all.lines().take(300).collect();
    bench.file("still.csv", &beginning.join("\n"))
}

fn trial(run: &Run) -> Value {
    run.json()["trials"][0].clone()
}

/// What only delays or stretches is no fault, and loses nothing.
#[test]
fn usb_packets_and_a_resonator_that_is_off_lose_nothing() {
    let bench = Bench::new();
    for fault in ["usb=16,32", "resonator=0.5", "resonator=-0.5", "uneven-poles=20,1"] {
        let run = record(&bench, fault).expect_code(3);
        let trial = trial(&run);
        println!("{fault}: {trial}");
        assert_eq!((&trial["samples"], &trial["complete"]), (&800.into(), &true.into()), "{fault}: {trial}");
        for loss in ["lost", "crc_errors", "resyncs"] {
            assert_eq!(trial[loss], 0, "{fault}: {trial}");
        }
    }
}

/// What stops the board ends the trial with exit code 1, and the message names it.
#[test]
fn a_fault_of_the_board_is_named() {
    let bench = Bench::new();
    for (fault, named) in [
        ("blocked=2@2", "encoder 2"),
        ("gone@2", "IMU"),
        ("brown-out@2", "supply"),
        ("hang=1@2", "restarted"),
        ("pwm-spikes=2,1", "edges a second"),
    ] {
        let run = record(&bench, fault).expect_code(1);
        println!("{fault}: {}", run.stderr.lines().find(|line| line.starts_with("error")).unwrap_or_default());
        assert!(run.stderr.contains(named), "{fault}: {run:?}");
        let trial = &run.json()["trials"][0];
        assert_eq!(trial["complete"], false, "{fault}: {trial}");
        let log = bench.path().join(trial["log"].as_str().unwrap());
        assert_eq!(bench.run([Path::new("info"), &log, Path::new("--json")]).json()["clean"], true, "{fault}");
    }
}

#[test]
fn faults_are_listed_and_a_wrong_one_is_wrong_use() {
    let bench = Bench::new();
    let list = record(&bench, "help").expect_code(0).json();
    assert!(list["faults"].as_str().unwrap().contains("encoder-swapped=MOTOR"), "{list}");
    for (fault, problem) in
        [("jam", "`biflag record --fault help` lists them"), ("blocked=3", "MOTOR must be from 1 to 2, not 3")]
    {
        assert!(record(&bench, fault).expect_code(2).stderr.contains(problem), "{fault}");
    }
    let plan = bench.short_plan(1.0, [0.0, 0.0]);
    let run = bench.run(["record", plan.to_str().unwrap(), "--fault", "gone"]).expect_code(2);
    assert!(run.stderr.contains("--virtual"), "{run:?}");
}
