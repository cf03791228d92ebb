//! The three closures of the base's equation of motion at the published points: the table of [`sim::body::closure`]. Both
//! helices start at the same angle.
//!
//! `cargo run --release -p sim --example closures`: yaw at two times; the mean rate about z_B over the last minute; for the
//! closure `paper` the rate at which the base's drag alone balances the mean couple, (F1y - F2y) d/2 over 2 pi mu C_r
//! r_h^3; and the range of the axis's tilt.

use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::sample::Sample;
use sim::trial::{Options, Trial};

fn main() {
    let robot = Robot::published();
    println!(
        "| speeds rpm | closure | yaw at 120 s | at 240 s, deg | rate about z_B, deg/s | by drag alone | tilt, deg | settled |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for rpm in [[50.0, 10.0], [0.0, 45.0], [90.0, 90.0], [-90.0, 90.0]] {
        for closure in [Closure::Full, Closure::Lumped, Closure::Paper] {
            let profile = SpeedProfile::constant(rpm, 240.0).expect("a profile");
            let options = Options { rate_hz: 200.0, shapes: false };
            let mut trial = Trial::new(&robot, closure, profile, options).expect("parameters");
            let samples = trial.by_ref().collect::<Result<Vec<_>, _>>().expect("a run");
            let last: Vec<&Sample> = samples.iter().filter(|s| s.time_s > 180.0).collect();
            let mean = |value: &dyn Fn(&Sample) -> f64| last.iter().map(|s| value(s)).sum::<f64>() / last.len() as f64;
            let couple = |s: &Sample| (s.force_n[0][1] - s.force_n[1][1]) * 0.5 * robot.base.motor_distance_m;
            let by_drag = match closure {
                Closure::Paper => format!("{:.3}", (mean(&couple) / robot.base_drag()).to_degrees()),
                _ => String::new(),
            };
            let tilt = |s: &&Sample| (s.pitch_rad.cos() * s.roll_rad.cos()).acos().to_degrees();
            let yaw = |time: f64| {
                samples.iter().find(|s| s.time_s >= time - 1e-9).map_or(f64::NAN, |s| s.yaw_rad.to_degrees())
            };
            println!(
                "| ({}, {}) | {closure:?} | {:.1} | {:.1} | {:.3} | {by_drag} | {:.1} to {:.1} | {} |",
                rpm[0],
                rpm[1],
                yaw(120.0),
                yaw(240.0),
                mean(&|s| s.rate_rad_s[2]).to_degrees(),
                last.iter().map(tilt).fold(f64::INFINITY, f64::min),
                last.iter().map(tilt).fold(0.0, f64::max),
                trial.summary().steady.settled
            );
        }
    }
}
