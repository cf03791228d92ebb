//! How much the starting phase of the flagella changes: the four printed points, or the points that are named.
//!
//! `cargo run --release -p sim --example phases -- published 8 [W1,W2 ...]` (robot, starting phases): for each point mean,
//! least and largest over its starting phases ([`sim::steady::phase`]) of the steady values of 120 s, closure full.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::steady::phase::{Ratio, starts};
use sim::trial::means::Level;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Summary, Trial};

/// The points of the publication, rpm.
const PRINTED: [[f64; 2]; 4] = [[50.0, 10.0], [0.0, 45.0], [90.0, 90.0], [-90.0, 90.0]];

/// Names of the columns.
const COLUMNS: [&str; 6] = ["yaw", "pitch", "roll", "thrust 1", "thrust 2", "contact"];

/// One run: yaw, pitch, roll in deg, thrusts in mN, share of the time in contact in %.
fn run(robot: &Robot, rpm: [f64; 2], start_deg: [f64; 2]) -> [f64; COLUMNS.len()] {
    let profile = SpeedProfile::constant(rpm, 120.0).expect("a profile").from_angles(start_deg.map(f64::to_radians));
    let mut trial = Trial::new(robot, Closure::Full, profile, Options::default()).expect("parameters");
    let Summary { steady, contact_share, .. } = trial.finish().expect("a run");
    let [yaw, pitch, roll] = steady.attitude.map(|Level { mean, .. }| mean.to_degrees());
    let [thrust1, thrust2] = steady.force.map(|[.., z]| z.mean * 1e3);
    [yaw, pitch, roll, thrust1, thrust2, 100.0 * contact_share]
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let robot = Robot::built_in(arguments.first().map_or("physical", String::as_str)).expect("physical or published");
    let count: usize = arguments.get(1).map_or(8, |count| count.parse().expect("a number of starting phases"));
    let named: Vec<[f64; 2]> = arguments.iter().skip(2).map(|text| point(text)).collect();
    let points = if named.is_empty() { PRINTED.to_vec() } else { named };
    println!("mean (least to largest) over {count} starting phases; deg, mN, % of the time\n");
    println!("| speeds rpm | ratio | {} |\n| --- | --- |{}", COLUMNS.join(" | "), " --- |".repeat(COLUMNS.len()));
    for rpm in points {
        let runs: Vec<_> = starts(rpm, count).into_par_iter().map(|start| run(&robot, rpm, start)).collect();
        let cells = [0, 1, 2, 3, 4, 5].map(|i| {
            let column = || runs.iter().map(|run| run[i]);
            let mean = column().sum::<f64>() / count as f64;
            let (least, largest) = (column().fold(f64::INFINITY, f64::min), column().fold(f64::NEG_INFINITY, f64::max));
            format!("{mean:.2} ({least:.2} to {largest:.2})")
        });
        let ratio = Ratio::of(rpm).map_or("none".to_owned(), |ratio| ratio.to_string());
        println!("| ({}, {}) | {ratio} | {} |", rpm[0], rpm[1], cells.join(" | "));
    }
}

/// Returns the speeds of `50,10`, rpm.
fn point(text: &str) -> [f64; 2] {
    let speed = |text: &str| text.parse().expect("a speed in rpm");
    text.split_once(',').map(|(w1, w2)| [speed(w1), speed(w2)]).expect("two speeds in rpm, such as 50,10")
}
