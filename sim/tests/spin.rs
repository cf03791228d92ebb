//! The couple of the fluid on the spin of a rod.

use crate::common::prove;
use sim::body::{closure::Closure, shaft::MotorState};
use sim::params::Robot;
use sim::step::{Solver, StepControl};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};
use std::f64::consts::PI;

/// Axial torque of flagellum 1 on a held base after 2 s at 30 rpm, N m, and the share of the arc that points along the
/// shaft, squared, summed over its length, m.
fn torque(spin_drag: f64) -> (f64, f64) {
    let mut robot = Robot::default();
    // So stiff that it is rigid.
    robot.flagellum.young_pa = 1e10;
    robot.fluid.spin_drag = spin_drag;
    robot.solver.tolerance = 1e-5;
    let mut solver = Solver::new(&robot, Closure::Held).expect("parameters");
    let mut state = solver.at_rest();
    let (mut control, mut last) = (StepControl::default(), 0.0);
    while state.time < 2.0 {
        let motors = |t: f64| [MotorState { angle: PI * t, speed: PI }, MotorState::default()];
        last = control.advance(&mut solver, &mut state, 2.0, &motors).expect("a step").fluid[0].axial_torque;
    }
    let along = state.rods[0].shape.nodes.windows(2).map(|p| (p[1] - p[0]).z.powi(2) / (p[1] - p[0]).norm()).sum();
    (last, along)
}

#[test]
fn a_stiff_flagellum_feels_the_couple_of_a_round_rod() {
    let ((without, along), (with, _)) = (torque(0.0), torque(1.0));
    let robot = Robot::default();
    let couple = 4.0 * PI * robot.fluid.viscosity() * robot.flagellum.rod_radius_m.powi(2) * along * PI;
    println!("torque {:.4} and {:.4} mN m, couple {:.4} mN m", without * 1e3, with * 1e3, couple * 1e3);
    prove(
        "spin: torque with less without it, over the couple of a round rod",
        ((without - with) / couple - 1.0).abs(),
        1e-3,
    );
}

#[test]
fn free_motion_of_the_physical_robot_takes_little_more_than_two_sweeps_a_step() {
    // About the shapes at rest it takes 3.5 at (90, 90).
    for rpm in [[90.0, 90.0], [-90.0, 90.0]] {
        let profile = SpeedProfile::constant(rpm, 60.0).expect("a profile");
        let mut trial = Trial::new(&Robot::default(), Closure::Full, profile, Options::default()).expect("parameters");
        let summary = trial.finish().expect("a run");
        let sweeps = summary.sweeps as f64 / summary.steps as f64;
        prove(&format!("sweeps a step at ({}, {})", rpm[0], rpm[1]), sweeps, 2.5);
    }
}
