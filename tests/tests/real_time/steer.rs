//! `biflag steer` with a policy that fails in real time.

use biflag_log::{Body, Reader};
use rustix::process::{Pid, Signal, kill_process};
use std::time::Duration;
use tests::{Bench, Lateness, Run, logs, wait_for_line};

use crate::steer::{log_of, set_points};

/// In real time, a policy that says nothing more stops the motors after 0.4 s.
#[test]
fn silent_policy_stops_the_motors() {
    let bench = Bench::in_memory();
    let policy = "read line; echo '{\"speeds_rpm\": [40, 20]}'; sleep 60";
    let arguments =
        ["steer", "--yaw=-50", "--pitch=-1", "--virtual", "--rest", "0", "--out", "run", "--json", "--policy", policy];
    let lateness = Lateness::measure();
    let run = bench.run(arguments).expect_code(1);
    assert!(run.json()["error"].as_str().unwrap().contains("no speeds within 0.4 s"), "{run:?}");
    let last =
        Reader::open(&log_of(&run, &bench)).unwrap().map(Result::unwrap).filter_map(|message| match message.body {
            Body::Telemetry(frame) => Some(frame),
            _ => None,
        });
    let driven: Vec<f64> =
        last.filter(|frame| frame.motor1.as_ref().unwrap().target_rpm != 0.0).map(|frame| frame.time_s).collect();
    let driven_s = driven.last().unwrap() - driven.first().unwrap();
    assert!(
        (0.3..1.5 + lateness.allowed().as_secs_f64()).contains(&driven_s),
        "the motors were driven for {driven_s} s"
    );
}

/// A policy that is killed at any moment stops the motors within the board's deadline and a tick.
/// `POLICY_KILLS=100 cargo test --release -p tests --test all steer::killed -- --nocapture` for more kills.
#[test]
fn killed_policy_stops_the_motors_within_the_deadline() {
    const DEADLINE_S: f64 = 0.5 + 0.005;
    const AT_ONCE: u64 = 6;
    let kills: u64 = std::env::var("POLICY_KILLS").map_or(AT_ONCE, |kills| kills.parse().unwrap());
    let (mut off_after_s, lateness) = (Vec::new(), Lateness::measure());
    for first in (0..kills).step_by(AT_ONCE as usize) {
        std::thread::scope(|scope| {
            let runs = first..kills.min(first + AT_ONCE);
            let runs: Vec<_> = runs.map(|kill| scope.spawn(move || off_after_kill_s(kill))).collect();
            off_after_s.extend(runs.into_iter().filter_map(|run| run.join().unwrap()));
        });
    }
    off_after_s.sort_by(f64::total_cmp);
    let (median_s, worst_s) = (off_after_s[off_after_s.len() / 2], off_after_s[off_after_s.len() - 1]);
    println!(
        "{kills} kills of a policy, {} with the motors on: off after {:.0} ms in the median, {:.0} ms at worst",
        off_after_s.len(),
        1e3 * median_s,
        1e3 * worst_s
    );
    let allowed_s = DEADLINE_S + lateness.allowed().as_secs_f64();
    assert!(off_after_s.len() as u64 > kills / 2 && worst_s <= allowed_s, "{off_after_s:?}");
}

/// Kills a policy at a moment of its own in a run in real time. Returns the time from the observation that it answered last to
/// the first frame with both motors off; `None` if it gave no speeds.
fn off_after_kill_s(kill: u64) -> Option<f64> {
    let bench = Bench::in_memory();
    let policy = "echo $$ > pid; while read line; do echo '{\"speeds_rpm\": [60, 40]}'; done";
    let mut child = bench.start([
        "steer",
        "--yaw=-50",
        "--pitch=-1",
        "--virtual",
        "--rest",
        "0",
        "--out",
        "run",
        "--policy",
        policy,
    ]);
    wait_for_line(&mut child, ": run");
    let pid = std::fs::read_to_string(bench.path().join("pid")).unwrap().trim().parse().unwrap();
    // Moments without a pattern within the steps of 50 ms.
    std::thread::sleep(Duration::from_micros(100_000 + kill * 7919 * 1000 % 1_500_000 + kill * 1237 % 50_000));
    kill_process(Pid::from_raw(pid).unwrap(), Signal::KILL).unwrap();
    Run::of(child).expect_code(1);
    let log = &logs(&bench.path().join("run"))[0];
    let last = set_points(log).last()?.observed_us;
    let frames = Reader::open(log).unwrap().map(Result::unwrap).filter_map(|message| match message.body {
        Body::Telemetry(frame) => Some(frame),
        _ => None,
    });
    let mut frames = frames.skip_while(|frame| frame.board_time_us < last);
    let off = frames.find(|frame| [&frame.motor1, &frame.motor2].iter().all(|motor| motor.as_ref().unwrap().duty == 0));
    Some((off.expect("a frame with the motors off").board_time_us - last) as f64 * 1e-6)
}
