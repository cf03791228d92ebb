//! The stream over the pseudo-terminal: complete, and exact in its account of what is not.

use host::rig::VirtualNano;
use serde_json::Value;
use std::time::Duration;
use tests::{Bench, Run, nano};

/// 120 s at 200 Hz: 24,000 samples, none lost, none damaged.
#[test]
fn two_minutes_come_through_whole() {
    let bench = Bench::new();
    let plan = bench.short_plan(120.0, [50.0, 10.0]);
    let mut nano = nano(["--speed", "max"]);
    let port = nano.port().to_owned();
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", &port, "--json"]).expect_code(0);
    let trial = &run.json()["trials"][0];
    println!("{trial}");
    println!("{}", nano.control("status").unwrap());
    assert_eq!(trial["samples"], 24_000);
    for loss in ["lost", "crc_errors", "resyncs", "retries"] {
        assert_eq!(trial[loss], 0, "{loss}");
    }
    assert_eq!(trial["complete"], true);
}

/// Records 20 s (4000 frames) at four times real time, and calls `spoil` in the middle; answers the trial.
fn spoilt(spoil: impl FnOnce(&mut VirtualNano)) -> Value {
    let bench = Bench::new();
    let plan = bench.short_plan(20.0, [0.0, 0.0]);
    let mut nano = nano(["--speed", "4"]);
    let port = nano.port().to_owned();
    let recording = bench.start(["record", plan.to_str().unwrap(), "--port", &port, "--json"]);
    std::thread::sleep(Duration::from_millis(1500));
    spoil(&mut nano);
    let trial = Run::of(recording).expect_code(3).json()["trials"][0].clone();
    println!("{trial}");
    trial
}

/// Frames dropped on purpose are counted exactly, and the command says that there was loss.
#[test]
fn frames_dropped_on_purpose_are_counted() {
    let mut dropped = 0;
    let trial = spoilt(|nano| {
        for frames in [1, 7, 30] {
            nano.control(&format!("drop {frames}")).unwrap();
            dropped += frames;
            std::thread::sleep(Duration::from_millis(300));
        }
    });
    assert_eq!(trial["lost"], dropped);
    assert_eq!(trial["samples"], 4000 - dropped);
    assert_eq!(trial["crc_errors"], 0);
}

/// A damaged frame is a lost sample and a resync, and no more than that.
#[test]
fn a_damaged_byte_costs_one_frame() {
    let trial = spoilt(|nano| {
        nano.control("corrupt 1").unwrap();
    });
    assert_eq!(trial["lost"], 1);
    assert_eq!(trial["resyncs"], 1);
    assert_eq!(trial["samples"], 3999);
}

/// The stream that a board at its own pace sends is as complete.
#[test]
fn real_time_is_as_whole() {
    let bench = Bench::new();
    let plan = bench.short_plan(10.0, [-90.0, 90.0]);
    let nano = nano(["--speed", "1"]);
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--json"]).expect_code(0);
    let trial = &run.json()["trials"][0];
    assert_eq!((&trial["samples"], &trial["lost"]), (&2000.into(), &0.into()), "{trial}");
}
