//! Trials that are interrupted by the user, a pulled cable, or a power cut.

use serde_json::Value;
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tests::{Bench, Run, logs, nano, signal, wait_for_logs};

const PLAN: &str = "[session]\nname = \"bench\"\n[trial]\ncalibrate = 0\npreroll = 1\nrun = 9\ndecay = 0\n\
                    [speeds]\npairs = [[50, 10], [-30, 30]]\n";

fn info(bench: &Bench, log: &Path) -> Value {
    bench.run(["info", log.to_str().unwrap(), "--json"]).json()
}

/// Ctrl-C stops the motors and closes the log; `--resume` repeats that trial, but not the previous one.
#[test]
fn ctrl_c_stops_the_motors_and_resume_continues() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    let plan = plan.to_str().unwrap();
    let mut nano = nano(["--speed", "5"]);
    let port = nano.port().to_owned();
    let session = bench.path().join("session");
    let recording = bench.start(["record", plan, "--port", &port, "--out", "session", "--json"]);
    wait_for_logs(&session, 2);
    std::thread::sleep(Duration::from_millis(800));
    assert_ne!(nano.control("status").unwrap()["pwm"], serde_json::json!([0, 0]));
    signal(&recording, "-INT");
    let run = Run::of(recording).expect_code(130);
    assert_eq!(nano.control("status").unwrap()["pwm"], serde_json::json!([0, 0]));
    let trials = run.json()["trials"].clone();
    assert_eq!((&trials[0]["complete"], &trials[1]["complete"]), (&true.into(), &false.into()), "{trials}");
    for log in logs(&session) {
        assert_eq!(info(&bench, &log)["clean"], true, "{}", log.display());
    }

    let run = bench.run(["record", plan, "--port", &port, "--out", "session"]);
    assert!(run.expect_code(2).stderr.contains("already contains a session"));
    let run = bench.run(["record", plan, "--port", &port, "--out", "session", "--resume", "--json"]).expect_code(0);
    let trials = run.json()["trials"].clone();
    let complete = trials.as_array().unwrap().iter().all(|trial| trial["complete"] == true);
    assert!(complete && trials.as_array().unwrap().len() == 2, "{trials}");
    assert_eq!(logs(&session).len(), 3, "the aborted attempt is kept, and the complete trial not repeated");

    let other = bench.file("other.toml", &PLAN.replace("-30, 30", "-40, 40"));
    let run = bench.run(["record", other.to_str().unwrap(), "--port", &port, "--out", "session", "--resume"]);
    assert!(run.expect_code(2).stderr.contains("the session of another plan: the speeds"));
    let run = bench.run(["record", other.to_str().unwrap(), "--port", &port, "--out", "session"]);
    assert!(run.expect_code(2).stderr.contains("already contains a session"));
    assert_eq!(logs(&session).len(), 3);
}

/// A pulled cable is an error within a second, and the log is intact.
#[test]
fn pulled_cable_ends_the_trial_within_a_second() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    let nano = nano(["--speed", "1"]);
    let session = bench.path().join("session");
    let recording = bench.start(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session"]);
    wait_for_logs(&session, 1);
    std::thread::sleep(Duration::from_millis(1500));
    let pulled = Instant::now();
    drop(nano);
    let run = Run::of(recording).expect_code(1);
    println!("ended {:.0} ms after the cable was pulled", pulled.elapsed().as_secs_f64() * 1e3);
    assert!(pulled.elapsed() < Duration::from_secs(1));
    assert!(run.stderr.contains("unplugged"), "{run:?}");
    let info = info(&bench, &logs(&session)[0]);
    assert_eq!(info["clean"], true);
    assert!(info["samples"].as_u64().unwrap() > 200, "{info}");
}

/// A recording that is killed at any time loses at most the last half second.
#[test]
fn killed_recording_loses_at_most_half_a_second() {
    let kills = 50;
    let mut worst = Duration::ZERO;
    let bench = Bench::new();
    let plan = bench.short_plan(600.0, [50.0, 10.0]);
    let nano = nano(["--speed", "2"]);
    let mut random = 7u64;
    for i in 0..kills {
        let session = format!("session{i}");
        let recording = bench.start(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", &session]);
        wait_for_logs(&bench.path().join(&session), 1);
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        std::thread::sleep(Duration::from_millis(600 + (random >> 54)));
        signal(&recording, "-KILL");
        let killed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
        let _ = Run::of(recording);
        let log = logs(&bench.path().join(&session)).remove(0);
        let run = bench.run(["recover", log.to_str().unwrap(), "-o", "recovered.mcap", "--json"]).expect_code(3);
        let recovered = bench.path().join("recovered.mcap");
        let messages = biflag_log::Reader::open(&recovered).unwrap().map(|message| message.unwrap().publish_time_ns);
        let lost = killed.saturating_sub(Duration::from_nanos(messages.max().unwrap()));
        worst = worst.max(lost);
        assert!(lost <= Duration::from_millis(500), "kill {i}: {lost:?} are lost: {run:?}");
        assert_eq!(info(&bench, &recovered)["lost"], 0);
        std::fs::remove_file(recovered).unwrap();
    }
    println!("{kills} kills: at most {:.0} ms lost", worst.as_secs_f64() * 1e3);
}
