//! The whole robot: balance of forces, symmetry, restored states, convergence.

#![allow(clippy::needless_range_loop)]

use crate::common::{frames_and_gradient, noise, prove};
use nalgebra::UnitQuaternion;
use sim::V3;
use sim::body::{closure::Closure, shaft::MotorState, shaft::Shaft};
use sim::contact::distance::segment_distance;
use sim::fluid::mobility::mobility;
use sim::params::{BUILT_IN, Precision, Robot};
use sim::rod::{Rod, helix::Handedness};
use sim::step::state::State;
use sim::step::{Solver, StepControl, StepReport};
use sim::trial::profile::{Phases, SpeedProfile};
use sim::trial::{Checkpoint, Options, Trial};
use std::f64::consts::PI;

fn motors(rpm: [f64; 2]) -> impl Fn(f64) -> [MotorState; 2] {
    move |t| rpm.map(|r| MotorState { angle: r * PI / 30.0 * t, speed: r * PI / 30.0 })
}

/// Runs to `end`, calling `each` after every step.
fn run(
    solver: &mut Solver,
    state: &mut State,
    rpm: [f64; 2],
    end: f64,
    mut each: impl FnMut(&Solver, &State, f64, &StepReport),
) {
    let motors = motors(rpm);
    let mut control = StepControl::default();
    while state.time < end {
        let before = state.time;
        let report = control.advance(solver, state, end, &motors).expect("a step");
        each(solver, state, state.time - before, &report);
    }
}

#[test]
fn stays_at_rest() {
    for closure in [Closure::Held, Closure::Full] {
        let mut robot = Robot::published();
        robot.flagellum.density_kg_m3 = robot.fluid.density_kg_m3;
        let mut solver = Solver::new(&robot, closure).expect("parameters");
        let mut state = solver.at_rest();
        let mut moved = 0f64;
        run(&mut solver, &mut state, [0.0; 2], 10.0, |solver, state, _, _| {
            for k in 0..2 {
                for (x, rest) in state.rods[k].shape.nodes.iter().zip(&solver.model().rods[k].shape) {
                    moved = moved.max((x - rest).norm());
                }
            }
        });
        prove(&format!("{closure:?}: motion from rest in 10 s, m"), moved, 1e-12);
    }
}

/// Without a tether no direction is special: a robot that is turned about the vertical in the middle of its run goes on as it
/// would have, in another direction.
#[test]
fn a_turned_robot_goes_on_in_its_new_direction() {
    const TURN: f64 = 200.0 * PI / 180.0;
    let mut robot = Robot::published();
    robot.joint.tether_full_nm_per_rad = 0.0;
    let go_on = |turn: f64| {
        let mut solver = Solver::new(&robot, Closure::Full).expect("parameters");
        let mut state = solver.at_rest();
        run(&mut solver, &mut state, [70.0, -40.0], 1.0, |_, _, _, _| {});
        let before = state.clone();
        state.turn(V3::z() * turn);
        assert_eq!((&state.rods, &state.motors, state.body.rate), (&before.rods, &before.motors, before.body.rate));
        run(&mut solver, &mut state, [70.0, -40.0], 2.0, |_, _, _, _| {});
        state.body
    };
    let (straight, turned) = (go_on(0.0), go_on(TURN));
    prove("yaw of a turned robot, rad", (turned.yaw - straight.yaw - TURN).abs(), 1e-7);
    let back = UnitQuaternion::from_scaled_axis(V3::z() * -TURN) * turned.attitude;
    prove("attitude of a turned robot, rad", back.angle_to(&straight.attitude), 1e-7);
    prove("rate of a turned robot, rad/s", (turned.rate - straight.rate).norm(), 1e-6);
}

#[test]
fn forces_on_rods_balance_forces_on_clamps() {
    // The load of a clamp, from the elastic forces at its own nodes, against the sum of all loads of the rod: fluid and
    // contact. The rod has no net weight here.
    for name in BUILT_IN {
        for friction in [0.0, 0.3] {
            let mut robot = Robot::built_in(name).expect(name);
            robot.flagellum.density_kg_m3 = robot.fluid.density_kg_m3;
            robot.contact.friction = friction;
            balance(&format!("momentum, {name}, friction {friction}"), &robot);
        }
    }
}

/// Proves the balance of a robot at (90, 60) rpm at every step.
fn balance(name: &str, robot: &Robot) {
    let mut solver = Solver::new(robot, Closure::Full).expect("parameters");
    let mut state = solver.at_rest();
    let (mut force_error, mut moment_error, mut pair_error, mut touching) = (0f64, 0f64, [0f64; 2], 0);
    run(&mut solver, &mut state, [90.0, 60.0], 8.0, |solver, state, _, report| {
        touching += report.touching;
        let [a, b] = report.contact;
        pair_error = [pair_error[0].max((a.force + b.force).norm()), pair_error[1].max((a.moment + b.moment).norm())];
        for k in 0..2 {
            let rod = &solver.model().rods[k];
            let shape = &state.rods[k].shape;
            let (frames, gradient) = frames_and_gradient(solver, state, k);
            let shaft = Shaft::new(robot.shaft_feet()[k], state.motors[k].angle);
            let tangent = frames.tangent.at(0);
            // The clamped edge also takes the couple of the fluid on its own spin.
            let rotation = shaft.to_shaft(state.body.rate) + V3::z() * state.motors[k].speed;
            let spin = robot.spin_drag().torque(rod.rest_length[0], 0.0, rotation.dot(&tangent));
            let (mut force, mut moment) = (V3::zeros(), tangent * (spin - gradient[3]));
            for i in 0..2 {
                let elastic = V3::new(gradient[4 * i], gradient[4 * i + 1], gradient[4 * i + 2]);
                let f = -elastic - shape.clamp_density[i] * rod.nodal_length[i];
                force += f;
                moment += shape.nodes[i].cross(&f);
            }
            let on_clamp = shaft.to_body(force);
            let about_joint = shaft.to_body(moment) + shaft.foot.cross(&on_clamp);
            let (fluid, contact) = (&report.fluid[k], &report.contact[k]);
            force_error = force_error.max((on_clamp - fluid.force - contact.force).norm());
            moment_error = moment_error.max((about_joint - fluid.moment - contact.moment).norm());
        }
    });
    assert!(touching > 0, "the rods touch in this run");
    prove(&format!("{name}: force on clamps less force on rods, every step, over 5 mN"), force_error / 5e-3, 1e-9);
    prove(
        &format!("{name}: moment on clamps less moment on rods, every step, over 0.6 mN m"),
        moment_error / 6e-4,
        1e-2,
    );
    // Held normals deviate a little from the line between the closest points.
    prove(&format!("{name}: force of contact on both rods, every step, over 5 mN"), pair_error[0] / 5e-3, 1e-9);
    prove(&format!("{name}: moment of contact on both rods, every step, over 0.6 mN m"), pair_error[1] / 6e-4, 1e-2);
}

#[test]
fn body_balance_closes_at_every_step() {
    let robot = Robot::published();
    let mut solver = Solver::new(&robot, Closure::Full).expect("parameters");
    let mut state = solver.at_rest();
    let mut worst = 0f64;
    run(&mut solver, &mut state, [50.0, 10.0], 10.0, |_, _, _, report| worst = worst.max(report.moment_error));
    prove("momentum: moments on the base less its angular momentum's rate, over 0.4 mN m", worst / 4e-4, 2e-2);
}

#[test]
fn turning_everything_changes_nothing() {
    let mut robot = Robot::published();
    robot.joint.tether_full_nm_per_rad = 0.0;
    // Otherwise the error is the rounding in single precision times the iteration's tolerance.
    robot.solver.far_field = Precision::Double;
    robot.solver.tolerance = 1e-7;
    let ends = [0.0, 1.2345].map(|yaw| {
        let mut solver = Solver::new(&robot, Closure::Full).expect("parameters");
        let mut state = solver.at_rest();
        state.body.attitude = UnitQuaternion::from_axis_angle(&V3::z_axis(), yaw);
        state.body.yaw = yaw;
        run(&mut solver, &mut state, [50.0, -30.0], 3.0, |_, _, _, _| {});
        (state.body, solver.lines(&state))
    });
    let [(a, x), (b, y)] = &ends;
    let turn = UnitQuaternion::from_axis_angle(&V3::z_axis(), 1.2345);
    prove("turned world: attitude, rad", (turn * a.attitude).angle_to(&b.attitude), 1e-9);
    let shape = (0..2).flat_map(|k| x[k].iter().zip(&y[k]).map(|(p, q)| (p - q).norm())).fold(0.0, f64::max);
    prove("turned world: shapes, m", shape, 1e-9);

    let nodes = Robot::published().flagellum.helix(0).nodes(49);
    let q = UnitQuaternion::from_euler_angles(0.7, -1.1, 2.0);
    let moved: Vec<V3> = nodes.iter().map(|p| q * p + V3::new(3.0, -2.0, 1.0)).collect();
    let (here, there) = (mobility(&[&nodes], 3e-3, 1.0), mobility(&[&moved], 3e-3, 1.0));
    let rotation = q.to_rotation_matrix();
    let mut worst = 0f64;
    for i in 0..50 {
        for j in 0..50 {
            let block = |m: &nalgebra::DMatrix<f64>| m.fixed_view::<3, 3>(3 * i, 3 * j).into_owned();
            worst = worst.max((rotation * block(&here) * rotation.transpose() - block(&there)).amax());
        }
    }
    prove("turned and shifted fluid: mobility, relative", worst / here.amax(), 1e-9);
}

#[test]
fn mirrored_robot_mirrors_its_attitude() {
    let end = |handedness, rpm| {
        let mut robot = Robot::published();
        robot.flagellum.handedness = [handedness; 2];
        let mut solver = Solver::new(&robot, Closure::Full).expect("parameters");
        let mut state = solver.at_rest();
        run(&mut solver, &mut state, rpm, 5.0, |_, _, _, _| {});
        state.body.attitude
    };
    let right = end(Handedness::Right, [50.0, 10.0]);
    let left = end(Handedness::Left, [-50.0, -10.0]);
    // Mirrored in the plane of x_B and z: components of the turn about x and z change sign.
    let mirrored = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(left.w, -left.i, left.j, -left.k));
    println!("turned by {:.1} deg", right.angle().to_degrees());
    prove("mirror: attitude, rad", mirrored.angle_to(&right), 1e-6);
}

/// Runs a trial of two phases, restores it from a checkpoint after some samples, and holds both rests against each other.
/// Returns the trial and the restored state.
fn restore_after(robot: &Robot, phases: &Phases, rpm: [f64; 2], samples: usize) -> (Trial, State) {
    let profile = || SpeedProfile::phases(phases, rpm).expect("a profile");
    let start = || Trial::new(robot, Closure::Full, profile(), Options::default()).expect("parameters");
    let mut straight = start();
    let mut first = start();
    for _ in 0..samples {
        straight.next();
        first.next();
    }
    let text = serde_json::to_string(&first.checkpoint()).expect("a checkpoint");
    let restored: Checkpoint = serde_json::from_str(&text).expect("the checkpoint");
    let mut second = start();
    second.restore(restored);
    let state = second.state().clone();
    let (a, b): (Vec<_>, Vec<_>) = (straight.by_ref().collect(), second.by_ref().collect());
    assert!(a.len() > 30);
    assert_eq!(a, b);
    assert_eq!(straight.checkpoint(), second.checkpoint());
    (straight, state)
}

#[test]
fn restored_state_goes_on_bit_for_bit() {
    let phases = Phases { run: 8.0, decay: 1.0, ..Phases::default() };
    let (trial, _) = restore_after(&Robot::published(), &phases, [90.0, 60.0], 140);
    assert!(trial.summary().first_contact_s.is_some(), "the run has contact in it");
}

/// The published robot with flagella that buckle.
fn soft() -> Robot {
    let mut robot = Robot::published();
    robot.flagellum.young_pa = 1e5;
    robot
}

#[test]
fn restored_inverses_of_a_deformed_rod_are_the_same() {
    let phases = Phases { preroll: 0.0, calibrate: 0.0, run: 4.0, decay: 0.0, ..Phases::default() };
    let (trial, state) = restore_after(&soft(), &phases, [-90.0, -90.0], 48);
    let rest = trial.solver().at_rest().linearisation;
    assert_ne!(state.linearisation, rest, "the inverses belong to a deformed shape");
    assert_ne!(state.linearisation, trial.state().linearisation, "they are built anew after the restart");
}

#[test]
fn inverses_follow_flagella_that_buckle() {
    let profile = SpeedProfile::constant([-90.0; 2], 5.0).expect("a profile");
    let mut trial = Trial::new(&soft(), Closure::Full, profile, Options::default()).expect("parameters");
    let summary = trial.finish().expect("a run");
    let sweeps = summary.sweeps as f64 / summary.steps as f64;
    println!("{sweeps:.2} sweeps a step, {} inverses", trial.solver().inverses_used());
    // With the inverses of the shape at rest they are 10.
    prove("soft flagella: sweeps a step", sweeps, 6.5);
}

/// Thrust and axial torque of flagellum 1 and thrust of flagellum 2 at (50, 10): means over 6 to 12 s, N and N m.
fn means(change: impl Fn(&mut Robot), edges: Option<usize>) -> [f64; 3] {
    let mut robot = Robot::published();
    change(&mut robot);
    let mut solver = match edges {
        None => Solver::new(&robot, Closure::Held),
        Some(edges) => {
            let helix = |k: usize| robot.flagellum.helix(k).nodes(edges);
            let rod = |k: usize| Rod::stress_free(helix(k), robot.flagellum.stiffness()).clamped_at_foot();
            Solver::with_rods(&robot, Closure::Held, [rod(0), rod(1)])
        }
    }
    .expect("parameters");
    let mut state = solver.at_rest();
    let mut samples: Vec<(f64, [f64; 3])> = vec![];
    run(&mut solver, &mut state, [50.0, 10.0], 12.0, |_, state, _, report| {
        let f = &report.fluid;
        samples.push((state.time, [f[0].force.z, f[0].axial_torque, f[1].force.z]));
    });
    let mut sum = [0.0; 3];
    for pair in samples.windows(2) {
        let (from, to) = (pair[0].0.max(6.0), pair[1].0);
        for c in 0..3 {
            if to > from {
                // Steps are short against the window: the trapezium of its first, cut step is exact enough.
                sum[c] += 0.5 * (pair[0].1[c] + pair[1].1[c]) * (to - from) / 6.0;
            }
        }
    }
    sum
}

#[test]
fn converges_in_time() {
    let with = |rad: f64| {
        means(
            |r| {
                r.solver.step_rad = rad;
                // The order is that of even steps.
                r.solver.step_error = 1.0;
                r.solver.tolerance = 1e-4;
                r.solver.far_field = Precision::Double;
                r.solver.longest_step_s = 1.0
            },
            None,
        )
    };
    let exact = with(0.0475);
    let mut last = None;
    for (rad, bound) in [(0.76, 5e-2), (0.38, 5e-3), (0.19, 1e-3)] {
        let got = with(rad);
        let errors = [0, 1, 2].map(|c| (got[c] - exact[c]).abs() / exact[if c == 1 { 1 } else { 0 }].abs());
        let [thrust, torque, other] = errors;
        prove(&format!("step of {rad} rad: mean thrust, relative"), thrust.max(other), bound);
        prove(&format!("step of {rad} rad: mean axial torque, relative"), torque, bound);
        let size = thrust.max(other);
        if let Some(before) = last.replace(size) {
            let order: f64 = (before / size).log2();
            prove(&format!("step halved to {rad} rad: 3 less the observed order {order:.1}"), 3.0 - order, 1.5);
        }
    }
}

#[test]
fn converges_in_edge_length() {
    // At the regularisation of the default robot, whose helix has 19 edges a turn.
    let values = [49, 98, 196].map(|edges| means(|r| r.solver.tolerance = 1e-3, Some(edges)));
    for (c, name) in ["mean thrust", "mean axial torque"].into_iter().enumerate() {
        let [coarse, middle, fine] = values.map(|v| v[c]);
        prove(&format!("edge length: {name} with 49 edges against 196, relative"), (coarse / fine - 1.0).abs(), 0.02);
        prove(&format!("edge length: {name} with 98 edges against 196, relative"), (middle / fine - 1.0).abs(), 0.005);
    }
    let [coarse, middle, fine] = values.map(|v| v[0]);
    let order = ((coarse - middle) / (middle - fine)).abs().log2();
    prove(&format!("edge length: mean thrust: 2 less the observed order {order:.1}"), 2.0 - order, 0.5);
}

/// Returns the least distance of two segments: the squared distance is convex in both parameters, so its minimum over their
/// square is a corner, the foot of a perpendicular on an edge, or the point inside where both derivatives vanish.
fn least_over_all_faces(p: [V3; 2], q: [V3; 2]) -> f64 {
    let (u, v, w) = (p[1] - p[0], q[1] - q[0], p[0] - q[0]);
    let foot = |from: V3, direction: V3| (from.dot(&direction) / direction.norm_squared()).clamp(0.0, 1.0);
    let mut candidates = vec![];
    for end in [0.0, 1.0] {
        candidates.push((end, foot(w + u * end, v)));
        candidates.push((foot(v * end - w, u), end));
    }
    let (uu, uv, vv) = (u.dot(&u), u.dot(&v), v.dot(&v));
    let (s, t) = ((uv * v.dot(&w) - vv * u.dot(&w)), (uu * v.dot(&w) - uv * u.dot(&w)));
    let determinant = uu * vv - uv * uv;
    if determinant > 0.0 && (0.0..=determinant).contains(&s) && (0.0..=determinant).contains(&t) {
        candidates.push((s / determinant, t / determinant));
    }
    candidates.into_iter().map(|(s, t)| (w + u * s - v * t).norm()).fold(f64::INFINITY, f64::min)
}

#[test]
fn segment_distance_is_the_least_over_all_faces() {
    let mut seed = 0x2545f4914f6cdd1d;
    let mut worst = 0f64;
    for round in 0..1_000_000 {
        let scale = if round % 4 == 0 { 1e-3 } else { 1.0 };
        let mut point = || V3::new(noise(&mut seed), noise(&mut seed), noise(&mut seed));
        let (p0, q0) = (point(), point());
        let (mut u, mut v) = (point() * scale, point());
        match round % 10 {
            // Parallel, nearly parallel, perpendicular, short.
            1 => v = u * 0.7,
            2 => v = u + point() * 1e-7,
            3 => u = V3::new(u.x, 0.0, 0.0),
            4 => v *= 1e-3,
            _ => {}
        }
        let own = segment_distance(p0, p0 + u, q0, q0 + v).separation.norm();
        worst = worst.max((own - least_over_all_faces([p0, p0 + u], [q0, q0 + v])).abs());
    }
    prove("segment distance, 1e6 pairs of unit size, against the least over all faces", worst, 1e-8);
}
