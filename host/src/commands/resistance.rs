//! `biflag resistance`: prints the resistance matrix of the rigid robot.

use super::answer::{Answer, Outcome, wrong_use};
use super::options::pair;
use crate::plan::robot;
use serde_json::json;
use sim::params::Robot;
use sim::resistance::{Resistance, parts, resistance};
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::PathBuf;

/// Print the resistance matrix of the robot's parts, as rigid bodies in the fluid.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag resistance --phase 0,90\n  \
    biflag resistance --robot published --json\n\
    The parts are the base and the two flagella; head and tank are included. `matrix` has six rows and six columns\n\
    per part: the force and then the moment that the part exerts on the fluid, and its velocity and then its angular\n\
    velocity, in SI units and body axes. The base moves about the joint, a flagellum about the foot of its shaft.")]
pub struct Args {
    /// The robot file, `physical` or `published`.
    #[arg(long, value_name = "FILE|NAME", default_value = robot::PHYSICAL)]
    robot: PathBuf,
    /// Angles of motors 1 and 2 in degrees; write `--phase=-90,0` if the first is negative.
    #[arg(long, value_name = "DEG,DEG", value_parser = phase, allow_hyphen_values = true, default_value = "0,0")]
    phase: [f64; 2],
}

fn phase(text: &str) -> Result<[f64; 2], String> {
    let one = |text: &str| match text.parse::<f64>() {
        Ok(degrees) if degrees.is_finite() => Ok(degrees),
        _ => Err(format!("{text:?} is not an angle")),
    };
    pair(text, "give two angles in degrees, such as 0,90", one)
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let file = robot::load(&args.robot)?;
    let robot = file.parse()?;
    let phase_deg = args.phase;
    let found = resistance(&robot, &phase_deg.map(f64::to_radians))
        .map_err(|error| wrong_use(format!("{}: {error}", file.name), "correct the robot file"))?;
    let matrix: Vec<Vec<f64>> = found.matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
    let parts = parts(phase_deg.len());
    let text = describe(&file.name, &robot, phase_deg, &parts, &found);
    let body = json!({
        "robot": file.name,
        "phase_deg": phase_deg,
        "parts": parts,
        "matrix": matrix,
        "reciprocity_error": found.reciprocity_error,
    });
    Answer::new(Outcome::Done, &body, text)
}

fn describe(name: &str, robot: &Robot, phase_deg: [f64; 2], parts: &[String], found: &Resistance) -> String {
    let matrix = &found.matrix;
    let rate = PI / 30.0;
    let [first, second] = phase_deg;
    let tank = if robot.tank.is_some() { ", in its tank" } else { "" };
    let mut text = format!("robot {name} at phases {first}, {second} deg{tank}\n\n");
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{:<12} {:>10} {:>13} {:>15} {:>14}",
        "turned alone", "thrust mN", "torque mN m", "on the base mN", "drag N s/m"
    );
    for (k, part) in parts.iter().enumerate().skip(1) {
        // Forces of the fluid on the part are opposite to those that the part exerts. A flagellum turns about its shaft.
        let (z, turn) = (6 * k + 2, 6 * k + 5);
        let [thrust, torque, on_base] = [z, turn, 2].map(|row| -(matrix[(row, turn)] * rate * 1e3));
        let drag = matrix[(z, z)];
        let _ = writeln!(text, "{part:<12} {thrust:>10.5} {torque:>13.6} {on_base:>15.5} {drag:>14.5}");
    }
    let [x, y, z] = [3, 4, 5].map(|row| matrix[(row, row)]);
    let _ = writeln!(text, "\nbase about the joint: {x:.3e}, {y:.3e}, {z:.3e} N m s about x, y, z");
    text += "thrust, torque and the force on the base along z at 1 rpm about +z, the other parts held; drag along z\n";
    text += &format!("reciprocity error {:.1e}, before the matrix was made symmetric", found.reciprocity_error);
    text
}
