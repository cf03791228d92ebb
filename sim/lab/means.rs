//! Steady values, of trials of 120 s and solved for, against the means of the 600 s after the trials.
//!
//! `cargo run --release -p sim --example means -- physical 2 1/4` (robot, threads, part): 40 random speeds with decimals, 16
//! with one sense positive, 12 both negative, 12 on simple ratios. `45.96,-63.73` instead of a part selects other speeds.
//! `1/4@7` draws the speeds from another seed. `physical:0.25` has a quarter of the solver's tolerance in the trials: their own
//! error, which no ± has in it, is then less. `physical+soft`, `+thick` and `+thin` are other robots: flagella of a half of the
//! stiffness, rods of 1.2 times the radius, and half of the viscosity.
//!
//! Of values of a settled run, 95 of 100 are within their ± (twice the standard error) and that of the long mean.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::split_mix;
use sim::steady::{self, Problem};
use sim::trial::means::{FREE, Steady, TOUCHING};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};

/// Duration of a trial, s.
const TRIAL_S: f64 = 120.0;
/// Duration after it, s.
const AFTER_S: f64 = 600.0;
/// Blocks of that time: their scatter gives the error of its mean.
const BLOCKS: usize = 20;
/// Yaw, pitch, roll (deg), thrusts (mN).
const VALUES: usize = 5;

struct Row {
    rpm: [f64; 2],
    /// What the trial states, and the solution.
    stated: [Stated; 2],
    /// Mean after the trial, and its standard error.
    after: [[f64; 2]; VALUES],
}

struct Stated {
    /// The method, or the kind of the solution.
    method: &'static str,
    touches: bool,
    steady: Steady,
}

/// Seed of the speeds in `sim/docs/steady.md`.
const SEED: u64 = 20_240_517;

fn speeds(seed: u64) -> Vec<[f64; 2]> {
    let mut places = 1..;
    let mut random = || split_mix::uniform(seed, places.next().expect("a place"));
    let mut between = |low: f64, high: f64| ((low + (high - low) * random()) * 100.0).round() / 100.0;
    let mut out = Vec::new();
    for i in 0..16 {
        let (a, b) = (between(5.0, 90.0), between(-90.0, 90.0));
        out.push(if i % 2 == 0 { [a, b] } else { [b, a] });
    }
    for _ in 0..12 {
        out.push([between(-90.0, -5.0), between(-90.0, -5.0)]);
    }
    let ratios = [[1.0, 1.0], [1.0, -1.0], [1.0, 2.0], [2.0, -1.0], [1.0, 0.0], [0.0, 1.0], [3.0, 2.0], [3.0, -1.0]];
    for i in 0..12 {
        let [p, q]: [f64; 2] = ratios[i % ratios.len()];
        let fastest = p.abs().max(q.abs());
        let base = between(15.0 / fastest, 90.0 / fastest);
        out.push([p * base, q * base]);
    }
    out
}

/// `share`: the tolerance of the trial, as a share of the robot's.
fn row(robot: &Robot, rpm: [f64; 2], share: f64) -> Row {
    let profile = SpeedProfile::constant(rpm, TRIAL_S + AFTER_S).expect("a profile");
    let options = Options { rate_hz: 50.0, ..Options::default() };
    let mut finer = robot.clone();
    finer.solver.tolerance *= share;
    let mut trial = Trial::new(&finer, Closure::Full, profile, options).expect("parameters");
    let mut stated = None;
    let mut sums = [[0.0; VALUES]; BLOCKS];
    let mut counts = [0.0; BLOCKS];
    while let Some(sample) = trial.next() {
        let sample = sample.expect("a step");
        if sample.time_s < TRIAL_S {
            continue;
        }
        // What a trial that ends here states.
        stated.get_or_insert_with(|| trial.summary());
        let block = (((sample.time_s - TRIAL_S) / AFTER_S * BLOCKS as f64) as usize).min(BLOCKS - 1);
        let angles = [sample.yaw_rad, sample.pitch_rad, sample.roll_rad].map(f64::to_degrees);
        let thrusts = sample.force_n.map(|force| force[2] * 1e3);
        for (sum, value) in sums[block].iter_mut().zip(angles.into_iter().chain(thrusts)) {
            *sum += value;
        }
        counts[block] += 1.0;
    }
    let blocks: Vec<[f64; VALUES]> = sums.iter().zip(counts).map(|(s, n)| s.map(|v| v / n)).collect();
    let after = std::array::from_fn(|i| {
        let mean = blocks.iter().map(|b| b[i]).sum::<f64>() / BLOCKS as f64;
        let variance = blocks.iter().map(|b| (b[i] - mean).powi(2)).sum::<f64>() / (BLOCKS - 1) as f64;
        [mean, (variance / BLOCKS as f64).sqrt()]
    });
    let stated = stated.expect("the end of the trial");
    let (closure, start_rad) = (Closure::Full, [0.0; 2]);
    let problem = Problem { robot, closure, rpm, start_rad, longest_s: TRIAL_S, output: None, at_rest: None };
    let solved = steady::solve(&problem, &|_| true).expect("a steady state");
    let both = [("trial", stated), (solved.kind.name(), solved.summary)];
    let stated =
        both.map(|(method, summary)| Stated { method, touches: summary.contact_share > 0.0, steady: summary.steady });
    Row { rpm, stated, after }
}

/// Returns values with their ±.
fn stated(steady: &Steady) -> [[f64; 2]; VALUES] {
    let [yaw, pitch, roll] = steady.attitude;
    let [one, two] = steady.force.map(|force| force[2]);
    let levels = [yaw, pitch, roll, one, two];
    std::array::from_fn(|i| {
        let unit = if i < 3 { 1f64.to_degrees() } else { 1e3 };
        [levels[i].mean * unit, levels[i].uncertainty() * unit]
    })
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let named = arguments.first().map_or("physical", String::as_str);
    let (name, share) = named.split_once(':').unwrap_or((named, "1"));
    let robot = robot(name);
    let share = share.parse().expect("a share of the tolerance, such as 0.25");
    let threads: usize = arguments.get(1).map_or(2, |count| count.parse().expect("a number of threads"));
    let named: Vec<[f64; 2]> =
        arguments.iter().skip(2).filter(|text| text.contains(',')).map(|text| point(text)).collect();
    let (part, seed) = arguments.get(2).map_or(("1/1", None), |text| match text.split_once('@') {
        Some((part, seed)) => (part, Some(seed.parse().expect("a seed, such as 1/4@7"))),
        None => (text.as_str(), None),
    });
    let [part, parts] = part.split_once('/').map_or([1, 1], |(part, parts)| {
        [part, parts].map(|number| number.parse::<usize>().expect("a part, such as 1/4"))
    });
    let all = speeds(seed.unwrap_or(SEED)).into_iter().skip(part - 1).step_by(parts);
    let points: Vec<[f64; 2]> = if named.is_empty() { all.collect() } else { named };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let rows: Vec<Row> =
        pool.install(|| points.par_iter().with_max_len(1).map(|rpm| row(&robot, *rpm, share)).collect());
    println!(
        "| w1, w2 rpm | by | touch | settled | yaw, pitch, roll: stated ± (off), deg | thrusts: stated ± (off), mN | off over ± |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let mut totals = [Total::default(); 2];
    for row in &rows {
        for (stated, total) in row.stated.iter().zip(&mut totals) {
            print(row, stated, total);
        }
    }
    for (Total { settled, outside, wide }, name) in totals.iter().zip(["trials", "solutions"]) {
        let (count, values) = (rows.len(), settled * VALUES);
        println!(
            "{settled} of {count} {name} settled; of their {values} values {outside} outside; {wide} wider than allowed"
        );
    }
}

#[derive(Clone, Copy, Default)]
struct Total {
    settled: usize,
    /// Values of settled ones that are outside of their ±.
    outside: usize,
    /// Settled ones whose ± is wider than allowed.
    wide: usize,
}

fn print(row: &Row, of: &Stated, total: &mut Total) {
    let mut worst = 0f64;
    let texts: [String; VALUES] = std::array::from_fn(|i| {
        let ([value, uncertainty], [mean, error]) = (stated(&of.steady)[i], row.after[i]);
        let off = value - mean;
        let ratio = off.abs() / uncertainty.hypot(2.0 * error);
        worst = worst.max(ratio);
        total.outside += usize::from(of.steady.settled && ratio > 1.0);
        format!("{value:.3} ± {uncertainty:.3} ({off:.3})")
    });
    total.settled += usize::from(of.steady.settled);
    let limits = if of.touches { TOUCHING } else { FREE };
    total.wide += usize::from(of.steady.settled && !of.steady.is_known_within(&limits));
    let [yaw, pitch, roll, one, two] = &texts;
    let ([w1, w2], Stated { method, touches, steady: Steady { settled, .. } }) = (row.rpm, of);
    println!("| {w1}, {w2} | {method} | {touches} | {settled} | {yaw}, {pitch}, {roll} | {one}, {two} | {worst:.2} |");
}

/// Returns the robot of `physical+soft`.
fn robot(name: &str) -> Robot {
    let mut parts = name.split('+');
    let mut robot = parts.next().and_then(Robot::built_in).expect("physical or published");
    for part in parts {
        match part {
            "soft" => robot.flagellum.young_pa *= 0.5,
            "thick" => robot.flagellum.rod_radius_m *= 1.2,
            "thin" => robot.fluid.viscosity_pa_s *= 0.5,
            _ => panic!("{part}: soft, thick or thin"),
        }
    }
    robot
}

/// Returns the speeds of `50,10`, rpm.
fn point(text: &str) -> [f64; 2] {
    let speed = |text: &str| text.parse().expect("a speed in rpm");
    text.split_once(',').map(|(w1, w2)| [speed(w1), speed(w2)]).expect("two speeds in rpm, such as 50,10")
}
