//! Where the valleys of the published map lie: of |yaw| against w2 = -w1, of |pitch| against w2 = w1.
//!
//! `cargo run --release -p sim --example valleys` prints the tables of `sim/docs/valleys.md`: the floors of both valleys, found
//! by search between the grid's points.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};

/// Result of a trial of 120 s.
struct Point {
    yaw_deg: f64,
    pitch_deg: f64,
    thrust_mn: [f64; 2],
    /// Reaction torques about both shafts on the base.
    reaction_nm: f64,
}

fn run([w1, w2]: [f64; 2]) -> Point {
    let profile = SpeedProfile::constant([w1, w2], 120.0).expect("a profile");
    let mut trial = Trial::new(&Robot::published(), Closure::Full, profile, Options::default()).expect("a robot");
    let steady = trial.finish().expect("a run").steady;
    let [yaw_deg, pitch_deg, _] = steady.attitude.map(|level| level.mean.to_degrees());
    let thrust_mn = [0, 1].map(|k| steady.force[k][2].mean * 1e3);
    let reaction_nm = steady.axial_torque[0].mean + steady.axial_torque[1].mean;
    Point { yaw_deg, pitch_deg, thrust_mn, reaction_nm }
}

/// The speed of motor 2 between `low` and `high` at which `value` changes its sign (secant held within the bracket), rpm;
/// NaN where it does not.
fn zero(low: f64, high: f64, value: impl Fn(f64) -> f64) -> f64 {
    let (mut a, mut b) = ((low, value(low)), (high, value(high)));
    if a.1 == 0.0 {
        return a.0;
    }
    if a.1 * b.1 > 0.0 {
        return f64::NAN;
    }
    while (b.0 - a.0).abs() > 0.05 {
        let secant = (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1);
        let margin = 0.1 * (b.0 - a.0);
        let middle = secant.clamp(a.0 + margin, b.0 - margin);
        let new = (middle, value(middle));
        if new.1 * a.1 > 0.0 { a = new } else { b = new }
    }
    (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1)
}

fn main() {
    let speeds: Vec<f64> = (1..=9).map(|i| 10.0 * f64::from(i)).collect();
    let yaw = |w: &f64| (*w, zero(0.5 * w, 1.5 * w, |w2| run([-w, w2]).yaw_deg), run([-w, *w]));
    println!(
        "| w1 rpm | least abs(yaw) at w2 rpm | off w2 = -w1 by | at (w1, -w1): yaw deg | thrusts mN | reaction torques on the base mN m |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for (w, w2, at) in speeds.par_iter().map(yaw).collect::<Vec<_>>() {
        let Point { yaw_deg, thrust_mn: [f1, f2], reaction_nm, .. } = at;
        println!("| {} | {w2:.2} | {:+.2} | {yaw_deg:.2} | {f1:.2}, {f2:.2} | {:.4} |", -w, w2 - w, reaction_nm * 1e3);
    }
    // Nearly equal speeds beat for longer than the means are taken over: the floor is where the line between the points
    // at w - 10 and w + 10 crosses zero.
    let pitch = |w: &f64| {
        let [a, b] = [w - 10.0, w + 10.0].map(|w2| run([*w, w2]).pitch_deg);
        (*w, w - 10.0 + 20.0 * a / (a - b), run([*w, *w]))
    };
    println!(
        "\n| w1 rpm | least abs(pitch) at w2 rpm | off w2 = w1 by | at (w1, w1): pitch deg |\n| --- | --- | --- | --- |"
    );
    for (w, w2, at) in speeds.par_iter().map(pitch).collect::<Vec<_>>() {
        println!("| {w} | {w2:.2} | {:+.2} | {:.3} |", w2 - w, at.pitch_deg);
    }
}
