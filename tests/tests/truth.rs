//! The ground truth of a simulated robot is logged completely, at times that do not depend on the speed of the host.

use biflag_log::{Body, Reader};
use rustix::process::Signal;
use std::path::Path;
use std::process::Child;
use std::time::Duration;
use tests::{Bench, Run, signal, wait_until};

/// Ticks of the board between samples, and between samples with the flagella's shapes.
const TICKS: [usize; 4] = [4, 4, 20, 20];
const TOPICS: [&str; 4] = ["/truth", "/forces", "/flagella", "/flagella_points"];

/// One tick, s.
const TICK_S: f64 = 0.005;

/// Largest delay of a tick, when the board is busy with a request.
const JITTER_S: f64 = 0.5e-3;

/// Times since the trial's first frame, s.
#[derive(Debug)]
struct Times {
    frames: Vec<f64>,
    /// In the order of [`TOPICS`].
    samples: [Vec<f64>; 4],
}

impl Times {
    fn of(log: &Path) -> Self {
        let mut times = Self { frames: Vec::new(), samples: Default::default() };
        let mut first_ns = None;
        for message in Reader::open(log).unwrap().map(Result::unwrap) {
            let topic = TOPICS.iter().position(|topic| *topic == message.topic);
            let of_topic = match (&message.body, topic) {
                (Body::Telemetry(_), _) => &mut times.frames,
                (_, Some(topic)) => &mut times.samples[topic],
                _ => continue,
            };
            of_topic.push((message.log_time_ns - *first_ns.get_or_insert(message.log_time_ns)) as f64 * 1e-9);
        }
        times
    }

    /// Returns the number of ticks of the trial.
    fn ticks(&self) -> usize {
        (self.frames.last().unwrap() / TICK_S).round() as usize + 1
    }
}

/// Repeatedly stops the recording for `stopped` and lets it run for `between`, until it ends. The emulated board keeps
/// running.
fn slow_down(recording: &mut Child, [stopped, between]: [Duration; 2]) {
    while recording.try_wait().unwrap().is_none() {
        signal(recording, Signal::STOP);
        std::thread::sleep(stopped);
        let before = link_runs(recording);
        signal(recording, Signal::CONT);
        std::thread::sleep(between);
        // On a busy computer it may not have run in this time.
        let has_run = |now: u64| now >= before + 2 || now < before;
        wait_until("the link runs", || {
            let now = link_runs(recording);
            now == NO_LINK || has_run(now) || recording.try_wait().unwrap().is_some()
        });
    }
}

/// Stands for a program without a link, before it has opened it or after.
const NO_LINK: u64 = u64::MAX / 2;

/// Returns how often the thread of the link has run.
fn link_runs(recording: &Child) -> u64 {
    let threads = std::fs::read_dir(format!("/proc/{}/task", recording.id())).into_iter().flatten().flatten();
    let is_link = |name: String| name.trim() == "link";
    let link = threads
        .map(|thread| thread.path())
        .find(|thread| std::fs::read_to_string(thread.join("comm")).is_ok_and(is_link));
    let schedule = link.and_then(|thread| std::fs::read_to_string(thread.join("schedstat")).ok());
    schedule.and_then(|text| text.split_whitespace().nth(2)?.parse().ok()).unwrap_or(NO_LINK)
}

/// Records a trial of two seconds with a board whose clock is exact: each recording has its own clock otherwise.
fn record(slow_down: impl FnOnce(&mut Child)) -> Times {
    let bench = Bench::new();
    let plan = bench.short_plan(2.0, [50.0, 10.0]);
    let arguments = ["record", plan.to_str().unwrap(), "--virtual", "--sensor", "ideal", "--out", "session", "--json"];
    let mut recording = bench.start(arguments);
    slow_down(&mut recording);
    let run = Run::of(recording).expect_code(3);
    Times::of(&bench.path().join(run.json()["trials"][0]["log"].as_str().unwrap()))
}

#[test]
fn sample_times_do_not_depend_on_the_speed_of_the_host() {
    let idle = record(|_| {});
    let slow = std::thread::scope(|scope| {
        let pauses = [[10, 10], [40, 7], [150, 1]].map(|pause| pause.map(Duration::from_millis));
        let recordings = pauses.map(|pause| scope.spawn(move || record(|run| slow_down(run, pause))));
        recordings.map(|recording| recording.join().unwrap())
    });
    for trial in [&idle].into_iter().chain(&slow) {
        assert_eq!(trial.ticks(), 400);
        for (topic, samples) in trial.samples.iter().enumerate() {
            assert_eq!(samples.len(), trial.ticks().div_ceil(TICKS[topic]), "{}: {samples:?}", TOPICS[topic]);
            let pairs = samples.iter().zip(&idle.samples[topic]);
            let difference = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{} ticks, {} samples on {}, {difference:.6} s", trial.ticks(), samples.len(), TOPICS[topic]);
            assert!(difference < JITTER_S, "{}: {samples:?}\n{:?}", TOPICS[topic], idle.samples[topic]);
        }
    }
}
