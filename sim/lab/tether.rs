//! The tether constants by which the mean over starting phases of |yaw| at (90, 90) rpm after 120 s is 180 degrees.
//!
//! `cargo run --release -p sim --example tether -- published 8` (robot, starting phases): the constant of each closure, the
//! mean that it gives, and |yaw| at the least and at the largest.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::steady::phase::starts;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};

const RPM: [f64; 2] = [90.0, 90.0];
const YAW_DEG: f64 = 180.0;

/// |yaw| of each starting phase with the tether of a closure set to `tether` (N m/rad), deg.
fn yaws(robot: &Robot, closure: Closure, tether: f64, count: usize) -> Vec<f64> {
    let mut robot = robot.clone();
    robot.joint.tether_full_nm_per_rad = tether;
    robot.joint.tether_lumped_nm_per_rad = tether;
    let yaw = |start_deg: [f64; 2]| {
        let profile = SpeedProfile::constant(RPM, 120.0).expect("a profile");
        let profile = profile.from_angles(start_deg.map(f64::to_radians));
        let mut trial = Trial::new(&robot, closure, profile, Options::default()).expect("parameters");
        trial.finish().expect("a run").steady.attitude[0].mean.abs().to_degrees()
    };
    starts(RPM, count).into_par_iter().map(yaw).collect()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let robot = Robot::built_in(arguments.first().map_or("physical", String::as_str)).expect("physical or published");
    let count: usize = arguments.get(1).map_or(8, |count| count.parse().expect("a number of starting phases"));
    println!("| closure | tether, N m/rad | mean of abs(yaw), deg | least to largest |\n| --- | --- | --- | --- |");
    for closure in [Closure::Full, Closure::Lumped] {
        let mut tether = robot.joint.tether(closure);
        // The moment on the robot hardly depends on the yaw, so the yaw is almost as 1/tether.
        for round in 0.. {
            let yaws = yaws(&robot, closure, tether, count);
            let mean = yaws.iter().sum::<f64>() / count as f64;
            if (mean / YAW_DEG - 1.0).abs() < 1e-5 || round == 8 {
                let least = yaws.iter().copied().fold(f64::INFINITY, f64::min);
                let largest = yaws.iter().copied().fold(0.0, f64::max);
                println!("| {closure:?} | {tether:.4e} | {mean:.3} | {least:.2} to {largest:.2} |");
                break;
            }
            tether *= mean / YAW_DEG;
        }
    }
}
