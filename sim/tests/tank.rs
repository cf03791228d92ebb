//! The robot in a tank, step by step: momentum, rigid solutions, symmetry, and walls that it touches.

use crate::common::{frames_and_gradient, prove, run_steps};
use nalgebra::DVector;
use sim::V3;
use sim::body::{closure::Closure, shaft::MotorState, shaft::Shaft};
use sim::params::{Head, Robot, Tank};
use sim::resistance::resistance;
use sim::step::state::State;
use sim::step::{Solver, StepControl, StepFailure, StepReport};
use sim::trial::profile::{Phases, SpeedProfile};
use sim::trial::{Checkpoint, Options, Trial};
use std::f64::consts::PI;

/// A robot with a head in the publication's tank, 70 mm from its corner at the least x and y.
fn in_a_corner() -> Robot {
    let tank = Tank { joint_m: [0.07, 0.07], ..Tank::published() };
    Robot { head: Head::default(), tank: Some(tank), ..Robot::published() }
}

/// Force of flagellum `k` on its clamp and its moment about the joint, body axes, from the elastic forces at the clamp's own
/// nodes; without the moment about the tangent.
fn clamp_load(solver: &Solver, state: &State, k: usize) -> [V3; 2] {
    let (model, shape) = (solver.model(), &state.rods[k].shape);
    let rod = &model.rods[k];
    let (frames, gradient) = frames_and_gradient(solver, state, k);
    let shaft = Shaft::new(model.feet[k], state.motors[k].angle);
    let weight = shaft.to_shaft(model.down(&state.body)) * model.robot.net_weight();
    let mut load = [V3::zeros(), frames.tangent.at(0) * -gradient[3]];
    for i in 0..2 {
        let elastic = V3::from_column_slice(&gradient[4 * i..4 * i + 3]);
        let force = -elastic + (weight - shape.clamp_density[i]) * rod.nodal_length[i];
        load[0] += force;
        load[1] += shape.nodes[i].cross(&force);
    }
    let force = shaft.to_body(load[0]);
    [force, shaft.to_body(load[1]) + shaft.foot.cross(&force)]
}

#[test]
fn momentum_closes_at_every_step() {
    let mut robot = in_a_corner();
    robot.flagellum.density_kg_m3 = robot.fluid.density_kg_m3;
    robot.joint.tether_full_nm_per_rad = 0.0;
    // So light that a difference of two rates is enough for its inertia.
    robot.base.inertia_kg_m2 = [1e-8; 3];
    robot.solver.tolerance = 2e-3;
    let inertia = V3::from(robot.base.inertia_kg_m2);
    let (mut force_error, mut moment_error, mut base_error) = (0f64, 0f64, 0f64);
    let (mut force_size, mut moment_size, mut touching, mut before) = (0f64, 0f64, 0, (0.0, V3::zeros()));
    let outcome = run_steps(&robot, Closure::Full, [90.0, 60.0], 8.0, |solver, state, report| {
        touching += report.touching;
        let body = &state.body;
        let up = body.attitude.inverse_transform_vector(&V3::z());
        let righting = robot.base.mass_kg * robot.base.gravity_m_s2 * robot.base.mass_centre_below_joint_m;
        let mut on_base = V3::z().cross(&up) * righting;
        on_base += report.head.moment - inertia.component_mul(&((body.rate - before.1) / (state.time - before.0)));
        before = (state.time, body.rate);
        for k in 0..2 {
            let [force, moment] = clamp_load(solver, state, k);
            let (fluid, contact, weight) = (&report.fluid[k], &report.contact[k], &report.weight[k]);
            let forces = fluid.force + contact.force + weight.force;
            let moments = fluid.moment + contact.moment + weight.moment;
            on_base += fluid.moment + contact.moment;
            force_size = force_size.max(forces.norm());
            moment_size = moment_size.max(moments.norm());
            force_error = force_error.max((force - forces).norm());
            moment_error = moment_error.max((moment - moments).norm());
        }
        // The first steps start the robot.
        if state.time > 1.0 {
            base_error = base_error.max(on_base.norm());
        }
    });
    outcome.expect("steps");
    assert!(touching > 0, "the rods touch in this run");
    prove("tank: force on clamps less force on rods, every step, relative", force_error / force_size, 1e-9);
    prove("tank: moment on clamps less moment on rods, every step, relative", moment_error / moment_size, 1e-2);
    prove("tank: moments on the base, every step, relative", base_error / moment_size, 1e-2);
}

#[test]
fn stiff_flagella_have_the_resistance_of_rigid_ones() {
    let mut robot = in_a_corner();
    robot.flagellum.young_pa = 1e9;
    robot.tank.as_mut().expect("a tank").joint_m = [0.3, 0.15];
    robot.flagellum.density_kg_m3 = robot.fluid.density_kg_m3;
    robot.solver.tolerance = 1e-4;
    let mut last = None;
    let keep = |_: &Solver, state: &State, report: &StepReport| last = Some((state.motors, *report));
    run_steps(&robot, Closure::Held, [50.0, -30.0], 0.5, keep).expect("steps");
    let (motors, report) = last.expect("a step");
    let rigid = resistance(&robot, &motors.map(|m| m.angle)).expect("parameters");
    println!("reciprocity error in a tank: {:.1e}", rigid.reciprocity_error);
    let mut motion = DVector::zeros(18);
    for k in 0..2 {
        motion[6 * (k + 1) + 5] = motors[k].speed;
    }
    let load = -(&rigid.matrix * motion);
    let part = |row: usize| load.fixed_rows::<3>(row).into_owned();
    // The matrix is symmetric by force: that is the size of what may differ.
    let matrix = &rigid.matrix;
    let scale = |row: usize| {
        (0..2)
            .map(|k| (matrix[(row, row)] * matrix[(6 * k + 11, 6 * k + 11)]).sqrt() * motors[k].speed.abs())
            .sum::<f64>()
    };
    for (k, fluid) in report.fluid.iter().enumerate() {
        let row = 6 * (k + 1);
        let error = (fluid.force - part(row)).amax() / scale(row);
        prove(&format!("tank, stiff flagellum {}: force against the rigid robot's", k + 1), error, 0.01);
        let torque = part(row + 3).z;
        let error = (fluid.axial_torque / torque - 1.0).abs();
        prove(&format!("tank, stiff flagellum {}: torque against the rigid robot's", k + 1), error, 0.02);
    }
    let error = (report.head.force - part(0)).amax() / scale(0);
    prove("tank, stiff flagella: force on the head against the rigid robot's", error, 0.01);
}

#[test]
fn a_quarter_turn_of_tank_and_robot_changes_nothing() {
    // The corner at the least x and y, and that at the largest x and least y with the robot turned by 90 degrees.
    let ends = [false, true].map(|turned| {
        let mut robot = in_a_corner();
        robot.joint.tether_full_nm_per_rad = 0.0;
        robot.solver.tolerance = 1e-4;
        let tank = robot.tank.as_mut().expect("a tank");
        (tank.length_m, tank.width_m) = if turned { (0.45, 1.22) } else { (1.22, 0.45) };
        tank.joint_m = if turned { [0.38, 0.07] } else { [0.07, 0.07] };
        let mut solver = Solver::new(&robot, Closure::Full).expect("parameters");
        let mut state = solver.at_rest();
        let yaw = if turned { 0.5 * PI } else { 0.0 };
        state.body.attitude = nalgebra::UnitQuaternion::from_axis_angle(&V3::z_axis(), yaw);
        state.body.yaw = yaw;
        let motors = |t: f64| [50.0, -30.0].map(|r| MotorState { angle: r * PI / 30.0 * t, speed: r * PI / 30.0 });
        let mut control = StepControl::default();
        while state.time < 2.0 {
            control.advance(&mut solver, &mut state, 2.0, &motors).expect("a step");
        }
        state.body.attitude
    });
    let turn = nalgebra::UnitQuaternion::from_axis_angle(&V3::z_axis(), 0.5 * PI);
    println!("turned by {:.1} deg", ends[0].angle().to_degrees());
    prove("tank turned with its robot: attitude, rad", (turn * ends[0]).angle_to(&ends[1]), 1e-6);
}

#[test]
fn restored_state_goes_on_bit_for_bit() {
    let phases = Phases { run: 4.0, decay: 1.0, ..Phases::default() };
    let start = || {
        let profile = SpeedProfile::phases(&phases, [90.0, 60.0]).expect("a profile");
        Trial::new(&in_a_corner(), Closure::Full, profile, Options::default()).expect("parameters")
    };
    let (mut straight, mut first, mut second) = (start(), start(), start());
    for _ in 0..80 {
        straight.next();
        first.next();
    }
    let text = serde_json::to_string(&first.checkpoint()).expect("a checkpoint");
    let restored: Checkpoint = serde_json::from_str(&text).expect("the checkpoint");
    second.restore(restored);
    let (a, b): (Vec<_>, Vec<_>) = (straight.by_ref().collect(), second.by_ref().collect());
    assert!(a.len() > 10, "{}", a.len());
    assert_eq!(a, b);
}

#[test]
fn a_robot_that_tilts_to_a_wall_fails_clearly() {
    // With motors against each other the robot tilts by more than ten degrees, and its tips reach a side 55 mm away.
    let mut robot = in_a_corner();
    let tank = robot.tank.as_mut().expect("a tank");
    (tank.length_m, tank.width_m, tank.joint_m) = (0.11, 0.11, [0.055, 0.055]);
    let error = run_steps(&robot, Closure::Full, [-90.0, 90.0], 60.0, |_, _, _| {}).expect_err("a wall");
    assert_eq!(error.failure, StepFailure::TouchesTank);
    assert!(error.time > 1.0, "{error}");
    println!("{error}");
}
