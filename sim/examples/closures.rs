//! What the three closures of the base's equation of motion give at the published points.
//!
//! `cargo run --release -p sim --example closures`: yaw at two times, the rate at which it still turns, and that rate as
//! it follows from the closure `paper`, whose steady yaw moment only drag can hold: mean (F1y - F2y) d/2 over C_r's drag.

use sim::params::Robot;
use sim::profile::SpeedProfile;
use sim::robot::closure::Closure;
use sim::sample::Sample;
use sim::trial::{Options, Trial};

fn mean(samples: &[Sample], from: f64, to: f64, value: impl Fn(&Sample) -> f64) -> f64 {
    let picked: Vec<f64> = samples.iter().filter(|s| s.time_s > from && s.time_s <= to).map(value).collect();
    picked.iter().sum::<f64>() / picked.len() as f64
}

fn main() {
    let robot = Robot::default();
    println!("| speeds rpm | closure | yaw at 60 s | at 120 s | at 240 s | turns at, deg/s | by drag alone | pitch | settled |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for rpm in [[50.0, 10.0], [0.0, 45.0], [90.0, 90.0], [-90.0, 90.0]] {
        for closure in [Closure::Full, Closure::Lumped, Closure::Paper] {
            let profile = SpeedProfile::constant(rpm, 240.0).expect("a profile");
            let mut trial = Trial::new(&robot, closure, profile, Options::default()).expect("parameters");
            let samples = trial.by_ref().collect::<Result<Vec<_>, _>>().expect("a run");
            let yaw = |at: f64| mean(&samples, at - 12.0, at, |s| s.yaw_rad).to_degrees();
            let rate = (yaw(240.0) - yaw(180.0)) / 60.0;
            let couple = |s: &Sample| (s.force_n[0][1] - s.force_n[1][1]) * 0.5 * robot.base.motor_distance_m;
            let by_drag = match closure {
                Closure::Paper => {
                    format!("{:.3}", (mean(&samples, 174.0, 234.0, couple) / robot.base_drag()).to_degrees())
                }
                _ => "".to_owned(),
            };
            println!(
                "| ({}, {}) | {closure:?} | {:.1} | {:.1} | {:.1} | {rate:.3} | {by_drag} | {:.2} | {} |",
                rpm[0],
                rpm[1],
                yaw(60.0),
                yaw(120.0),
                yaw(240.0),
                mean(&samples, 228.0, 240.0, |s| s.pitch_rad).to_degrees(),
                trial.summary().steady.settled
            );
        }
    }
}
