//! The numbers that the publication prints (Hao, Zalavadia, Jawed, RoboSoft 2024, arXiv 2405.02291) beside those of the model.
//!
//! `cargo run --release -p sim --example published > host/book/src/published-tables.md`: the four operating points, and
//! where the published map has its valleys. Both helices start at the same angle; 120 s a point.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::{Robot, Tank};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};

/// Speeds in rpm; the printed |yaw| and |pitch| in degrees, of the published simulation and of the experiment.
struct Printed {
    rpm: [f64; 2],
    simulated: [&'static str; 2],
    measured: [&'static str; 2],
}

const POINTS: [Printed; 4] = [
    Printed { rpm: [50.0, 10.0], simulated: ["60.76", "3.29"], measured: ["67.95", "4.96"] },
    Printed { rpm: [0.0, 45.0], simulated: ["56.22", "3.45"], measured: ["", ""] },
    Printed { rpm: [90.0, 90.0], simulated: ["180", "near 0"], measured: ["", ""] },
    Printed { rpm: [-90.0, 90.0], simulated: ["near a minimum", "16"], measured: ["", ""] },
];

/// The grid of the published map in w2, rpm.
const GRID: [f64; 10] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0];

/// Steady |yaw|, |pitch|, |roll| and tilt of the axis, degrees.
fn angles(robot: &Robot, closure: Closure, rpm: [f64; 2]) -> [f64; 4] {
    let profile = SpeedProfile::constant(rpm, 120.0).expect("a profile");
    let mut trial = Trial::new(robot, closure, profile, Options::default()).expect("parameters");
    let [yaw, pitch, roll] = trial.finish().expect("a run").steady.attitude.map(|level| level.mean);
    [yaw.abs(), pitch.abs(), roll.abs(), (pitch.cos() * roll.cos()).acos()].map(f64::to_degrees)
}

fn main() {
    points();
    println!();
    valleys();
    println!();
    reynolds();
}

fn points() {
    let in_tank = Robot { tank: Some(Tank::published()), ..Robot::default() };
    let models = [
        ("`published`, closure `lumped`", Robot::published(), Closure::Lumped),
        ("`published`, closure `full`", Robot::published(), Closure::Full),
        ("`physical`, closure `full`", Robot::default(), Closure::Full),
        ("`physical` in the tank", in_tank, Closure::Full),
    ];
    println!("| speeds rpm | | abs(yaw) deg | abs(pitch) deg | abs(roll) deg | tilt deg |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for Printed { rpm, simulated, measured } in &POINTS {
        let speeds = format!("({}, {})", rpm[0], rpm[1]);
        println!("| {speeds} | publication, simulation | {} | {} | | |", simulated[0], simulated[1]);
        if !measured[0].is_empty() {
            println!("| {speeds} | publication, experiment | {} | {} | | |", measured[0], measured[1]);
        }
        let rows: Vec<_> = models
            .par_iter()
            .map(|(name, robot, closure)| {
                let [yaw, pitch, roll, tilt] = angles(robot, *closure, *rpm);
                format!("| {speeds} | {name} | {yaw:.2} | {pitch:.2} | {roll:.2} | {tilt:.2} |")
            })
            .collect();
        println!("{}", rows.join("\n"));
    }
}

/// Where |yaw| and |pitch| are least on the grid of the map, for each w1.
fn valleys() {
    println!(
        "| w1 rpm | publication: least abs(yaw) at w2 | `published`: at w2 | publication: least abs(pitch) at w2 | `published`: at w2 |"
    );
    println!("| --- | --- | --- | --- | --- |");
    let robot = Robot::published();
    for w1 in (1..=9).map(|i| 10.0 * f64::from(i)) {
        let least = |w1: f64, angle: usize| {
            let values: Vec<f64> = GRID.par_iter().map(|&w2| angles(&robot, Closure::Full, [w1, w2])[angle]).collect();
            // At standstill nothing leans the robot; a valley lies between two slopes.
            let index = (1..GRID.len()).min_by(|&a, &b| values[a].total_cmp(&values[b])).expect("a grid");
            GRID[index]
        };
        println!("| -{w1} and {w1} | {w1} | {} | {w1} | {} |", least(-w1, 0), least(w1, 1));
    }
}

/// The Reynolds number of a flagellum at the greatest speed.
fn reynolds() {
    let robot = Robot::published();
    let (fluid, flagellum) = (&robot.fluid, &robot.flagellum);
    let omega = 90.0 * std::f64::consts::TAU / 60.0;
    let number = fluid.density_kg_m3 * omega * flagellum.helix_radius_m * flagellum.rod_radius_m / fluid.viscosity_pa_s;
    println!("| | publication | here |");
    println!("| --- | --- | --- |");
    println!(
        "| Reynolds number, density times speed times helix radius times rod radius over viscosity | below 0.1 | {number:.2} at 90 rpm |"
    );
}
