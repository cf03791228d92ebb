//! One operating point: the steady attitude of the robot at two motor speeds, and what it cost to compute.
//!
//! `cargo run --release -p sim --example point -- 50 10 full 120 published`: speeds in rpm, closure, duration in s, robot; then,
//! if wanted, another shape of its head, such as `cylinder`, and `tank` for the publication's tank about it.

use sim::body::closure::Closure;
use sim::params::{HeadShape, Robot, Tank};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: f64| arguments.get(i).map_or(Ok(default), |a| a.parse());
    let rpm = [number(0, 50.0)?, number(1, 10.0)?];
    let closure = match arguments.get(2).map_or("full", String::as_str) {
        "full" => Closure::Full,
        "lumped" => Closure::Lumped,
        "paper" => Closure::Paper,
        "held" => Closure::Held,
        other => return Err(format!("{other}: no such closure").into()),
    };

    // A robot, a profile of speeds, and what to put out make a trial.
    let name = arguments.get(4).map_or("published", String::as_str);
    let mut robot = Robot::built_in(name).ok_or_else(|| format!("{name}: no such robot"))?;
    robot.head.shape = match arguments.get(5).map(String::as_str) {
        None => robot.head.shape,
        Some("none") => HeadShape::None,
        Some("local") => HeadShape::Local,
        Some("cylinder") => HeadShape::Cylinder,
        Some("sphere") => HeadShape::Sphere,
        Some("spheroid") => HeadShape::Spheroid,
        Some(other) => return Err(format!("{other}: no such shape of a head").into()),
    };
    robot.tank = match arguments.get(6).map(String::as_str) {
        None => robot.tank,
        Some("tank") => Some(Tank::published()),
        Some(other) => return Err(format!("{other}: not `tank`").into()),
    };
    let profile = SpeedProfile::constant(rpm, number(3, 120.0)?)?;
    let mut trial = Trial::new(&robot, closure, profile, Options { rate_hz: 0.1, shapes: false })?;

    // It is an iterator over samples.
    let start = Instant::now();
    for sample in trial.by_ref() {
        let s = sample?;
        let [yaw, pitch, roll] = [s.yaw_rad, s.pitch_rad, s.roll_rad].map(f64::to_degrees);
        println!("{:6.1} s: yaw {yaw:8.2}, pitch {pitch:6.2}, roll {roll:6.2} deg; {:?}", s.time_s, s.bundling);
    }
    let wall_s = start.elapsed().as_secs_f64();

    // Its summary has the means over whole revolutions at the end of the run.
    let summary = trial.summary();
    let steady = &summary.steady;
    let [yaw, pitch, roll] = steady.attitude.map(|level| level.mean.to_degrees());
    println!(
        "mean of the last {:.1} s: yaw {yaw:.2}, pitch {pitch:.3}, roll {roll:.3} deg; settled: {}",
        steady.window_s, steady.settled
    );
    for (k, (force, torque)) in steady.force.iter().zip(&steady.axial_torque).enumerate() {
        let [x, y, z] = force.map(|level| level.mean * 1e3);
        println!("flagellum {}: force {x:.4}, {y:.4}, {z:.4} mN, torque {:.5} mN m", k + 1, torque.mean * 1e3);
    }
    println!(
        "{:.0} times real time: {} steps, {:.2} sweeps a step, {} inverses; contact {:.0} % of the run, gap {:.3} mm at least, {:.1} mN at most",
        summary.simulated_s / wall_s,
        summary.steps,
        summary.sweeps as f64 / summary.steps as f64,
        trial.solver().inverses_used(),
        100.0 * summary.contact_share,
        summary.min_gap_m * 1e3,
        summary.largest_contact_n * 1e3
    );
    Ok(())
}
