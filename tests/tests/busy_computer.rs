//! The board keeps the time of a trial: a busy computer does not change it by a tick.

use biflag_log::{Body, Reader};
use rustix::process::Signal;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use tests::{Bench, Run, logs, nano, pass, program, signal, stalling_library, wait_for_line};

/// Slow, so that the reversed motor reaches its speed within the run. The motors' deadline is the longest one. The board has its gyroscope's bias, as after an earlier
/// calibration.
const PLAN: &str = "[session]\nname = \"bench\"\n[board]\ndeadline_ms = 5000\ngyro_bias_counts = [-9, -655, 23]\n[trial]\ncalibrate = 0\npreroll = 1\nrest_at_most = 0\nrun = 3\ndecay = 1\n\
                    reverse = { motor = 1, after = 1 }\n[speeds]\npairs = [[20, 10]]\n";

/// The same in ticks: the number of each phase, and the speeds from then on.
const TRIAL: [(i64, u32, [f64; 2]); 4] =
    [(0, 1, [0.0, 0.0]), (200, 2, [20.0, 10.0]), (400, 2, [-20.0, 10.0]), (800, 3, [0.0, 0.0])];

const EVENTS: [(i64, &str); 5] = [
    (0, "preroll"),
    (200, "run"),
    (400, "motor 1 reverses: from here on -20 and +10 rpm"),
    (800, "decay"),
    (1000, "end"),
];

/// What a trial was like in its log.
#[derive(PartialEq, Debug)]
struct Course {
    ticks: usize,
    /// Changes of phase or speeds.
    changes: Vec<(i64, u32, [f64; 2])>,
    events: Vec<(i64, String)>,
}

impl Course {
    fn of(log: &Path) -> Self {
        let mut course = Self { ticks: 0, changes: Vec::new(), events: Vec::new() };
        let mut first_ns = None;
        for message in Reader::open(log).unwrap().map(Result::unwrap) {
            let log_ns = message.log_time_ns;
            let tick = |first_ns: u64| ((log_ns as i64 - first_ns as i64) as f64 / 5e6).round() as i64;
            match message.body {
                Body::Telemetry(frame) => {
                    let tick = tick(*first_ns.get_or_insert(log_ns));
                    let speeds = [frame.motor1, frame.motor2].map(|motor| motor.unwrap().target_rpm);
                    if course.changes.last().is_none_or(|last| (last.1, last.2) != (frame.phase, speeds)) {
                        course.changes.push((tick, frame.phase, speeds));
                    }
                    course.ticks += 1;
                }
                Body::Event(event) if EVENTS.iter().any(|(_, text)| *text == event.text) => {
                    course.events.push((first_ns.map_or(0, tick), event.text));
                }
                _ => {}
            }
        }
        course
    }

    fn planned() -> Self {
        let events = EVENTS.map(|(tick, text)| (tick, text.to_owned())).to_vec();
        Self { ticks: 1000, changes: TRIAL.to_vec(), events }
    }
}

#[derive(Clone, Copy, Debug)]
enum Trouble {
    None,
    /// A write takes so many ms, the first one later than so many ms after the start of the program.
    Write {
        ms: u64,
        after_ms: u64,
    },
    /// The whole program is stopped for 0.4 s of the board's time, so many of its seconds after the trial's first frame.
    Frozen {
        after_s: f64,
    },
}

fn record(trouble: Trouble) {
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    // Slower than real time: such a board does not wait for a program that is held up, but loses no byte.
    let mut nano = nano(["--speed", "0.8"]);
    let mut command = Command::new(program("biflag"));
    command.args(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--json"]);
    if let Trouble::Write { ms, after_ms } = trouble {
        command.env("LD_PRELOAD", stalling_library(bench.path()));
        command.env("STALL_MS", ms.to_string()).env("STALL_AFTER_MS", after_ms.to_string());
    }
    command.current_dir(bench.path()).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut recording = command.spawn().unwrap();
    let session = bench.path().join("session");
    if let Trouble::Frozen { after_s } = trouble {
        wait_for_line(&mut recording, ": preroll");
        pass(&mut nano, after_s);
        signal(&recording, Signal::STOP);
        pass(&mut nano, 0.4);
        signal(&recording, Signal::CONT);
    }
    let run = Run::of(recording).expect_unsettled();
    let trial = &run.json()["trials"][0];
    assert_eq!((&trial["complete"], &trial["lost"]), (&true.into(), &0.into()), "{trouble:?}: {run:?}");
    assert_eq!(Course::of(&logs(&session)[0]), Course::planned(), "{trouble:?}");
    // The first write may be that of the session's own file.
    if matches!(trouble, Trouble::Write { after_ms: 1000.., .. }) {
        let notes = trial["notes"].to_string();
        let took = notes.split_once("the disk was slow: a write took ").and_then(|(_, rest)| rest.split(' ').next());
        assert!(took.is_some_and(|took| took.parse::<f64>().unwrap() >= 4.0), "{trouble:?}: {trial}");
    }
}

#[test]
fn trials_of_a_busy_computer_are_equal_to_those_of_an_idle_one() {
    let write = |after_ms| Trouble::Write { ms: 4000, after_ms };
    let frozen = |after_s| Trouble::Frozen { after_s };
    // At the start, as the motors start, as one reverses, and as they stop. The trial begins some 0.3 s after the program.
    let troubles =
        [Trouble::None, write(100), write(1300), write(2500), write(5000), frozen(0.8), frozen(1.8), frozen(3.8)];
    std::thread::scope(|scope| {
        let running: Vec<_> = troubles.into_iter().map(|trouble| scope.spawn(move || record(trouble))).collect();
        running.into_iter().for_each(|trial| trial.join().unwrap());
    });
}

/// At more than real time the board's time waits for the program, which may be held up for longer than the motors' deadline.
#[test]
fn fast_emulated_board_waits_for_a_program_that_is_held_up() {
    let bench = Bench::new();
    bench.file(
        "plan.toml",
        "[trial]\ncalibrate = 0\npreroll = 1\nrest_at_most = 0\nrun = 20\ndecay = 0\n[speeds]\npairs = [[50, 10]]\n",
    );
    let mut recording =
        bench.start(["record", "plan.toml", "--virtual", "--sensor", "ideal", "--out", "session", "--json"]);
    wait_for_line(&mut recording, ": run");
    signal(&recording, Signal::STOP);
    std::thread::sleep(Duration::from_millis(1500));
    signal(&recording, Signal::CONT);
    // Without a calibration and a rest it has findings of its own.
    let run = Run::of(recording).expect_code(3);
    let trial = &run.json()["trials"][0];
    assert_eq!((&trial["complete"], &trial["lost"]), (&true.into(), &0.into()), "{run:?}");
}
