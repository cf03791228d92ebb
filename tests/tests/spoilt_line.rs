//! A line that brings no telemetry stops the motors and ends the recording, whatever else it brings.

use serde_json::json;
use std::time::{Duration, Instant};
use tests::{Bench, Cable, Run, logs, nano, wait_for_logs};

/// A pre-roll, so that a line can go bad before the motors turn.
const PLAN: &str = "[session]\nname = \"bench\"\n[trial]\ncalibrate = 0\npreroll = 1\nrun = 60\ndecay = 0\n\
                    [speeds]\npairs = [[50, 10]]\n";

/// The motors' deadline by default.
const DEADLINE: Duration = Duration::from_millis(500);

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
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    let mut nano = nano(["--speed", "1"]);
    let cable = Cable::new(nano.port());
    let session = bench.path().join("session");
    let mut recording =
        bench.start(["record", plan.to_str().unwrap(), "--port", cable.port(), "--out", "session", "--json"]);
    wait_for_logs(&session, 1);
    std::thread::sleep(Duration::from_millis(at_ms));
    let what = format!("case {number}: {line:?} after {at_ms} ms, the board hears: {hears}");

    let spoilt = Instant::now();
    spoil(&cable, line, random);
    if !hears {
        cable.spoil_to_board(|_| Vec::new());
    }
    let (mut turned, mut ended) = (Duration::ZERO, None);
    while ended.is_none() || spoilt.elapsed() < Duration::from_secs(2) {
        if nano.control("status").unwrap()["pwm"] != json!([0, 0]) {
            turned = spoilt.elapsed();
        }
        if ended.is_none() && recording.try_wait().unwrap().is_some() {
            ended = Some(spoilt.elapsed());
        }
        assert!(spoilt.elapsed() < Duration::from_secs(20), "{what}: the recording goes on");
        std::thread::sleep(Duration::from_millis(10));
    }
    let ended = ended.unwrap();
    let run = Run::of(recording).expect_code(1);
    assert!(turned <= DEADLINE + Duration::from_secs(1), "{what}: the motors turned for {turned:?}");
    assert!(ended <= Duration::from_secs(5), "{what}: it ended after {ended:?}");
    // The line may go bad before the board has the schedule.
    let said = ["the board stopped sending", "did not answer StartSchedule"];
    assert!(said.iter().any(|said| run.stderr.contains(said)), "{what}: {run:?}");
    let log = logs(&session).remove(0);
    let info = bench.run(["info", log.to_str().unwrap(), "--json"]).json();
    assert_eq!((&info["clean"], &info["end"]), (&true.into(), &"failed".into()), "{what}: {info}");
    format!("{what}: motors off after {:.2} s, ended after {:.2} s", turned.as_secs_f64(), ended.as_secs_f64())
}

/// `LINES=100 cargo test --release -p tests --test spoilt_line only -- --nocapture` runs more than the usual 10.
#[test]
fn only_telemetry_keeps_the_motors_turning() {
    let count: u64 = std::env::var("LINES").map_or(10, |count| count.parse().expect("LINES is a number"));
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
    let bench = Bench::new();
    let plan = bench.file("plan.toml", PLAN);
    std::thread::scope(|scope| {
        for line in LINES.into_iter().filter(|line| *line != Line::Answers) {
            let (bench, plan) = (&bench, plan.to_str().unwrap());
            scope.spawn(move || {
                let nano = nano(["--speed", "1"]);
                let cable = Cable::new(nano.port());
                spoil(&cable, line, Random(7));
                let begun = Instant::now();
                let session = format!("{line:?}");
                let run = bench.run(["record", plan, "--port", cable.port(), "--out", &session]).expect_code(1);
                println!("{line:?}: {:.1} s", begun.elapsed().as_secs_f64());
                assert!(begun.elapsed() < Duration::from_secs(5), "{line:?}: {:?}", begun.elapsed());
                let said = if line == Line::Silence { "does not answer" } else { "runs another program" };
                assert!(run.stderr.contains(said), "{line:?}: {run:?}");
                assert!(!bench.path().join(session).exists());
            });
        }
    });
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
