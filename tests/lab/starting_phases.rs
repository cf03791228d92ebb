//! Scatter of repeats at equal speeds by the angles at which the flagella start, without and with `phase_deg`.
//!
//! `cargo run --release -p tests --example starting_phases -- 8`: repeats of each. Before each trial `biflag align` turns both
//! flagella of the emulated board at random, which keeps the marks.

use std::io::Write;
use std::process::Stdio;
use tests::synthetic_rig::Random;
use tests::{Bench, Run, bare_nano};

const TRIAL: &str =
    "[board]\ndeadline_ms = 5000\n[trial]\ncalibrate = 2\npreroll = 6\nrun = 40\ndecay = 2\nrest_at_most = 20\n";
const SPEEDS: &str = "[speeds]\npairs = [[90, 90]]\n";

fn main() {
    let repeats = std::env::args().nth(1).map_or(8, |count| count.parse().expect("a number of repeats"));
    let bench = Bench::new();
    let nano = bare_nano(["--robot", "published", "--speed", "max", "--sensor", "ideal"]);
    bench.run(["settings", "--new", "--port", nano.port()]).expect_code(0);
    let align = |keys: &str| {
        let mut child = bench.command(["align", "--port", nano.port()]).stdin(Stdio::piped()).spawn().expect("biflag");
        child.stdin.take().expect("its input").write_all(keys.as_bytes()).expect("keys");
        Run::of(child)
    };
    align("ok\n").expect_code(0);
    let mut random = Random(20_261_125);
    println!("| start | angle | mean, ° | standard deviation, ° | least, ° | largest, ° |");
    println!("| --- | --- | ---: | ---: | ---: | ---: |");
    for (name, line) in [("as they stand", ""), ("phase_deg = [0, 90]", "phase_deg = [0, 90]\n")] {
        let mut found = [const { Vec::new() }; 3];
        for repeat in 0..repeats {
            let steps = [0, 1].map(|_| (random.uniform() * 36.0) as usize);
            align(&format!("{}2{}\nq\n", "f".repeat(steps[0]), "f".repeat(steps[1]))).expect_code(130);
            let session = format!("{}{repeat}", name.chars().filter(char::is_ascii_alphabetic).collect::<String>());
            let plan = bench.file("plan.toml", &format!("[session]\nname = \"{session}\"\n{TRIAL}{line}{SPEEDS}"));
            let run = bench.run([
                "record".as_ref(),
                plan.as_os_str(),
                "--json".as_ref(),
                "--port".as_ref(),
                nano.port().as_ref(),
            ]);
            let trial = &run.json()["trials"][0];
            for (values, key) in found.iter_mut().zip(["yaw_deg", "pitch_deg", "roll_deg"]) {
                values.push(trial[key].as_f64().unwrap_or_else(|| panic!("no {key}: {}", run.stderr)));
            }
        }
        for (values, angle) in found.iter().zip(["yaw", "pitch", "roll"]) {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
            let deviation = (square / (values.len() as f64 - 1.0)).sqrt();
            let (least, largest) =
                values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(*value), b.max(*value)));
            println!("| {name} | {angle} | {mean:.2} | {deviation:.2} | {least:.2} | {largest:.2} |");
        }
    }
}
