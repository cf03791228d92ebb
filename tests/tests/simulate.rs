//! Modelled sessions: memory, bundling, and interruption by the user or a power cut.

use rustix::process::Signal;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};
use tests::{Bench, Run, memory_kb, signal};

/// Six trials that take about a second together.
const PLAN: &str = "[session]\nname = \"bench\"\n[trial]\ncalibrate = 1\npreroll = 1\nrun = 14\ndecay = 3\n\
                    [speeds]\ngrid = { w1 = [-60, 40, 50], w2 = [20, 80, 60] }\n";

/// Returns every file of a session except its manifest, which contains the start time, and the drafts of a manifest that a kill
/// has left.
fn files(session: &Path) -> BTreeMap<String, Vec<u8>> {
    let Ok(entries) = std::fs::read_dir(session) else { return BTreeMap::new() };
    entries
        .flatten()
        .map(|entry| (entry.file_name().to_string_lossy().into_owned(), entry.path()))
        .filter(|(name, _)| !name.starts_with("session.toml"))
        .map(|(name, path)| (name, std::fs::read(path).unwrap()))
        .collect()
}

fn wait_for_log(session: &Path) {
    let begun = Instant::now();
    while !files(session).keys().any(|name| name.ends_with(".mcap")) {
        assert!(begun.elapsed() < Duration::from_secs(60), "no trial completed");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn simulate(plan: &Path, more: &[&str]) -> Vec<String> {
    let arguments = ["simulate", plan.to_str().unwrap(), "--json", "--rate", "200", "--shapes"];
    arguments.iter().chain(more).map(|argument| (*argument).to_owned()).collect()
}

/// Returns the peak of the memory that a child allocated, MB, and its exit code. How many pages of its program file are
/// in memory besides depends on what else the computer does.
fn peak_mb(mut child: Child) -> (f64, Option<i32>) {
    let mut peak_kb = 0.0f64;
    loop {
        peak_kb = peak_kb.max(memory_kb(&child, "RssAnon"));
        if let Some(status) = child.try_wait().unwrap() {
            return (peak_kb / 1024.0, status.code());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// At the board's rate and with shapes, a trial four times as long needs at most one more chunk of memory.
#[test]
fn memory_does_not_grow_with_the_trial() {
    let bench = Bench::new();
    let peaks = [60, 240].map(|duration| {
        let (duration, out) = (duration.to_string(), format!("out{duration}"));
        let running = bench.start([
            "simulate",
            "--speeds=50,10",
            "--rate",
            "200",
            "--shapes",
            "--duration",
            &duration,
            "--out",
            &out,
        ]);
        let (peak, code) = peak_mb(running);
        assert_eq!(code, Some(0));
        println!("{duration} s at 200 Hz with shapes: peak memory {peak:.1} MB");
        peak
    });
    assert!(peaks[0] > 1.0 && peaks[0] < 40.0, "{peaks:?}");
    assert!(peaks[1] < peaks[0] + 4.0, "{peaks:?}");
}

/// Soft flagella wrap around each other, and unwrap when a motor reverses; the bundling states show both.
#[test]
fn shipped_bundling_plan_wraps_and_unwraps() {
    let bench = Bench::new();
    let plan = Path::new(env!("CARGO_MANIFEST_DIR")).with_file_name("host").join("plans/bundling.toml");
    let run = bench.run(["simulate", plan.to_str().unwrap(), "--json"]);
    assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    let trial = &run.json()["trials"][0];
    println!("{}; largest penetration {} m", trial["bundling_changes"], trial["max_penetration_m"]);
    let changes: Vec<(f64, &str)> = (trial["bundling_changes"].as_array().unwrap().iter())
        .map(|change| (change["time_s"].as_f64().unwrap(), change["bundling"].as_str().unwrap()))
        .collect();
    let at = |time: f64| changes.iter().rev().find(|change| change.0 <= time).unwrap().1;
    assert_eq!((at(0.0), at(35.0)), ("apart", "bundled"), "{changes:?}");
    assert_ne!(at(50.0), "bundled", "{changes:?}");
    assert!(trial["max_penetration_m"].as_f64().unwrap() <= 1e-5, "{trial}");
}

/// Ctrl-C ends at once and leaves only complete trials; `--resume` computes the rest without repeating any.
#[test]
fn ctrl_c_leaves_complete_trials_and_resume_continues() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    bench.run(simulate(&plan, &["--out", "whole", "--jobs", "2"])).expect_code(3);
    let whole = files(&bench.path().join("whole"));
    assert_eq!(whole.len(), 6);

    let session = bench.path().join("session");
    let running = bench.start(simulate(&plan, &["--out", "session", "--jobs", "1"]));
    wait_for_log(&session);
    signal(&running, Signal::INT);
    let run = Run::of(running).expect_code(130);
    let kept = files(&session);
    assert!(!kept.is_empty() && kept.len() < 6 && kept.iter().all(|(name, log)| whole.get(name) == Some(log)));
    assert_eq!(run.json()["trials"].as_array().unwrap().len(), kept.len());

    let run = bench.run(simulate(&plan, &["--out", "session", "--resume"])).expect_code(3);
    assert!(files(&session) == whole);
    let computed = |trial: &&Value| !trial["wall_s"].is_null();
    assert_eq!(run.json()["trials"].as_array().unwrap().iter().filter(computed).count(), 6 - kept.len());
}

/// The logs of a session of shards that is killed, as often as `KILLS` says, equal those of an uninterrupted one.
#[test]
fn killed_session_gives_the_same_logs() {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    bench.run(simulate(&plan, &["--out", "whole"])).expect_code(3);
    let whole = files(&bench.path().join("whole"));
    let session = bench.path().join("session");
    let kills = std::env::var("KILLS").map_or(2, |kills| kills.parse().expect("KILLS is a number"));
    for kill in 0..kills {
        let shard = format!("{}/2", kill % 2 + 1);
        let running = bench.start(simulate(&plan, &["--out", "session", "--resume", "--jobs", "1", "--shard", &shard]));
        std::thread::sleep(Duration::from_millis(60 + 90 * (kill % 6)));
        signal(&running, Signal::KILL);
        let _ = Run::of(running);
        for (name, log) in files(&session) {
            assert!(name.ends_with(".mcap.unfinished") || whole.get(&name) == Some(&log), "{name}");
        }
    }
    for shard in ["1/2", "2/2"] {
        bench.run(simulate(&plan, &["--out", "session", "--resume", "--shard", shard])).expect_code(3);
    }
    assert!(files(&session) == whole);
}
