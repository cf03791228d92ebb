//! The head and the flagella in one flow, step by step: against dense solutions, and by momentum.

use crate::common::{frames_and_gradient, prove, run_steps};
use nalgebra::{DVector, UnitQuaternion};
use sim::V3;
use sim::body::{closure::Closure, shaft::Shaft};
use sim::fluid::{head::RigidSurface, segment::segment_flow, stokeslet_factor};
use sim::params::Robot;
use sim::resistance::resistance;
use sim::step::Solver;
use sim::step::state::State;

/// Nodes and force densities on the fluid of a flagellum without contact in the body frame, from its elastic forces.
fn line(solver: &Solver, state: &State, k: usize) -> (Vec<V3>, Vec<V3>) {
    let (model, shape) = (solver.model(), &state.rods[k].shape);
    let rod = &model.rods[k];
    let (_, gradient) = frames_and_gradient(solver, state, k);
    let shaft = Shaft::new(model.feet[k], state.motors[k].angle);
    let weight = model.down(&state.body) * model.robot.net_weight();
    let nodes = shape.nodes.iter().map(|x| shaft.point_to_body(*x)).collect();
    let density = (0..rod.nodes())
        .map(|i| match shape.clamp_density.get(i) {
            Some(density) => shaft.to_body(*density),
            None => shaft.to_body(-V3::from_column_slice(&gradient[4 * i..4 * i + 3])) / rod.nodal_length[i] + weight,
        })
        .collect();
    (nodes, density)
}

/// Force and moment of the fluid on the head, solved densely with every segment of the flagella.
fn dense_load(solver: &Solver, state: &State) -> [V3; 2] {
    let robot = &solver.model().robot;
    let head = RigidSurface::of_head(robot).expect("parameters").expect("a head");
    let factor = stokeslet_factor(robot.fluid.viscosity());
    let rate = if solver.model().two_way() { state.body.rate } else { V3::zeros() };
    let lines = [0, 1].map(|k| line(solver, state, k));
    let slip = DVector::from_iterator(
        3 * head.points.len(),
        head.points.iter().flat_map(|x| {
            let mut slip = rate.cross(x);
            for (nodes, density) in &lines {
                for e in 0..nodes.len() - 1 {
                    let [a, b] = segment_flow(*x, nodes[e], nodes[e + 1], robot.epsilon());
                    slip -= (a * density[e] + b * density[e + 1]) * factor;
                }
            }
            [slip.x, slip.y, slip.z]
        }),
    );
    let forces = head.mobility.clone().lu().solve(&slip).expect("regular");
    let mut load = [V3::zeros(); 2];
    for (i, x) in head.points.iter().enumerate() {
        let force = -forces.fixed_rows::<3>(3 * i).into_owned();
        load[0] += force;
        load[1] += x.cross(&force);
    }
    load
}

#[test]
fn the_load_on_the_head_is_that_of_the_dense_solution() {
    for (closure, rpm) in [(Closure::Full, [50.0, -30.0]), (Closure::Held, [90.0, 90.0])] {
        let (mut force_error, mut moment_error, mut force, mut moment) = (0f64, 0f64, 0f64, 0f64);
        let mut robot = Robot::default();
        robot.solver.tolerance = 1e-4;
        run_steps(&robot, closure, rpm, 3.0, |solver, state, report| {
            let [f, m] = dense_load(solver, state);
            (force, moment) = (force.max(f.norm()), moment.max(m.norm()));
            if state.time < 0.5 {
                // The motors have started with a jerk.
                return;
            }
            force_error = force_error.max((report.head.force - f).norm());
            moment_error = moment_error.max((report.head.moment - m).norm());
        })
        .expect("steps");
        println!("largest force {:.3} mN, moment {:.4} mN m", force * 1e3, moment * 1e3);
        prove(
            &format!("{closure:?}: force on the head at every step against dense, relative"),
            force_error / force,
            0.02,
        );
        prove(
            &format!("{closure:?}: moment on the head at every step against dense, relative"),
            moment_error / moment,
            0.02,
        );
    }
}

#[test]
fn moments_on_the_base_balance() {
    let robot = Robot::default();
    let inertia = V3::from(robot.base.inertia_kg_m2);
    let (mut worst, mut largest, mut head, mut before) = (0f64, 0f64, 0f64, (0.0, V3::zeros()));
    run_steps(&robot, Closure::Full, [50.0, -30.0], 6.0, |_, state, report| {
        let body = &state.body;
        let up = body.attitude.inverse_transform_vector(&V3::z());
        let righting = robot.base.mass_kg * robot.base.gravity_m_s2 * robot.base.mass_centre_below_joint_m;
        let mut moment = V3::z().cross(&up) * righting;
        // The gradient of the twist of the tether; at yaws this small the twist needs no turns.
        let q = body.attitude;
        let twist = 2.0 * q.k.atan2(q.w);
        moment -= (up + V3::z()) / (1.0 + up.z) * (robot.joint.tether_full_nm_per_rad * twist);
        moment += report.fluid[0].moment + report.fluid[1].moment + report.head.moment;
        moment -= inertia.component_mul(&((body.rate - before.1) / (state.time - before.0)));
        before = (state.time, body.rate);
        // The first steps start the robot.
        if state.time > 1.0 {
            worst = worst.max(moment.norm());
            largest = largest.max(report.fluid[0].moment.norm());
            head = head.max(report.head.moment.norm());
        }
    })
    .expect("steps");
    assert!(head > 1e-3 * largest, "the head takes part");
    prove("head in the flow: sum of the moments on the base, over that of a flagellum", worst / largest, 1e-2);
}

#[test]
fn stiff_flagella_have_the_resistance_of_rigid_ones() {
    let mut robot = Robot::default();
    robot.flagellum.young_pa = 3e10;
    robot.flagellum.density_kg_m3 = robot.fluid.density_kg_m3;
    robot.fluid.spin_drag = 0.0;
    robot.solver.tolerance = 1e-4;
    let rpm = [50.0, -30.0];
    let mut last = None;
    run_steps(&robot, Closure::Held, rpm, 0.5, |_, state, report| last = Some((state.motors, *report))).expect("steps");
    let (motors, report) = last.expect("a step");
    let rigid = resistance(&robot, &motors.map(|m| m.angle)).expect("parameters");
    let mut motion = DVector::zeros(18);
    for k in 0..2 {
        motion[6 * (k + 1) + 5] = motors[k].speed;
    }
    let load = -(&rigid.collocated * motion);
    let part = |row: usize| load.fixed_rows::<3>(row).into_owned();
    let size = part(6).norm();
    for (k, fluid) in report.fluid.iter().enumerate() {
        let error = (fluid.force - part(6 * (k + 1))).norm() / size;
        prove(&format!("stiff flagellum {}: force against the rigid robot's", k + 1), error, 0.02);
        let torque = part(6 * (k + 1) + 3).z;
        prove(
            &format!("stiff flagellum {}: torque against the rigid robot's", k + 1),
            (fluid.axial_torque / torque - 1.0).abs(),
            0.02,
        );
    }
    prove(
        "stiff flagella: force on the head against the rigid robot's",
        (report.head.force - part(0)).norm() / part(0).norm(),
        0.02,
    );
    prove(
        "stiff flagella: moment on the head against the rigid robot's",
        (report.head.moment - part(3)).norm() / part(3).norm(),
        0.02,
    );
}

#[test]
fn a_mirrored_robot_with_a_head_mirrors_its_attitude() {
    use sim::rod::helix::Handedness;
    let end = |handedness, rpm| {
        let mut robot = Robot::default();
        robot.flagellum.handedness = [handedness; 2];
        let mut attitude = UnitQuaternion::identity();
        run_steps(&robot, Closure::Full, rpm, 3.0, |_, state, _| attitude = state.body.attitude).expect("steps");
        attitude
    };
    let right = end(Handedness::Right, [50.0, 10.0]);
    let left = end(Handedness::Left, [-50.0, -10.0]);
    let mirrored = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(left.w, -left.i, left.j, -left.k));
    println!("turned by {:.1} deg", right.angle().to_degrees());
    prove("mirror with a head: attitude, rad", mirrored.angle_to(&right), 1e-6);
}
