//! The map of a robot: its steady attitude, thrusts and contact over the speeds of both motors, as CSV.
//!
//! `cargo run --release -p sim --example steady_map -- 10 2 physical > host/study/src/aim/map.csv`: step of the speeds in rpm, number of
//! starting phases where the ratio of the speeds makes the phase matter, robot. All speeds from -90 to 90 rpm with w1 not
//! below w2: a robot of two equal flagella has the same yaw and the opposite pitch and roll with its motors exchanged.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::steady::phase::{self, Ratio};
use sim::steady::{self, Problem};
use sim::trial::Summary;
use std::error::Error;

/// Largest speed, rpm.
const LARGEST_RPM: i32 = 90;
/// Duration of the trial where the motion is not found to repeat, s.
const TRIAL_S: f64 = 120.0;

/// Returns yaw, pitch, roll (deg), both thrusts (N), and the share of the time with contact, means over the starting phases,
/// and the least gap (m).
fn row(robot: &Robot, rpm: [f64; 2], phases: usize) -> Result<[f64; 7], steady::SolveError> {
    let starts = if Ratio::of(rpm).is_some() { phase::starts(rpm, phases) } else { vec![[0.0; 2]] };
    let mut found: Vec<Summary> = Vec::new();
    for start in starts {
        let start_rad = start.map(f64::to_radians);
        let problem =
            Problem { robot, closure: Closure::Full, rpm, start_rad, longest_s: TRIAL_S, output: None, at_rest: None };
        found.push(steady::solve(&problem, &|_| true)?.summary);
    }
    let mean = |value: &dyn Fn(&Summary) -> f64| found.iter().map(value).sum::<f64>() / found.len() as f64;
    let angle = |k: usize| mean(&|s| s.steady.attitude[k].mean.to_degrees());
    let thrust = |k: usize| mean(&|s| s.steady.force[k][2].mean);
    let gap = found.iter().map(|s| s.min_gap_m).fold(f64::INFINITY, f64::min);
    Ok([angle(0), angle(1), angle(2), thrust(0), thrust(1), mean(&|s| s.contact_share), gap])
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let step: i32 = arguments.first().map_or(Ok(5), |text| text.parse())?;
    let phases: usize = arguments.get(1).map_or(Ok(4), |text| text.parse())?;
    let name = arguments.get(2).map_or("physical", String::as_str);
    let robot = Robot::built_in(name).ok_or_else(|| format!("{name}: no such robot"))?;
    if step < 1 || phases < 1 {
        return Err("the step and the number of phases are at least 1".into());
    }
    let axis = || (-LARGEST_RPM..=LARGEST_RPM).step_by(step as usize);
    let speeds: Vec<[i32; 2]> = axis().flat_map(|w1| axis().map(move |w2| [w1, w2])).filter(|[a, b]| a >= b).collect();

    let one = |[w1, w2]: &[i32; 2]| match row(&robot, [*w1, *w2].map(f64::from), phases) {
        Ok(row) => Some((*w1, *w2, row)),
        Err(error) => {
            eprintln!("{w1}, {w2}: {error}");
            None
        }
    };
    let rows: Vec<_> = speeds.par_iter().with_max_len(1).filter_map(one).collect();
    let version = env!("CARGO_PKG_VERSION");
    println!(
        "# steady states of the robot {name} by sim {version}, closure full, the mean of {phases} starting phases where"
    );
    println!("# the ratio of the speeds makes the phase matter; without w1 < w2, which is the mirror image");
    println!("# cargo run --release -p sim --example steady_map -- {step} {phases} {name}");
    println!("w1_rpm,w2_rpm,yaw_deg,pitch_deg,roll_deg,force1_z_n,force2_z_n,contact_share,min_gap_m");
    for (w1, w2, [yaw, pitch, roll, force1, force2, contact, gap]) in rows {
        println!("{w1},{w2},{yaw:.3},{pitch:.3},{roll:.3},{force1:.6},{force2:.6},{contact:.4},{gap:.6}");
    }
    Ok(())
}
