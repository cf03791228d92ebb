//! Trials that are interrupted by the user, a pulled cable, or a power cut.

use biflag_log::{Body, Condition, End, Reader};
use protocol::frame::Accumulator;
use protocol::{Command, Request};
use rustix::process::Signal;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tests::{
    Bench, Cable, Lateness, Run, board_s, is_driven, logs, nano, pass, signal, wait_for_logs, wait_for_motion,
    whole_computer,
};

/// The motors' deadline is the longest one, because other programs may delay the pings. The board has its gyroscope's bias, as
/// after an earlier calibration: it is too much for so short a rest.
const PLAN: &str = "[session]\nname = \"bench\"\n[board]\ndeadline_ms = 5000\ngyro_bias_counts = [-9, -655, 23]\n[trial]\ncalibrate = 0\npreroll = 1\nrest_at_most = 0\nrun = 9\ndecay = 0\n\
                    [speeds]\npairs = [[50, 10], [-30, 30]]\n";

fn info(bench: &Bench, log: &Path) -> Value {
    bench.run(["info", log.to_str().unwrap(), "--json"]).json()
}

/// Ctrl-C stops the motors and closes the log; `--resume` repeats that trial, but not the previous one.
#[test]
fn ctrl_c_stops_the_motors_and_resume_continues() {
    let _computer = whole_computer();
    let bench = Bench::in_memory();
    let plan = bench.file("plan.toml", PLAN);
    let plan = plan.to_str().unwrap();
    let mut nano = nano(["--speed", "3"]);
    let port = nano.port().to_owned();
    let session = bench.path().join("session");
    let recording = bench.start(["record", plan, "--port", &port, "--out", "session", "--json"]);
    wait_for_logs(&session, 2);
    wait_for_motion(&mut nano);
    signal(&recording, Signal::INT);
    let run = Run::of(recording).expect_code(130);
    assert!(!is_driven(&mut nano));
    assert!(run.stderr.contains("continue with: biflag record") && run.stderr.contains("--json --resume"), "{run:?}");
    let trials = run.json()["trials"].clone();
    assert_eq!((&trials[0]["complete"], &trials[1]["complete"]), (&true.into(), &false.into()), "{trials}");
    for log in logs(&session) {
        assert_eq!(info(&bench, &log)["clean"], true, "{}", log.display());
    }

    let run = bench.run(["record", plan, "--port", &port, "--out", "session"]);
    assert!(run.expect_code(2).stderr.contains("already contains a session"));
    let run = bench.run(["record", plan, "--port", &port, "--out", "session", "--resume", "--json"]).expect_unsettled();
    let trials = run.json()["trials"].clone();
    let complete = trials.as_array().unwrap().iter().all(|trial| trial["complete"] == true);
    assert!(complete && trials.as_array().unwrap().len() == 2, "{trials}");
    assert_eq!(logs(&session).len(), 3, "the aborted attempt is kept, and the complete trial not repeated");
    let run = bench.run(["record", plan, "--port", &port, "--out", "session", "--resume"]).expect_unsettled();
    assert!(run.stdout.contains("nothing left to do: 2 trials complete"), "{run:?}");

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
    let _computer = whole_computer();
    let bench = Bench::in_memory();
    let plan = bench.file("plan.toml", PLAN);
    let mut nano = nano(["--speed", "1"]);
    let session = bench.path().join("session");
    let recording = bench.start(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session"]);
    // The pre-roll has 200 samples.
    wait_for_motion(&mut nano);
    pass(&mut nano, 0.5);
    let (pulled, lateness) = (Instant::now(), Lateness::measure());
    drop(nano);
    let run = Run::of(recording).expect_code(1);
    let (took, allowed) = (pulled.elapsed(), lateness.allowed());
    println!("ended {took:?} after the cable was pulled, of which {allowed:?} may be the computer's");
    assert!(took < Duration::from_secs(1) + allowed, "{took:?}");
    assert!(run.stderr.contains("unplugged"), "{run:?}");
    let info = info(&bench, &logs(&session)[0]);
    assert_eq!(info["clean"], true);
    assert!(info["samples"].as_u64().unwrap() > 200, "{info}");
}

/// What arrives while the board does not answer is written as soon as everything else.
#[test]
fn log_is_written_while_an_answer_is_awaited() {
    let _computer = whole_computer();
    let bench = Bench::in_memory();
    let plan = bench.file("plan.toml", &PLAN.replace("calibrate = 0", "calibrate = 1"));
    let mut nano = nano(["--speed", "1"]);
    let cable = Cable::new(nano.port());
    // The start of the schedule, which follows the calibration, does not reach the board.
    let (mut accumulator, mut attempts) = (Accumulator::new(), 0);
    let (sender, last_attempt) = channel();
    cable.spoil_to_board(move |bytes| {
        for byte in bytes {
            if let Some(Ok(Request { command: Command::StartSchedule { .. }, .. })) = accumulator.push(*byte) {
                attempts += 1;
                if attempts == 5 {
                    sender.send(()).unwrap();
                }
            }
        }
        if attempts == 0 { bytes.to_vec() } else { Vec::new() }
    });
    let lateness = Lateness::measure();
    let recording = bench.start(["record", plan.to_str().unwrap(), "--port", cable.port(), "--out", "session"]);
    // 650 ms after the first attempt.
    last_attempt.recv_timeout(Duration::from_secs(60)).expect("the schedule is started five times");
    let sent_s = board_s(&mut nano);
    signal(&recording, Signal::KILL);
    let _ = Run::of(recording);
    let log = logs(&bench.path().join("session")).remove(0);
    let frames = Reader::open(&log).unwrap().filter_map(|message| match message.unwrap().body {
        Body::Telemetry(frame) => Some(frame.board_time_us as f64 * 1e-6),
        _ => None,
    });
    let lost_s = sent_s - frames.last().expect("frames");
    println!("{:.0} ms lost", lost_s * 1e3);
    assert!(lost_s <= 0.5 + lateness.allowed().as_secs_f64(), "{lost_s} s");
}

/// The motors' deadline of [`KILLED`], s. A run is longer.
const DEADLINE_S: f64 = 1.0;

/// Three trials, so that kills also hit the time between two of them.
const KILLED: &str = "[session]\nname = \"bench\"\n[board]\ndeadline_ms = 1000\ngyro_bias_counts = [-9, -655, 23]\n[trial]\ncalibrate = 0\npreroll = 0.2\nrest_at_most = 0\nrun = 1.6\ndecay = 0.1\n\
                      [speeds]\npairs = [[50, 10], [-30, 30], [0, 45]]\n";

/// What came of the kills of one session.
#[derive(Default)]
struct Killed {
    kills: usize,
    in_trials: usize,
    sessions: usize,
    worst: Duration,
    /// How long motors were driven after a kill, s.
    driven_s: Vec<f64>,
}

/// A recording that is killed at any time loses at most the last half second, and its motors stop by their deadline;
/// `--resume` repeats no complete trial and leaves none out. `KILLS=1000 cargo test --release -p tests --test all
/// interruption::killed` runs more than the usual 9.
#[test]
fn killed_recording_loses_at_most_half_a_second_and_no_trial() {
    let kills = std::env::var("KILLS").map_or(9, |kills| kills.parse().expect("KILLS is a number"));
    let workers = 3;
    let _computer = whole_computer();
    let killed: Vec<Killed> = std::thread::scope(|scope| {
        let share = |worker| kills / workers + usize::from(worker < kills % workers);
        let run = |worker: usize| scope.spawn(move || kill_sessions(share(worker), worker as u64));
        let running: Vec<_> = (0..workers).map(run).collect();
        running.into_iter().map(|worker| worker.join().unwrap()).collect()
    });
    let sum = |of: fn(&Killed) -> usize| killed.iter().map(of).sum::<usize>();
    let worst = killed.iter().map(|killed| killed.worst).max().unwrap();
    let driven_s: Vec<f64> = killed.iter().flat_map(|killed| killed.driven_s.clone()).collect();
    println!(
        "{} kills, {} of them in a trial, in {} sessions: at most {:.0} ms lost, no trial lost or recorded twice; after {} \
         of them motors were driven, for {:.0} ms at most",
        sum(|killed| killed.kills),
        sum(|killed| killed.in_trials),
        sum(|killed| killed.sessions),
        worst.as_secs_f64() * 1e3,
        driven_s.len(),
        driven_s.iter().copied().fold(0.0, f64::max) * 1e3
    );
    assert_eq!(sum(|killed| killed.kills), kills);
    assert!(sum(|killed| killed.in_trials) * 2 > kills, "most kills hit a trial");
}

/// Kills recordings of one board, resuming each session until it is complete.
fn kill_sessions(kills: usize, seed: u64) -> Killed {
    let bench = Bench::in_memory();
    let plan = bench.file("plan.toml", KILLED);
    let mut nano = nano(["--speed", "1"]);
    let port = nano.port().to_owned();
    let mut random = seed;
    let (mut killed, lateness) = (Killed::default(), Lateness::measure());
    let mut seen = BTreeSet::new();
    while killed.kills < kills {
        killed.sessions += 1;
        let name = format!("session{}", killed.sessions);
        let session = bench.path().join(&name);
        let record = ["record", plan.to_str().unwrap(), "--port", &port, "--resume", "--json", "--out", &name];
        // Kills so early that nothing is recorded would go on for ever: a session has a limit of them.
        for _ in 0..8 {
            if killed.kills == kills {
                break;
            }
            random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let logs_before = logs(&session).len();
            let mut recording = bench.start(record);
            // Every fourth kill may come before the trial, whose log takes the longer to begin the busier the computer is.
            let (mut waits_for_log, mut due) = (random >> 32 & 3 > 0, Instant::now());
            let delay = Duration::from_millis(random >> 53);
            let mut begun_s = board_s(&mut nano);
            while recording.try_wait().unwrap().is_none() && (waits_for_log || due.elapsed() < delay) {
                let now_s = board_s(&mut nano);
                if logs(&session).len() == logs_before {
                    begun_s = now_s;
                } else if waits_for_log {
                    (waits_for_log, due) = (false, Instant::now());
                }
                std::thread::sleep(Duration::from_millis(5));
            }
            if recording.try_wait().unwrap().is_some() {
                break;
            }
            let killed_at = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
            signal(&recording, Signal::KILL);
            let sent_s = board_s(&mut nano);
            let _ = Run::of(recording);
            killed.kills += 1;
            // Every fourth time the next run meets a board that still drives its motors.
            let mut status = nano.control("status").unwrap();
            if random >> 40 & 3 > 0 && status["pwm"] != json!([0, 0]) {
                let mut driven_s = 0.0;
                while status["pwm"] != json!([0, 0]) {
                    driven_s = status["seconds"].as_f64().unwrap() - sent_s;
                    // What the line still held has restarted the deadline.
                    assert!(driven_s < DEADLINE_S + 0.05, "driven {driven_s} s after a kill");
                    std::thread::sleep(Duration::from_millis(5));
                    status = nano.control("status").unwrap();
                }
                killed.driven_s.push(driven_s);
            }
            // The log that was being written has no summary. There is none before the first trial and between two.
            let cut: Vec<_> = logs(&session)
                .into_iter()
                .filter(|log| !seen.contains(log) && biflag_log::summary(log).unwrap().is_none())
                .collect();
            assert!(cut.len() <= 1, "{cut:?}");
            for log in cut {
                let lost = lost_before(&bench, &log, killed_at, [begun_s, sent_s]);
                let allowed = Duration::from_millis(500) + lateness.allowed();
                assert!(lost <= allowed, "{lost:?} are lost of {}", log.display());
                killed.worst = killed.worst.max(lost);
                killed.in_trials += 1;
                seen.insert(log);
            }
        }
        // A trial may fail while other programs load the computer: the motors stop half a second after the last ping.
        let resumed = (0..5).map(|_| bench.run(record)).find(|run| matches!(run.code, Some(0 | 3)));
        let json = resumed.expect("a session that can be resumed").json();
        let is_complete = |trial: &Value| trial["complete"] == true && trial["lost"] == 0;
        assert!(json["trials"].as_array().unwrap().iter().all(is_complete), "{json}");
        let ended =
            |log: &PathBuf| biflag_log::summary(log).unwrap().is_some_and(|summary| summary.end == End::Complete);
        let complete = logs(&session).iter().filter(|log| ended(log)).count();
        assert_eq!((json["trials"].as_array().unwrap().len(), complete), (3, 3), "each trial once: {json}");
        let mut left = std::fs::read_dir(&session).unwrap().map(|entry| entry.unwrap().file_name());
        assert!(left.all(|name| !name.to_string_lossy().contains("partial")), "drafts are left in {name}");
    }
    killed
}

/// Returns how much of a log was lost by a kill: the time since the last message was received; in a log without one, since
/// the log was begun. On a busy computer the emulated board stops for a while and sends nothing, so its own time counts if
/// that is shorter: `begun_s` is its clock before the first log of this run was there, `sent_s` the one at the kill.
fn lost_before(bench: &Bench, log: &Path, killed_at: Duration, [begun_s, sent_s]: [f64; 2]) -> Duration {
    let passed = |since_s: f64| Duration::from_secs_f64((sent_s - since_s).max(0.0));
    let begun = std::fs::metadata(log).unwrap().modified().unwrap().duration_since(UNIX_EPOCH).unwrap();
    // Beside the session, which would take it for a log of its own.
    let recovered = bench.path().join("recovered.mcap");
    let run = bench.run(["recover", log.to_str().unwrap(), "-o", recovered.to_str().unwrap(), "--json"]);
    if run.code == Some(1) && run.stderr.contains("nothing was recorded") {
        // The file was there, and the trial had not begun.
        return killed_at.saturating_sub(begun).min(passed(begun_s));
    }
    assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
    let mut reader = Reader::open(&recovered).unwrap();
    let (mut last, mut last_frame_us) = (None, None);
    for message in reader.by_ref().map(Result::unwrap) {
        last = last.max(Some(Duration::from_nanos(message.publish_time_ns)));
        if let Body::Telemetry(frame) = message.body {
            last_frame_us = Some(frame.board_time_us);
        }
    }
    assert_eq!(reader.condition(), Some(Condition::Clean));
    std::fs::remove_file(&recovered).unwrap();
    let lost = killed_at.saturating_sub(last.unwrap_or(begun));
    lost.min(passed(last_frame_us.map_or(begun_s, |us| us as f64 * 1e-6)))
}
