//! Flagella that wrap round each other, and unwrap when one motor reverses.
//!
//! `cargo run --release -p sim --example bundle`

use sim::body::closure::Closure;
use sim::contact::history::BundlingHistory;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    // The published flagella are too stiff, too short and too far apart for a bundle.
    let mut robot = Robot::published();
    robot.flagellum.young_pa = 1e5;
    robot.flagellum.axial_length_m = 0.3;
    robot.base.motor_distance_m = 0.025;

    // Times in s and speeds in rpm, linear in between.
    let profile = SpeedProfile::from_points(&[
        (0.0, [0.0, 0.0]),
        (0.5, [90.0, 90.0]),
        (35.0, [90.0, 90.0]),
        (36.0, [90.0, -90.0]),
        (60.0, [90.0, -90.0]),
    ])?;

    let mut trial = Trial::new(&robot, Closure::Full, profile, Options { rate_hz: 20.0, shapes: false })?;
    let mut history = BundlingHistory::default();
    for sample in trial.by_ref() {
        let sample = sample?;
        if let Some(change) = history.push(sample.time_s, sample.bundling) {
            println!(
                "{:5.1} s: {:?}, the axes wind round each other {:.2} times",
                change.time_s, change.bundling, sample.winding_turns
            );
        }
    }
    let summary = trial.summary();
    println!(
        "{:?} at most; overlap {:.1e} m at most, force of one pair {:.1} mN at most",
        summary.bundling,
        summary.max_penetration_m,
        summary.largest_contact_n * 1e3
    );
    Ok(())
}
