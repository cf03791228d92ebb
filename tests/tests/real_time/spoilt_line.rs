//! A line that brings no telemetry stops the motors and ends the recording, whatever else it brings.

use serde_json::json;
use std::time::{Duration, Instant};
use tests::{Bench, Cable, Lateness, Run, board_s, logs, nano, wait_for_logs, whole_computer};

/// A pre-roll, so that a line can go bad before the motors turn.
const PLAN: &str = "[session]\nname = \"bench\"\n[trial]\ncalibrate = 0\npreroll = 1\nrest_at_most = 0\nrun = 60\ndecay = 0\n\
                    [speeds]\npairs = [[50, 10]]\n";

/// The motors' deadline by default, s.
const DEADLINE_S: f64 = 0.5;

/// What comes over the line instead of telemetry.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Line {
    Noise,
    Answers,
    Zeros,
    Ascii,
    Silence,
}

const LINES: [Line; 5] = [Line::Noise, Line::Answers, Line::Zeros, Line::Ascii, Line::Silence];

/// A source of pseudo-random numbers.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        self.0 >> 33
    }

    fn below(&mut self, limit: u64) -> u64 {
        self.next() % limit
    }
}

/// Makes the line bring only this from now on, at full speed: 500 kbit/s, ten bits a byte.
fn spoil(cable: &Cable, line: Line, mut random: Random) {
    let mut partial = Vec::new();
    let mut sent = Instant::now();
    let mut told = 0;
    cable.spoil_from_board(move |bytes| {
        if line == Line::Answers {
            partial.extend_from_slice(bytes);
            let whole = partial.iter().rposition(|byte| *byte == 0).map_or(0, |last| last + 1);
            let frames: Vec<u8> = partial.drain(..whole).collect();
            // Only frames of telemetry are this long.
            return frames
                .split_inclusive(|byte| *byte == 0)
                .filter(|frame| frame.len() < 40)
                .flatten()
                .copied()
                .collect();
        }
        let count = (sent.elapsed().as_secs_f64() * 50e3) as usize;
        sent = Instant::now();
        let mut next = || {
            told += 1;
            match line {
                Line::Noise => random.next() as u8,
                Line::Ascii => b"psi=12.3 theta=4.5\r\n"[told % 20],
                _ => 0,
            }
        };
        if line == Line::Silence { Vec::new() } else { (0..count).map(|_| next()).collect() }
    });
}

/// The line goes bad at a random time of the pre-roll or the run, with the board hearing the host or not.
fn case(number: u64) -> String {
    let mut random = Random(number.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    (0..9).for_each(|_| _ = random.next());
    let line = LINES[number as usize % LINES.len()];
    let (at_ms, hears) = (random.below(2500), random.below(3) > 0);
    let bench = Bench::in_memory();
    let plan = bench.file("plan.toml", PLAN);
    let mut nano = nano(["--speed", "1"]);
    let cable = Cable::new(nano.port());
    let (session, lateness) = (bench.path().join("session"), Lateness::measure());
    let mut recording =
        bench.start(["record", plan.to_str().unwrap(), "--port", cable.port(), "--out", "session", "--json"]);
    wait_for_logs(&session, 1);
    std::thread::sleep(Duration::from_millis(at_ms));
    let what = format!("case {number}: {line:?} after {at_ms} ms, the board hears: {hears}");

    spoil(&cable, line, random);
    if !hears {
        cable.spoil_to_board(|_| Vec::new());
    }
    // A busy computer delays the board as well as this test, and the board may then catch up: the shorter time is true.
    let (spoilt, spoilt_s) = (Instant::now(), board_s(&mut nano));
    let (mut turned_s, mut ended_s) = (0.0, None);
    loop {
        let has_ended = recording.try_wait().unwrap().is_some();
        let passed_s = spoilt.elapsed().as_secs_f64();
        let status = nano.control("status").unwrap();
        let passed_s = passed_s.min(status["seconds"].as_f64().unwrap() - spoilt_s);
        if status["pwm"] != json!([0, 0]) {
            turned_s = passed_s;
        }
        if has_ended && ended_s.is_none() {
            ended_s = Some(passed_s);
        }
        if ended_s.is_some() && passed_s >= 2.0 {
            break;
        }
        assert!(passed_s < 20.0, "{what}: the recording goes on");
        std::thread::sleep(Duration::from_millis(10));
    }
    let ended_s = ended_s.unwrap();
    let run = Run::of(recording).expect_code(1);
    let late_s = lateness.allowed().as_secs_f64();
    assert!(turned_s <= DEADLINE_S + 1.0 + late_s, "{what}: the motors turned for {turned_s} s");
    assert!(ended_s <= 5.0 + late_s, "{what}: it ended after {ended_s} s");
    // The line may go bad before the board has the schedule; a board that hears nothing may say so before this side does.
    let said = ["the board stopped sending", "did not answer", "it received nothing from the host"];
    assert!(said.iter().any(|said| run.stderr.contains(said)), "{what}: {run:?}");
    let findings = run.json()["trials"][0]["findings"].as_array().unwrap().len();
    assert!(findings < 10, "{what}: thousands of damaged frames are one finding, not {findings}");
    let log = logs(&session).remove(0);
    let info = bench.run(["info", log.to_str().unwrap(), "--json"]).json();
    assert!(info["clean"] == true && (info["end"] == "failed" || info["end"] == "faulted"), "{what}: {info}");
    format!("{what}: motors off after {turned_s:.2} s, ended after {ended_s:.2} s")
}

/// `LINES=100 cargo test --release -p tests --test all spoilt_line::only -- --nocapture` runs more than the usual 10.
#[test]
fn only_telemetry_keeps_the_motors_turning() {
    let count: u64 = std::env::var("LINES").map_or(5, |count| count.parse().expect("LINES is a number"));
    let _computer = whole_computer();
    std::thread::scope(|scope| {
        let workers: Vec<_> =
            (0..5).map(|first| scope.spawn(move || (first..count).step_by(5).map(case).collect::<Vec<_>>())).collect();
        let said: Vec<_> = workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect();
        said.iter().for_each(|case| println!("{case}"));
    });
}

/// A port that never brings a frame of this protocol is an error within five seconds.
#[test]
fn ports_without_a_board_are_an_error_within_five_seconds() {
    let _computer = whole_computer();
    let bench = Bench::in_memory();
    let plan = bench.file("plan.toml", PLAN);
    std::thread::scope(|scope| {
        for line in LINES.into_iter().filter(|line| *line != Line::Answers) {
            let (bench, plan) = (&bench, plan.to_str().unwrap());
            scope.spawn(move || {
                let mut nano = nano(["--speed", "1"]);
                let cable = Cable::new(nano.port());
                spoil(&cable, line, Random(7));
                let begun_s = board_s(&mut nano);
                let (session, lateness) = (format!("{line:?}"), Lateness::measure());
                let run = bench.run(["record", plan, "--port", cable.port(), "--out", &session]).expect_code(1);
                let took_s = board_s(&mut nano) - begun_s;
                let late_s = lateness.allowed().as_secs_f64();
                println!("{line:?}: {took_s:.1} s, of which {late_s:.1} s may be the computer's");
                assert!(took_s < 5.0 + late_s, "{line:?}: {took_s} s");
                let said = if line == Line::Silence { "does not answer" } else { "runs another program" };
                assert!(run.stderr.contains(said), "{line:?}: {run:?}");
                assert!(!bench.path().join(session).exists());
            });
        }
    });
}
