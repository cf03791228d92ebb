//! Telemetry over the pseudo-terminal is complete, and losses are counted exactly.

use biflag_log::{Body, Reader, TrialMeta};
use host::run::rig::VirtualNano;
use serde_json::Value;
use std::time::Duration;
use tests::{Bench, Cable, Run, board_s, nano, wait_for_line, wait_until};

#[test]
fn half_a_minute_has_no_losses() {
    has_no_losses(30);
}

#[test]
#[ignore = "half a minute for the same promise: part of `make proof`"]
fn two_minutes_have_no_losses() {
    has_no_losses(120);
}

/// Of the samples of a run, 200 a second, none is lost and none is damaged.
fn has_no_losses(run_s: u32) {
    let bench = Bench::new();
    let plan = bench.short_plan(f64::from(run_s), [50.0, 10.0]);
    let mut nano = nano(["--speed", "max"]);
    let port = nano.port().to_owned();
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", &port, "--json"]).expect_code(3);
    let trial = &run.json()["trials"][0];
    println!("{trial}");
    println!("{}", nano.control("status").unwrap());
    assert_eq!(trial["samples"], 200 * run_s);
    // A busy computer may repeat a request.
    for loss in ["lost", "crc_errors", "resyncs"] {
        assert_eq!(trial[loss], 0, "{loss}");
    }
    assert_eq!(trial["complete"], true);
}

/// Waits until the board has spoilt so many frames as `count` of its status says.
fn wait_for_count(nano: &mut VirtualNano, count: &str, frames: u64) {
    wait_until("the frames are spoilt", || nano.control("status").unwrap()[count] == frames);
}

/// Records 10 s (2000 frames) at twice real time, and calls `spoil` when they have begun.
fn spoilt(spoil: impl FnOnce(&mut VirtualNano)) -> Run {
    let bench = Bench::new();
    let plan = bench.short_plan(10.0, [0.0, 0.0]);
    let mut nano = nano(["--speed", "2"]);
    let port = nano.port().to_owned();
    let mut recording = bench.start(["record", plan.to_str().unwrap(), "--port", &port, "--json"]);
    wait_for_line(&mut recording, ": run");
    spoil(&mut nano);
    Run::of(recording)
}

/// Returns the trial of a recording with losses.
fn trial_of(run: Run) -> Value {
    let trial = run.expect_code(3).json()["trials"][0].clone();
    println!("{trial}");
    trial
}

/// Dropped frames are counted exactly, and the exit code reports the loss.
#[test]
fn dropped_frames_are_counted() {
    let mut dropped = 0_u64;
    let run = spoilt(|nano| {
        for frames in [1, 7, 30] {
            nano.control(&format!("drop {frames}")).unwrap();
            dropped += frames;
            wait_for_count(nano, "frames_dropped", dropped);
        }
    });
    let trial = trial_of(run);
    assert_eq!(trial["lost"], dropped);
    assert_eq!(trial["samples"], 2000 - dropped);
    assert_eq!(trial["crc_errors"], 0);
}

/// Frames are missing up to the end of the trial and beyond: those of the trial are counted.
#[test]
fn frames_dropped_at_the_end_are_counted() {
    let drop_to_the_end = |nano: &mut VirtualNano| {
        // The run of 10 s has just begun.
        let end_is_near_s = board_s(nano) + 9.0;
        nano.control(&format!("fault no-frames=1200@{end_is_near_s}")).unwrap();
    };
    // A busy computer may be too late for that, or so slow that the board is silent for a second of the computer's time.
    let trial = trial_of((0..5).map(|_| spoilt(drop_to_the_end)).find(|run| run.code == Some(3)).expect("in time"));
    let count = |key: &str| trial[key].as_u64().unwrap();
    assert!(count("lost") > 0 && count("lost") < 240, "{trial}");
    assert_eq!(count("samples") + count("lost"), 2000, "{trial}");
}

/// `FRAMES=1000000 cargo test --release -p tests --test all link::frames_dropped_at_random -- --nocapture` records more than the usual 5000.
#[test]
fn frames_dropped_at_random_are_counted_exactly() {
    let frames: u64 = std::env::var("FRAMES").map_or(5000, |frames| frames.parse().expect("FRAMES is a number"));
    let bench = Bench::new();
    let plan = bench.short_plan(frames as f64 / 200.0, [0.0, 0.0]);
    let mut nano = nano(["--speed", "max"]);
    let port = nano.port().to_owned();
    let mut recording = bench.start(["record", plan.to_str().unwrap(), "--port", &port, "--json"]);
    wait_for_line(&mut recording, ": run");
    let ticks = |nano: &mut VirtualNano| nano.control("status").unwrap()["ticks"].as_u64().unwrap();
    let begun = ticks(&mut nano);
    let (mut dropped, mut random) = (0, 1u64);
    // All frames that are dropped must be in the trial, which began some hundred ticks ago.
    // Most frames arrive, however slow the board: it is not silent.
    let mut next = begun;
    loop {
        let now = ticks(&mut nano);
        if now - begun >= frames - 3000 {
            break;
        }
        if now >= next {
            random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let count = 1 + (random >> 61);
            nano.control(&format!("drop {count}")).unwrap();
            dropped += count;
            next = now + 50;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(dropped > 0);
    let trial = Run::of(recording).expect_code(3).json()["trials"][0].clone();
    println!("{dropped} frames dropped: {trial}");
    assert_eq!((&trial["lost"], &trial["samples"]), (&dropped.into(), &(frames - dropped).into()), "{trial}");
}

/// A damaged frame counts as one lost sample and one resync.
#[test]
fn damaged_byte_loses_one_frame() {
    let trial = trial_of(spoilt(|nano| {
        nano.control("corrupt 1").unwrap();
        wait_for_count(nano, "frames_corrupted", 1);
    }));
    assert_eq!(trial["lost"], 1);
    assert_eq!(trial["resyncs"], 1);
    assert_eq!(trial["samples"], 1999);
}

/// Bytes that arrive twice are no loss, and frames that do are counted.
#[test]
fn frames_that_come_twice_are_left_out() {
    let bench = Bench::new();
    let plan = bench.short_plan(10.0, [0.0, 0.0]);
    let nano = nano(["--speed", "4"]);
    let cable = Cable::new(nano.port());
    let mut partial = Vec::new();
    let mut frames = 0;
    cable.spoil_from_board(move |bytes| {
        partial.extend_from_slice(bytes);
        let whole = partial.iter().rposition(|byte| *byte == 0).map_or(0, |last| last + 1);
        let group: Vec<u8> = partial.drain(..whole).collect();
        frames += group.iter().filter(|byte| **byte == 0).count();
        // Now and then everything that came together, so that older frames follow newer ones.
        if frames % 7 == 0 { [&*group, &*group].concat() } else { group }
    });
    let run = bench.run(["record", plan.to_str().unwrap(), "--port", cable.port(), "--json"]).expect_code(0);
    let trial = &run.json()["trials"][0];
    println!("{trial}");
    assert_eq!((&trial["samples"], &trial["lost"]), (&2000.into(), &0.into()), "{trial}");
    assert!(trial["repeated"].as_u64().unwrap() > 20, "{trial}");
}

/// A motor reverses at the planned time of the board's clock, and its flagellum follows. The board has its gyroscope's bias, as
/// after an earlier calibration.
#[test]
fn motor_reverses_during_the_run() {
    let bench = Bench::new();
    let plan = "[session]\nname = \"bench\"\n[board]\ndeadline_ms = 5000\ngyro_bias_counts = [-9, -655, 23]\n[trial]\ncalibrate = 0\npreroll = 1\nrest_at_most = 0\nrun = 6\ndecay = 1\n\
                reverse = { motor = 2, after = 2.5 }\n[speeds]\npairs = [[50, 60]]\n";
    let plan = bench.file("plan.toml", plan);
    let nano = nano(["--speed", "max"]);
    let arguments = ["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--json"];
    let trial = bench.run(arguments).expect_unsettled().json()["trials"][0].clone();
    assert_eq!((&trial["samples"], &trial["complete"]), (&1600.into(), &true.into()), "{trial}");
    let mut log = Reader::open(&bench.path().join(trial["log"].as_str().unwrap())).unwrap();
    let (mut told, mut frames, mut phases) = (None, Vec::new(), Vec::new());
    for message in log.by_ref() {
        match message.unwrap().body {
            Body::Telemetry(frame) => frames.push(frame),
            Body::Event(event) if event.text == "motor 2 reverses: from here on +50 and -60 rpm" => {
                told = frames.last().map(|frame| frame.time_s);
            }
            Body::Event(event) if ["preroll", "run", "decay", "end"].contains(&event.text.as_str()) => {
                phases.push(event.text);
            }
            _ => {}
        }
    }
    assert_eq!(phases, ["preroll", "run", "decay", "end"], "the run is one phase");
    let told = told.expect("the event");
    assert!((3.49..3.51).contains(&told), "{told} s");
    let motor2 = |time: f64| frames.iter().find(|frame| frame.time_s >= time).unwrap().motor2.unwrap();
    assert_eq!((motor2(3.4).target_rpm, motor2(6.9).target_rpm), (60.0, -60.0));
    assert!((motor2(3.4).speed_rpm - 60.0).abs() < 3.0 && (motor2(6.9).speed_rpm + 60.0).abs() < 3.0);
    let late = frames.iter().find(|frame| frame.motor2.as_ref().unwrap().target_rpm == -60.0).unwrap().time_s - 3.5;
    println!("reversed {:.3} ms of the board's time after it was due", late * 1e3);
    assert!(late.abs() < 0.5e-3, "{late} s");
    let meta = log.meta::<TrialMeta>().unwrap();
    assert_eq!((meta.reverse_motor, meta.reverse_after_s), (Some(2), Some(2.5)));
}
