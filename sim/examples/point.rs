//! One operating point: mean loads of the flagella and attitude, with the speed of the simulation.
//!
//! `cargo run --release -p sim --example point -- 90 90 held 60 48 [key=value ...]`

use sim::V3;
use sim::params::Robot;
use sim::robot::{body::euler_zyx, clamp::Motor, closure::Closure};
use sim::step::Solver;
use std::f64::consts::PI;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: f64| arguments.get(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let rpm = [number(0, 90.0), number(1, 90.0)];
    let closure = match arguments.get(2).map(String::as_str) {
        Some("full") => Closure::Full,
        Some("lumped") => Closure::Lumped,
        Some("paper") => Closure::Paper,
        _ => Closure::Held,
    };
    let (end, from) = (number(3, 60.0), number(4, 48.0));
    let mut robot = Robot::default();
    for pair in arguments.iter().skip(5) {
        let Some((key, value)) = pair.split_once('=') else {
            continue;
        };
        let v: f64 = value.parse().expect("number");
        match key {
            "rad" => (robot.solver.step_rad, robot.solver.contact_step_rad) = (v, v.min(robot.solver.contact_step_rad)),
            "contact_rad" => robot.solver.contact_step_rad = v,
            "tol" => robot.solver.tolerance = v,
            "rho" => robot.flagellum.density_kg_m3 = v,
            "eps" => robot.fluid.regularisation_radii = v,
            "edge" => robot.flagellum.edge_length_m = v,
            "tether" => (robot.joint.tether_full_nm_per_rad, robot.joint.tether_lumped_nm_per_rad) = (v, v),
            "contact" => robot.contact.enabled = v > 0.0,
            "friction" => robot.contact.friction = v,
            _ => panic!("{key}?"),
        }
    }
    let trace = std::env::var("TRACE").is_ok();
    let mut solver = Solver::new(&robot, closure).expect("parameters");
    let mut state = solver.at_rest();
    let speed = rpm.map(|r| r * PI / 30.0);
    let motors = |t: f64| speed.map(|w| Motor { angle: w * t, speed: w });
    let start = std::time::Instant::now();
    let (mut force, mut torque, mut weight) = ([V3::zeros(); 2], [0.0; 2], 0.0);
    let (mut steps, mut sweeps, mut worst, mut touching, mut error, mut largest) =
        (0, 0, f64::INFINITY, 0.0, 0f64, 0f64);
    let mut moment_error = 0f64;
    while state.time < end - 1e-9 {
        let before = state.time;
        let report = match solver.advance(&mut state, end, &motors) {
            Ok(report) => report,
            Err(e) => {
                println!("{e}");
                break;
            }
        };
        let step = state.time - before;
        steps += 1;
        sweeps += report.sweeps;
        error = error.max(report.error);
        largest = largest.max(report.largest_force);
        moment_error = moment_error.max(report.moment_error);
        if report.touching > 0 {
            touching += step;
        }
        if trace {
            let e = euler_zyx(&state.body.attitude).map(f64::to_degrees);
            println!(
                "{:.3} step {step:.4} sweeps {} res {:.1e} err {:.1e} touch {} euler {:.2?} F {:.3?} {:.3?}",
                state.time,
                report.sweeps,
                report.residual,
                report.error,
                report.touching,
                e,
                (report.fluid[0].force * 1e3).as_slice(),
                (report.fluid[1].force * 1e3).as_slice()
            );
        }
        if std::env::var("DIST").is_ok() {
            worst = f64::min(worst, solver.least_distance(&state));
        }
        if state.time > from {
            weight += step;
            for k in 0..2 {
                force[k] += (report.fluid[k].force + report.contact[k].force) * step;
                torque[k] += (report.fluid[k].axial_torque + report.contact[k].axial_torque) * step;
            }
        }
    }
    let wall = start.elapsed().as_secs_f64();
    let e = euler_zyx(&state.body.attitude).map(f64::to_degrees);
    println!(
        "({}, {}) {closure:?}: {:.1} s in {wall:.3} s: {:.0} x; {steps} steps, {:.2} sweeps each, {} inverses; contact {:.3}, least distance {:.4} mm, largest pair {:.2} mN; step error {:.1e} m; moment error {:.1e}",
        rpm[0],
        rpm[1],
        state.time,
        state.time / wall,
        sweeps as f64 / steps as f64,
        solver.inverses_built(),
        touching / state.time,
        worst * 1e3,
        largest * 1e3,
        error,
        moment_error
    );
    for k in 0..2 {
        let f = force[k] * (1e3 / weight);
        println!(
            "  {}: force {:.5} {:.5} {:.5} mN, axial torque {:.6} mN m",
            k + 1,
            f.x,
            f.y,
            f.z,
            torque[k] * 1e3 / weight
        );
    }
    println!("  yaw {:.2} (unwrapped {:.2}) pitch {:.3} roll {:.3} deg", e[0], state.body.yaw.to_degrees(), e[1], e[2]);
}
