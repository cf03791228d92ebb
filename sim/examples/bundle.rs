//! Flagella that wrap round each other, and unwrap when one motor reverses.
//!
//! `cargo run --release -p sim --example bundle -- [young_pa] [distance_m] [rpm] [reverse_s] [end_s] [axial_m]`

use sim::params::Robot;
use sim::profile::SpeedProfile;
use sim::robot::closure::Closure;
use sim::trial::{Options, Trial};

fn main() {
    let number = |i: usize, default: f64| std::env::args().nth(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let mut robot = Robot::default();
    robot.flagellum.young_pa = number(1, 1e5);
    robot.base.motor_distance_m = number(2, 0.025);
    robot.flagellum.axial_length_m = number(6, 0.1962);
    robot.contact.friction = number(7, 0.0);
    let (rpm, reverse, end) = (number(3, 90.0), number(4, 30.0), number(5, 60.0));
    let w2 = number(8, rpm);
    let profile = SpeedProfile::from_points(&[
        (0.0, [0.0, 0.0]),
        (0.5, [rpm, w2]),
        (reverse, [rpm, w2]),
        (reverse + 1.0, [rpm, -w2]),
        (end, [rpm, -w2]),
    ])
    .expect("a profile");
    let closure = if std::env::var("HELD").is_ok() { Closure::Held } else { Closure::Full };
    let mut trial = Trial::new(&robot, closure, profile, Options { rate_hz: 1.0, shapes: true }).expect("parameters");
    let start = std::time::Instant::now();
    for sample in trial.by_ref() {
        match sample {
            Ok(s) => println!(
                "{:.1} s: {:?}, winding {:.2} turns, gap {:.4} mm, penetration {:.1e} m, tilt {:.1} {:.1} yaw {:.0}",
                s.time_s,
                s.bundling,
                s.winding_turns,
                s.min_gap_m * 1e3,
                s.max_penetration_m,
                s.pitch_rad.to_degrees(),
                s.roll_rad.to_degrees(),
                s.yaw_rad.to_degrees()
            ),
            Err(e) => println!("{e}"),
        }
    }
    let summary = trial.summary();
    println!(
        "{:?} at most; {:.0} s in {:.1} s; penetration {:.1e} m, largest force {:.1} mN",
        summary.bundling,
        summary.simulated_s,
        start.elapsed().as_secs_f64(),
        summary.max_penetration_m,
        summary.largest_contact_n * 1e3
    );
}
