//! Resuming sessions.

use biflag_log::Body;
use protocol::frame::Accumulator;
use protocol::{Command as Order, Request};
use rustix::process::Signal;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};
use tests::{
    Bench, Cable, Run, is_driven, logs, nano, pass, program, signal, wait_for_line, wait_for_logs, wait_for_motion,
    wait_until, while_held,
};

/// The motors' deadline is the longest one, because other programs may delay the pings.
fn plan(calibrate: f64, run: f64) -> String {
    format!(
        "[session]\nname = \"bench\"\n[board]\ndeadline_ms = 5000\ngyro_bias_counts = [-9, -655, 23]\n[trial]\ncalibrate = {calibrate}\npreroll = 1\nrest_at_most = 0\nrun = {run}\ndecay = 0\n\
         [speeds]\npairs = [[50, 10], [-30, 30]]\n"
    )
}

fn record<'a>(plan: &'a Path, port: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["record", plan.to_str().unwrap(), "--port", port, "--out", "session", "--json"], more].concat()
}

#[track_caller]
fn expect_complete(run: &Run, trials: usize) {
    let json = run.json();
    let trials_run = json["trials"].as_array().unwrap();
    assert_eq!(trials_run.len(), trials, "{json}");
    assert!(trials_run.iter().all(|trial| trial["complete"] == true && trial["lost"] == 0), "{json}");
}

/// A running recording locks its session; a killed one leaves the board streaming and can be resumed at once.
#[test]
fn session_has_one_writer_and_resumes_after_a_kill() {
    let bench = Bench::new();
    // Long enough for the two commands that are refused, on a busy machine too.
    let plan = bench.file("plan.toml", &plan(0.0, 10.0));
    let [mut first, second] = [nano(["--speed", "3"]), nano(["--speed", "4"])];
    let port = first.port().to_owned();
    let recording = bench.start(record(&plan, &port, &[]));
    wait_for_logs(&bench.path().join("session"), 1);

    let run = bench.run(record(&plan, second.port(), &["--resume"])).expect_code(1);
    assert!(run.stderr.contains("another biflag is writing into this session"), "{run:?}");
    let run = bench.run(["simulate", plan.to_str().unwrap(), "--out", "session", "--resume"]).expect_code(1);
    assert!(run.stderr.contains("another biflag is writing into this session"), "{run:?}");
    assert_eq!(logs(&bench.path().join("session")).len(), 1);

    wait_for_motion(&mut first);
    signal(&recording, Signal::KILL);
    let _ = Run::of(recording);
    let sent = first.control("status").unwrap()["frames_sent"].as_u64().unwrap();
    wait_until("the board streams on", || first.control("status").unwrap()["frames_sent"].as_u64().unwrap() > sent);
    let run = bench.run(record(&plan, &port, &["--resume"])).expect_unsettled();
    expect_complete(&run, 2);
    assert_eq!(logs(&bench.path().join("session")).len(), 3, "the cut-off log is kept");
}

#[test]
fn trial_interrupted_during_calibration_is_repeated() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", &plan(5.0, 2.0));
    // Slow, so that the signal comes in time from a busy computer, too.
    let mut slow = nano(["--speed", "0.5"]);
    let port = slow.port().to_owned();
    let mut recording = bench.start(record(&plan, &port, &[]));
    wait_for_line(&mut recording, ": calibrate");
    signal(&recording, Signal::INT);
    let run = Run::of(recording).expect_code(130);
    assert_eq!(run.json()["trials"][0]["complete"], false, "{run:?}");
    assert!(!is_driven(&mut slow));

    // Another one with the same settings.
    let nano = nano(["--speed", "max"]);
    let run = bench.run(record(&plan, nano.port(), &["--resume"])).expect_unsettled();
    expect_complete(&run, 2);
    let logs = logs(&bench.path().join("session"));
    let info = |log: &Path, code| bench.run(["info", log.to_str().unwrap(), "--json"]).expect_code(code).json();
    assert_eq!((logs.len(), &info(&logs[0], 3)["end"]), (3, &"complete".into()), "attempt 2 sorts first: {logs:?}");
    assert_eq!(info(&logs[1], 3)["end"], "aborted");
}

/// A calibration shorter than the board can do takes as long as the shortest, which is not the computer's fault.
#[test]
fn shortest_calibration_is_no_delay() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", &plan(0.1, 3.0).replace("[50, 10], [-30, 30]", "[50, 10]"));
    // Slow, so that the computer has time for the requests that start the schedule; a busy one may still be late.
    let nano = nano(["--speed", "0.7"]);
    let is_in_time = |attempt: u32| {
        let out = format!("attempt{attempt}");
        let arguments = ["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", &out, "--json"];
        let run = bench.run(arguments).expect_unsettled();
        let trial = &run.json()["trials"][0];
        println!("{trial}");
        assert_eq!(trial["complete"], true);
        let info = bench.run(["info", trial["log"].as_str().unwrap(), "--json"]).expect_unsettled().json();
        let notes = trial["notes"].as_array().unwrap();
        let is_in_time = !notes.iter().any(|note| note.as_str().unwrap().contains("late"));
        // 0.3 s of calibration, then up to 7 s in which the board's filter settles, 1 s before the run, 3 s.
        let settled = info["samples"].as_u64().unwrap() - 860;
        assert!(!is_in_time || settled <= 1400 && settled.is_multiple_of(20), "{info}");
        is_in_time
    };
    assert!((0..5).any(is_in_time), "always late");
}

/// `record` and `info` use the same times of a trial.
#[test]
fn info_agrees_with_record() {
    let bench = Bench::new();
    // The still phases are long enough to estimate the drift.
    let still = plan(1.0, 14.0).replace("preroll = 1", "preroll = 12").replace("decay = 0", "decay = 12");
    let still = still.replace("rest_at_most = 0", "rest_at_most = 60").replace(", [-30, 30]", "");
    let plan = bench.file("plan.toml", &still);
    // It waits for a computer that is busy.
    let nano = nano(["--speed", "max"]);
    let run = bench.run(record(&plan, nano.port(), &[])).expect_unsettled();
    for trial in run.json()["trials"].as_array().unwrap() {
        let info = bench.run(["info", trial["log"].as_str().unwrap(), "--json"]).expect_unsettled().json();
        for key in ["yaw_deg", "pitch_deg", "yaw_uncertainty_deg"] {
            let [said, says] = [trial, &info["angles"]].map(|angles| angles[key].as_f64().unwrap());
            assert!((said - says).abs() < 1e-6, "{key}: {said} and {says}");
        }
        for key in ["run_start_s", "run_end_s"] {
            assert!(trial[key].as_f64().is_some() && trial[key] == info[key], "{key}: {trial} and {info}");
        }
    }
}

/// Returns the slope of the line through these points with the least squares, and the root mean square of its residuals.
fn line(points: &[[f64; 2]]) -> (f64, f64) {
    let mean = |of: &dyn Fn(&[f64; 2]) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
    let [x, y] = [mean(&|point| point[0]), mean(&|point| point[1])];
    let slope = mean(&|point| (point[0] - x) * (point[1] - y)) / mean(&|point| (point[0] - x).powi(2));
    (slope, mean(&|point| (point[1] - y - slope * (point[0] - x)).powi(2)).sqrt())
}

#[test]
fn restart_of_the_board_is_reported_and_ends_the_clock_fit() {
    /// The board's seconds per second, so few that a busy computer is fast enough for its clock.
    const SPEED: f64 = 0.4;
    let bench = Bench::new();
    let plan = bench.file("plan.toml", &plan(0.0, 4.0));
    let mut nano = nano(["--speed", &SPEED.to_string()]);
    let port = nano.port().to_owned();
    // A busy computer delays board and program, the frames like the pings; they may still differ now and then.
    let fits = (0..5).any(|_| {
        let recording = bench.start(record(&plan, &port, &["--resume"]));
        wait_for_motion(&mut nano);
        pass(&mut nano, 2.0);
        nano.control("reset").unwrap();
        let run = Run::of(recording).expect_code(1);
        assert!(run.stderr.contains("the board stopped sending: it restarted"), "{run:?}");
        let log = run.json()["trials"][0]["log"].as_str().unwrap().to_owned();
        let mut reader = biflag_log::Reader::open(&bench.path().join(log)).unwrap();
        let frames: Vec<[f64; 2]> = (reader.by_ref().map(Result::unwrap))
            .filter_map(|message| match message.body {
                Body::Telemetry(frame) => Some([
                    frame.board_time_us as f64 * 1e-6,
                    (message.publish_time_ns % 1_000_000_000_000) as f64 * 1e-9,
                ]),
                _ => None,
            })
            .collect();
        let clock: biflag_log::ClockMeta = reader.meta().unwrap();
        let (rate, residual_s) = line(&frames);
        println!("{clock:?}; frames: {rate} s a second, {residual_s} s");
        let off = (1.0 + clock.drift_ppm * 1e-6) * rate - 1.0;
        off.abs() < 0.02 && clock.residual_us * 1e-6 < 0.02 + residual_s
    });
    assert!(fits, "the clock after the restart is in the fit");
    // Another one with the same settings, as fast as the computer.
    let nano = self::nano(["--speed", "max"]);
    let run = bench.run(record(&plan, nano.port(), &["--resume"])).expect_unsettled();
    expect_complete(&run, 2);
}

/// A board that restarts between its set-points and their start is told from one that refuses them.
#[test]
fn restart_before_the_schedule_starts_is_reported() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", &plan(0.0, 1.0));
    let nano = nano(["--speed", "4"]);
    let cable = Cable::new(nano.port());
    let nano = Arc::new(Mutex::new(nano));
    let (board, mut accumulator, mut has_points, mut is_reset) = (nano.clone(), Accumulator::new(), false, false);
    cable.spoil_to_board(move |bytes| {
        for byte in bytes {
            let Some(Ok(Request { command, .. })) = accumulator.push(*byte) else { continue };
            has_points |= matches!(command, Order::SetPoint { .. });
            if has_points && !is_reset && matches!(command, Order::Stream { .. }) {
                board.lock().unwrap().control("reset").unwrap();
                is_reset = true;
            }
        }
        bytes.to_vec()
    });
    let run = bench.run(record(&plan, cable.port(), &[])).expect_code(1);
    assert!(run.stderr.contains("the board lost its settings before the trial: it restarted"), "{run:?}");
    drop(cable);
}

#[test]
fn session_is_resumed_only_on_the_same_rig() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", &plan(0.0, 1.0).replace("preroll = 1", "preroll = 0"));
    let first = nano(["--speed", "max"]);
    bench.run(["simulate", plan.to_str().unwrap(), "--out", "session"]).expect_code(3);
    let run = bench.run(record(&plan, first.port(), &["--resume"])).expect_code(2);
    assert!(run.stderr.contains("its trials ran in the model") && run.stderr.contains("on the rig"), "{run:?}");
    std::fs::remove_dir_all(bench.path().join("session")).unwrap();

    bench.run(record(&plan, first.port(), &[])).expect_code(3);
    let run = bench.run(["simulate", plan.to_str().unwrap(), "--out", "session", "--resume"]).expect_code(2);
    assert!(run.stderr.contains("its trials ran on the rig"), "{run:?}");
    // Another rig is refused before its motors are measured.
    let emulated = |more: &[&str]| {
        bench.run([&["record", plan.to_str().unwrap(), "--virtual", "--out", "emulated"], more].concat())
    };
    emulated(&[]).expect_code(3);
    let run = emulated(&["--resume", "--rig", "duty"]).expect_code(2);
    assert!(run.stderr.contains("speed_from = \"duty\"") && !run.stderr.contains("measuring"), "{run:?}");
    let settings = bench.file("board.toml", "board_id = 7\n");
    bench.run(["settings", "--port", first.port(), "--write", settings.to_str().unwrap()]).expect_code(0);
    let run = bench.run(record(&plan, first.port(), &["--resume"])).expect_code(2);
    assert!(run.stderr.contains("on board 1") && run.stderr.contains("on board 7"), "{run:?}");
    let settings = bench.file("board.toml", "board_id = 1\ncounts_per_turn = 600\n");
    bench.run(["settings", "--port", first.port(), "--write", settings.to_str().unwrap()]).expect_code(0);
    let run = bench.run(record(&plan, first.port(), &["--resume"])).expect_code(2);
    assert!(run.stderr.contains("counts_per_turn = 600"), "{run:?}");
}

/// A full disk during a trial stops the motors and keeps the written part of the log.
#[test]
fn full_disk_ends_the_trial_and_keeps_its_beginning() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", &plan(0.0, 60.0));
    let mut nano = nano(["--speed", "5"]);
    let port = nano.port().to_owned();
    // A limit on the size of files simulates a full disk; the shell's blocks have 512 bytes.
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' XFSZ; ulimit -f 400; exec \"$@\"", "sh"]).arg(program("biflag"));
    shell.args(record(&plan, &port, &[])).current_dir(bench.path());
    let run = Run::of(shell.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap());
    let run = run.expect_code(1);
    assert!(run.stderr.contains("cannot be written") && run.stderr.contains("make room"), "{run:?}");
    assert!(!is_driven(&mut nano));
    let log = logs(&bench.path().join("session")).remove(0);
    let info = bench.run(["info", log.to_str().unwrap(), "--json"]).expect_code(3).json();
    assert!(info["samples"].as_u64().unwrap() > 200, "{info}");
    let run = bench.run(["recover", log.to_str().unwrap(), "--json"]).expect_code(3);
    assert!(run.json()["messages"].as_u64().unwrap() > 200, "{run:?}");
}

/// While a session is recorded, its log is not cut off, and no copy of its beginning is made.
#[test]
fn log_that_is_being_recorded_is_not_recovered() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", &plan(0.0, 6.0).replace("[50, 10], [-30, 30]", "[50, 10]"));
    let mut nano = nano(["--speed", "4"]);
    let port = nano.port().to_owned();
    let recording = bench.start(record(&plan, &port, &[]));
    wait_for_motion(&mut nano);
    let session = bench.path().join("session");
    let log = logs(&session).remove(0);
    while_held(&recording, || {
        let run = bench.run(["recover", log.to_str().unwrap()]).expect_code(1);
        assert!(run.stderr.contains(": is being recorded") && run.stderr.contains("wait for the end"), "{run:?}");
        let run = bench.run(["recover", log.to_str().unwrap(), "--output", "copy.mcap"]).expect_code(1);
        assert!(run.stderr.contains(": is being recorded"), "{run:?}");
        for asked in
            ["info", "doctor"].map(|command| [command, "session"]).into_iter().chain([["info", log.to_str().unwrap()]])
        {
            let run = bench.run(asked).expect_code(3);
            assert!(run.stdout.contains("being recorded") && !run.stdout.contains("cut off"), "{run:?}");
            assert!(!run.stdout.contains("biflag recover"), "{run:?}");
        }
        assert_eq!(logs(&session), std::slice::from_ref(&log));
    });

    let run = Run::of(recording).expect_unsettled();
    expect_complete(&run, 1);
    let run = bench.run(["recover", log.to_str().unwrap()]).expect_code(0);
    assert!(run.stdout.contains("intact, nothing to recover"), "{run:?}");
    let run = bench.run(["info", "session"]).expect_unsettled();
    assert!(!run.stdout.contains("being recorded"), "{run:?}");
}
