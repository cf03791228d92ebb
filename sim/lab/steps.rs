//! Errors of means by the time steps: default steps against much shorter ones, at twelve points of both senses.
//!
//! `cargo run --release -p sim --example steps` prints the table of `sim/docs/cost.md`; speeds in rpm after `--` select one
//! point, and a name after them another robot than `published`. `-- random physical 60` runs trials of 160 s at that many random
//! pairs of speeds with decimals instead, also `physical+tank`, and prints how far settled ones are from those with steps of a third.
//!
//! Speeds are multiples of 10 rpm, so every beat of the two motors repeats after [`PERIOD`]. Means are taken over the whole
//! periods of the second half of a run, when the slow mode of the flagella (10 to 18 s) has decayed; their scatter is the
//! standard error of the mean over the periods.

use rayon::prelude::*;
use sim::body::attitude::euler_zyx;
use sim::body::closure::Closure;
use sim::body::shaft::MotorState;
use sim::params::{HeadShape, Precision, Robot, Tank};
use sim::split_mix;
use sim::step::{Solver, StepControl};
use sim::trial::means::Steady;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::error::Error;
use std::f64::consts::PI;
use std::time::Instant;

/// One revolution at 10 rpm, s.
const PERIOD: f64 = 6.0;
/// Periods of a run.
const PERIODS: usize = 20;
/// Runs with default steps, of which the fastest counts.
const REPEATS: u32 = 3;

/// Duration of a trial at random speeds, s, and their seed.
const RANDOM_S: f64 = 160.0;
const SEED: u64 = 7;

/// Speeds of flagella 1 and 2 at each point, rpm.
const POINTS: [f64; 24] = [
    50.0, 10.0, 90.0, 90.0, -90.0, 90.0, 0.0, 45.0, 90.0, 60.0, 60.0, 20.0, -50.0, -30.0, -80.0, -20.0, -90.0, -80.0,
    -90.0, -90.0, -60.0, -60.0, -30.0, -90.0,
];

/// Thrusts (N), yaw, pitch and roll (degrees), and whether rods touch.
type Values = [f64; 6];

#[derive(Clone, Default)]
struct Run {
    /// Means over each period.
    periods: Vec<Values>,
    steps: u32,
    sweeps: u32,
    seconds: f64,
}

impl Run {
    fn settled(&self) -> &[Values] {
        &self.periods[PERIODS / 2..]
    }

    fn mean(&self, c: usize) -> f64 {
        self.settled().iter().map(|v| v[c]).sum::<f64>() / self.settled().len() as f64
    }

    fn scatter(&self, c: usize) -> f64 {
        let (mean, n) = (self.mean(c), self.settled().len() as f64);
        (self.settled().iter().map(|v| (v[c] - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()
    }

    fn largest_thrust(&self) -> f64 {
        self.mean(0).abs().max(self.mean(1).abs())
    }

    /// Errors of thrust (per cent of the larger one), yaw and tilt (degrees) against another run.
    fn errors(&self, reference: &Run) -> [f64; 3] {
        let error = |c: usize| (self.mean(c) - reference.mean(c)).abs();
        [100.0 * error(0).max(error(1)) / reference.largest_thrust(), error(2), error(3).hypot(error(4))]
    }
}

fn run(robot: &Robot, rpm: [f64; 2]) -> Result<Run, Box<dyn Error>> {
    let speeds = rpm.map(|r| r * PI / 30.0);
    let motors = |t: f64| speeds.map(|speed| MotorState { angle: speed * t, speed });
    let mut solver = Solver::new(robot, Closure::Full)?;
    let (mut state, mut control) = (solver.at_rest(), StepControl::default());
    state.motors = motors(0.0);
    let (mut out, mut last) = (Run::default(), [0.0; 6]);
    let start = Instant::now();
    for period in 1..=PERIODS {
        let mut sums = [0.0; 6];
        let end = PERIOD * period as f64;
        while state.time < end {
            let before = state.time;
            let report = control.advance(&mut solver, &mut state, end, &motors)?;
            out.steps += 1;
            out.sweeps += report.sweeps;
            let thrust = |k: usize| report.fluid[k].force.z + report.contact[k].force.z;
            let [_, pitch, roll] = euler_zyx(&state.body.attitude);
            let [yaw, pitch, roll] = [state.body.yaw, pitch, roll].map(f64::to_degrees);
            let values = [thrust(0), thrust(1), yaw, pitch, roll, f64::from(u8::from(report.touching > 0))];
            for c in 0..6 {
                sums[c] += 0.5 * (last[c] + values[c]) * (state.time - before);
            }
            last = values;
        }
        out.periods.push(sums.map(|sum| sum / PERIOD));
    }
    out.seconds = start.elapsed().as_secs_f64();
    Ok(out)
}

/// A robot with steps whose error is a seventh of the default, over `times`.
fn tight(mut robot: Robot, times: f64) -> Robot {
    robot.solver.step_error = 1e-4 / times;
    robot.solver.step_rad = 0.15 / times;
    robot.solver.tolerance = 2.5e-3 / times;
    robot.solver.far_field = Precision::Double;
    robot
}

/// Returns the steady state of a trial of [`RANDOM_S`]; `None` if a step fails.
fn steady(robot: &Robot, rpm: [f64; 2]) -> Option<Steady> {
    let profile = SpeedProfile::constant(rpm, RANDOM_S).ok()?;
    Some(Trial::new(robot, Closure::Full, profile, Options::default()).ok()?.finish().ok()?.steady)
}

/// Prints how far the settled angles of trials at random speeds are from those with steps of a third.
fn random(robot: &Robot, count: u64) {
    let mut fine = robot.clone();
    (fine.solver.step_error, fine.solver.step_rad, fine.solver.tolerance) = (1e-4, 0.1, 2.5e-3);
    let speed = |place| ((180.0 * split_mix::uniform(SEED, place) - 90.0) * 100.0).round() / 100.0;
    let mut rows: Vec<_> = (0..count)
        .into_par_iter()
        .filter_map(|i| {
            let rpm = [speed(2 * i), speed(2 * i + 1)];
            let (usual, fine) = (steady(robot, rpm)?, steady(&fine, rpm)?);
            let angles = usual.attitude.iter().zip(&fine.attitude).map(|(a, b)| (a.mean - b.mean).abs());
            let is_outside = angles.clone().zip(&usual.attitude).any(|(off, level)| off > level.uncertainty());
            (usual.settled && fine.settled).then(|| (angles.fold(0.0, f64::max).to_degrees(), is_outside, rpm))
        })
        .collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let outside = rows.iter().filter(|row| row.1).count();
    let (Some((median, ..)), Some((worst, _, rpm))) = (rows.get(rows.len() / 2), rows.last()) else { return };
    println!(
        "{count} pairs, {} settled, {outside} with an angle outside its ±; largest error of an angle: median {median:.3}, worst {worst:.3} deg at {rpm:?} rpm",
        rows.len()
    );
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [mode, name, count] = arguments.as_slice()
        && mode == "random"
    {
        let plain = name.trim_end_matches("+tank");
        let mut robot = Robot::built_in(plain).ok_or_else(|| format!("{name}: no such robot"))?;
        if plain != name {
            (robot.tank, robot.head.shape) = (Some(Tank::published()), HeadShape::Cylinder);
        }
        random(&robot, count.parse()?);
        return Ok(());
    }
    let points = match arguments.as_slice() {
        [one, two, ..] => vec![[one.parse()?, two.parse()?]],
        _ => POINTS.as_chunks().0.to_vec(),
    };
    let name = arguments.get(2).map_or("published", String::as_str);
    let robot = Robot::built_in(name).ok_or_else(|| format!("{name}: no such robot"))?;
    println!(
        "| speeds rpm | contact | larger thrust mN, yaw, pitch, roll deg | thrust error (scatter) | yaw error | tilt error (scatter) | steps | sweeps a step | real-time factor | tight: thrust, yaw, tilt error |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for rpm in points {
        let usual = run(&robot, rpm)?;
        let again = |least: f64, _| run(&robot, rpm).map(|run| least.min(run.seconds));
        let seconds = (1..REPEATS).try_fold(usual.seconds, again)?;
        let (shorter, shortest) = (run(&tight(robot.clone(), 1.0), rpm)?, run(&tight(robot.clone(), 2.0), rpm)?);
        let [thrust, yaw, tilt] = usual.errors(&shortest);
        let ([w1, w2], [last_thrust, last_yaw, last_tilt]) = (rpm, shorter.errors(&shortest));
        let scatter = 100.0 * usual.scatter(0).max(usual.scatter(1)) / shortest.largest_thrust();
        println!(
            "| ({w1}, {w2}) | {:.2} | {:.2}, {:.1}, {:.2}, {:.2} | {thrust:.2} % ({scatter:.2} %) | {yaw:.3} deg | {tilt:.3} deg ({:.3}) | {} | {:.2} | {:.0} | {last_thrust:.2} %, {last_yaw:.3}, {last_tilt:.3} deg |",
            shortest.mean(5),
            1e3 * shortest.largest_thrust(),
            shortest.mean(2),
            shortest.mean(3),
            shortest.mean(4),
            usual.scatter(3).hypot(usual.scatter(4)),
            usual.steps,
            f64::from(usual.sweeps) / f64::from(usual.steps),
            PERIOD * PERIODS as f64 / seconds,
        );
    }
    Ok(())
}
