//! Sweeps that are killed and interrupted, their memory, and their cost.

use rustix::process::Signal;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};
use tests::{Bench, Run, memory_kb, signal};

/// 48 points over robots and speeds, with impossible ones among them.
const PLAN: &str = "[session]\nname = \"bench\"\n[trial]\nrun = 4\nmethod = \"trial\"\nphases = 2\n[vary]\n\
                    \"group.spacing\" = [0.5, 1, 1.5]\n\"group.stiffness\" = [0.5, 2]\n\
                    [speeds]\ngrid = { w1 = [-60, 60, 40], w2 = [20, 60, 40] }\n";

fn tables(sweep: &Path) -> [Vec<u8>; 2] {
    ["table.parquet", "table.csv"].map(|name| std::fs::read(sweep.join(name)).unwrap())
}

/// Returns the points that a sweep has.
fn done(bench: &Bench, sweep: &str) -> u64 {
    bench.run(["sweep", "status", sweep, "--json"]).expect_code(0).json()["done"].as_u64().unwrap()
}

/// Numbers that look random, of a seed.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }
}

/// `kill -9` at random moments, as often as `KILLS` says: the table has the same bytes as without.
#[test]
fn killed_shards_give_the_same_table() {
    let kills = std::env::var("KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(3);
    let bench = Bench::new();
    bench.file("plan.toml", PLAN);
    let begun = Instant::now();
    bench.run(["sweep", "plan.toml", "--out", "serial", "--jobs", "1"]).expect_code(3);
    let report = bench.run(["report", "serial", "--json"]).expect_code(0).json();
    let whole = begun.elapsed();
    let page = std::fs::read_to_string(bench.path().join(report["html"].as_str().unwrap())).unwrap();
    for plan in [
        "<td>group.stiffness</td><td>0.5, 2</td>",
        "<td>every pair of w1 = −60 to 60 by 40 and w2 = 20, 60 rpm</td>",
        ">Computed by</th><td>biflag ",
    ] {
        assert!(page.contains(plan), "the page of a sweep shows its plan: {plan}");
    }
    let wanted = tables(&bench.path().join("serial"));
    let mut random = Random(0x5EED_0000_0000_0007);
    for (round, shards) in [1, 3, 8].into_iter().enumerate() {
        let start = |shard: u64, out: &str| {
            let shard = format!("{shard}/{shards}");
            bench.start(["sweep", "plan.toml", "--shard", &shard, "--resume", "--out", out])
        };
        let wanted_kills = kills / 3 + usize::from(round < kills % 3);
        let (mut killed, mut sweeps) = (0, 1);
        while killed < wanted_kills {
            let mut child = start(1 + random.below(shards), &format!("of{shards}-{sweeps}"));
            let micros = whole.as_micros() as u64 / shards / 2;
            std::thread::sleep(Duration::from_micros(random.below(micros.max(1))));
            if child.try_wait().unwrap().is_none() {
                signal(&child, Signal::KILL);
                killed += 1;
            } else {
                // A shard that has ended is not killed any more: the next ones belong to another sweep.
                sweeps += 1;
            }
            child.wait().unwrap();
        }
        for sweep in 1..=sweeps {
            let out = format!("of{shards}-{sweep}");
            for shard in 1..=shards {
                let run = Run::of(start(shard, &out));
                assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
            }
            bench.run(["sweep", "merge", &out]).expect_code(3);
            assert!(tables(&bench.path().join(&out)) == wanted, "{out}");
        }
        println!("{shards} shards: {killed} kills in {sweeps} sweeps, the table has the same bytes");
    }
}

#[test]
fn ctrl_c_keeps_what_is_done() {
    let bench = Bench::new();
    bench.file("plan.toml", PLAN);
    bench.run(["sweep", "plan.toml", "--out", "whole"]).expect_code(3);
    let child = bench.start(["sweep", "plan.toml", "--out", "cut", "--json"]);
    let begun = Instant::now();
    while !bench.path().join("cut/sweep.toml").exists() || done(&bench, "cut") < 3 {
        assert!(begun.elapsed() < Duration::from_secs(60), "no points");
    }
    signal(&child, Signal::INT);
    let run = Run::of(child).expect_code(130);
    let kept = run.json()["done"].as_u64().unwrap();
    assert!((3..48).contains(&kept), "{kept}");
    assert_eq!(done(&bench, "cut"), kept);
    let names: Vec<_> = std::fs::read_dir(bench.path().join("cut")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(!names.iter().any(|name| name.to_string_lossy().ends_with(".open")), "{names:?}");
    bench.run(["sweep", "plan.toml", "--out", "cut", "--resume"]).expect_code(3);
    assert!(tables(&bench.path().join("cut")) == tables(&bench.path().join("whole")));
}

/// Returns the peak memory of a child, MB.
fn peak_mb(mut child: Child) -> f64 {
    let mut peak_kb = 0.0f64;
    loop {
        peak_kb = peak_kb.max(memory_kb(&child, "VmHWM"));
        if let Some(status) = child.try_wait().unwrap() {
            assert_eq!(status.code(), Some(3));
            return peak_kb / 1024.0;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Three times as many points, impossible ones that cost nothing else, need about the same memory, to compute them as to
/// merge them: a block of rows, and a little for each row group.
#[test]
fn memory_does_not_grow_with_the_points() {
    let bench = Bench::new();
    let peaks = [16_384, 49_152].map(|count| {
        let plan = format!(
            "[vary]\n\"group.spacing\" = {{ from = 0.1, to = 0.4, count = {count} }}\n[speeds]\npairs = [[50, 10]]\n"
        );
        let (plan, out) = (bench.file("plan.toml", &plan), format!("out{count}"));
        let peak = peak_mb(bench.start(["sweep", plan.to_str().unwrap(), "--out", &out]));
        println!("{count} points: peak memory {peak:.1} MB");
        peak
    });
    assert!(peaks[0] > 1.0 && peaks[0] < 120.0, "{peaks:?}");
    // In proportion it would be three times as much.
    assert!(peaks[1] < 1.5 * peaks[0], "{peaks:?}");
}

/// A million impossible points are merged in one pass over the parts. Prints its time and memory.
#[test]
#[ignore = "a minute, and a gigabyte on the disk; make proof"]
fn a_million_points_are_merged_in_one_pass() {
    let bench = Bench::new();
    bench.file(
        "plan.toml",
        "[vary]\n\"group.spacing\" = { from = 0.1, to = 0.4, count = 1000000 }\n[speeds]\npairs = [[50, 10]]\n",
    );
    bench.run(["sweep", "plan.toml", "--shard", "1/1", "--out", "million"]).expect_code(3);
    let begun = Instant::now();
    let peak = peak_mb(bench.start(["sweep", "merge", "million"]));
    println!("a million points: merged in {:.1} s, peak memory {peak:.1} MB", begun.elapsed().as_secs_f64());
    assert!(peak < 200.0);
}

/// Robots and speeds all over: every point is a row, without a panic or a number that is none. Prints the cost of speeds
/// alone and of robots that all differ.
#[test]
#[ignore = "takes half an hour; make proof"]
fn ten_thousand_points_are_rows() {
    let count: u64 = std::env::var("POINTS").ok().and_then(|points| points.parse().ok()).unwrap_or(10_000);
    let speeds = "\"speeds.w1_rpm\" = { from = -90, to = 90 }\n\"speeds.w2_rpm\" = { from = 0, to = 90 }\n";
    let robots = "\"group.stiffness\" = { from = 0.1, to = 10, scale = \"log\" }\n\
                  \"group.spacing\" = { from = 0.4, to = 2.5 }\n\"group.pitch\" = { from = 0.3, to = 2 }\n\
                  \"group.radius\" = { from = 0.3, to = 2 }\n\"fluid.viscosity_pa_s\" = { from = 0.3, to = 3, scale = \"log\" }\n";
    let bench = Bench::new();
    for (name, axes) in [("speeds alone", speeds.to_owned()), ("robots that all differ", format!("{speeds}{robots}"))] {
        let plan = format!("[trial]\nrun = 12\n[vary]\ndesign = {{ sobol = {count}, seed = 7 }}\n{axes}");
        let plan = bench.file("plan.toml", &plan);
        let out = name.replace(' ', "-");
        let begun = Instant::now();
        let mut child = bench.start(["sweep", plan.to_str().unwrap(), "--out", &out, "--json"]);
        let said = child.stderr.take().unwrap();
        let said = std::thread::spawn(move || std::io::read_to_string(said).unwrap());
        let mut peak_kb = 0.0f64;
        while child.try_wait().unwrap().is_none() {
            peak_kb = peak_kb.max(memory_kb(&child, "VmHWM"));
            std::thread::sleep(Duration::from_millis(20));
        }
        let seconds = begun.elapsed().as_secs_f64();
        let run = Run::of(child);
        let said = said.join().unwrap();
        assert!(!said.contains("panicked"), "{said}");
        let answer = run.json();
        let failed = answer["failed"].as_u64().unwrap();
        assert_eq!((answer["done"].as_u64(), answer["missing"].as_u64()), (Some(count), Some(0)), "{answer}");
        let folder = bench.path().join(&out);
        let text = std::fs::read_to_string(folder.join("table.csv")).unwrap();
        let rows: Vec<&str> = text.lines().filter(|line| !line.starts_with('#')).skip(1).collect();
        assert_eq!(rows.len() as u64, count);
        assert!(rows.iter().all(|row| !row.contains("NaN") && !row.contains("inf,")));
        assert!(!text.contains("panicked") && !text.contains("not a finite number"));
        let bytes = std::fs::metadata(folder.join("table.parquet")).unwrap().len();
        println!(
            "{name}: {count} points, {failed} failed, {:.2} points a second, peak memory {:.0} MB, {} bytes a row in Parquet",
            count as f64 / seconds,
            peak_kb / 1024.0,
            bytes / count
        );
    }
}
