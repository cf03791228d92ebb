//! Elastic flagella on a held base against another program (tests/data/peer), on the same mesh.

#![allow(clippy::needless_range_loop)]

use crate::common::{Series, first_nodes, prove, to_body};
use sim::V3;
use sim::body::{closure::Closure, shaft::MotorState};
use sim::params::Robot;
use sim::rod::Rod;
use sim::step::{Solver, StepControl};
use sim::trial::profile::SpeedProfile;
use sim::trial::sample::Sample;
use sim::trial::{Options, Trial};

/// The reference's robot: its regularisation, and no weight unless wanted.
fn robot(weight: bool) -> Robot {
    let mut robot = Robot::published();
    robot.fluid.regularisation_radii = 1.02;
    if !weight {
        robot.flagellum.density_kg_m3 = robot.fluid.density_kg_m3;
    }
    robot
}

/// Runs the reference's speeds (its rod 1 is our flagellum 2).
fn run(robot: &Robot, rpm: [f64; 2], duration: f64) -> (Vec<Sample>, Trial) {
    let profile = SpeedProfile::constant([rpm[1], rpm[0]], duration).expect("a profile");
    let options = Options { rate_hz: 20.0, shapes: false };
    let flagellum = &robot.flagellum;
    // The reference's clamp is that of two nodes and no more.
    let rod = |k: usize| Rod::stress_free(flagellum.helix(k).nodes(flagellum.edges()), flagellum.stiffness());
    let solver = Solver::with_rods(robot, Closure::Held, [rod(0), rod(1)]).expect("parameters");
    let mut trial = Trial::with_solver(solver, profile, options).expect("options");
    let samples = trial.by_ref().collect::<Result<Vec<_>, _>>().expect("a run");
    (samples, trial)
}

fn mean(samples: &[Sample], from: f64, to: f64, value: impl Fn(&Sample) -> f64) -> f64 {
    let picked: Vec<f64> =
        (samples.iter()).filter(|s| s.time_s > from + 1e-9 && s.time_s <= to + 1e-9).map(value).collect();
    picked.iter().sum::<f64>() / picked.len() as f64
}

fn compare(file: &str, rpm: [f64; 2], windows: &[(f64, f64)], swing: [f64; 2], weight: bool) {
    let reference = Series::read(file);
    let duration = windows.iter().fold(0.0, |a: f64, w| a.max(w.1));
    let (samples, _) = run(&robot(weight), rpm, duration);
    let gravity = Robot::published().net_weight() * 0.243103;
    for (from, to) in windows {
        for k in 0..2 {
            let force = |axis: &str| reference.mean(&format!("head_force{}_{axis}_N", k + 1), *from, *to);
            let theirs = to_body([force("x"), force("y"), force("z")]);
            let torque = -reference.mean(&format!("head_torque{}_x_Nm", k + 1), *from, *to);
            let own = |axis: usize| mean(&samples, *from, *to, |s| s.force_n[1 - k][axis]);
            // What their head feels contains the rod's weight; ours is reported apart.
            let thrust = own(2) - if weight { gravity } else { 0.0 };
            let label = format!("{file} {from}-{to} s, rod {}", k + 1);
            prove(&format!("{label}: thrust, relative"), (thrust / theirs[2] - 1.0).abs(), 0.01);
            let axial = mean(&samples, *from, *to, |s| s.axial_torque_nm[1 - k]);
            prove(&format!("{label}: axial torque, relative"), (axial / torque - 1.0).abs(), 0.01);
            for axis in 0..2 {
                let error = (own(axis) - theirs[axis]).abs() / swing[k];
                prove(&format!("{label}: lateral force {axis} over its swing"), error, 0.02);
            }
        }
    }
}

#[test]
fn equal_speeds() {
    compare("der_helix_p90_p90.csv", [90.0, 90.0], &[(4.0, 8.0), (20.0, 24.0)], [5.0e-3, 5.0e-3], false);
}

#[test]
fn unequal_speeds() {
    compare("der_helix_p50_p10.csv", [50.0, 10.0], &[(4.0, 10.0), (18.0, 24.0)], [4.05e-3, 1.55e-3], false);
}

#[test]
fn with_weight() {
    compare("der_helix_p90_p90_weight.csv", [90.0, 90.0], &[(2.0, 4.0)], [5.4e-3, 5.4e-3], true);
}

#[test]
fn contact_of_unequal_speeds() {
    let file = "der_helix_p50_p90_contact.csv";
    let reference = Series::read(file);
    let (samples, trial) = run(&robot(false), [50.0, 90.0], 66.0);
    let summary = trial.summary();
    let touch = summary.first_contact_s.expect("contact");
    prove("contact (50, 90): first touch, s", (touch - 23.2).abs(), 0.5);
    prove("contact (50, 90): largest penetration over the tolerance", summary.max_penetration_m / 1e-5, 1.0);
    let least = reference.column("min_distance_between_m").into_iter().fold(f64::INFINITY, f64::min);
    prove("contact (50, 90): least distance, m", (summary.min_gap_m + 6e-3 - least).abs(), 2e-5);
    for k in 0..2 {
        let theirs = -reference.mean(&format!("head_force{}_x_N", k + 1), 36.0, 66.0);
        let own = mean(&samples, 36.0, 66.0, |s| s.force_n[1 - k][2]);
        // Within 3 %, and where the force is near zero within 0.1 mN.
        let bound = (0.03 * theirs.abs()).max(1e-4);
        prove(
            &format!("contact (50, 90) 36-66 s, rod {}: thrust, over its bound", k + 1),
            (own - theirs).abs() / bound,
            1.0,
        );
        let torque = -reference.mean(&format!("head_torque{}_x_Nm", k + 1), 36.0, 66.0);
        let axial = mean(&samples, 36.0, 66.0, |s| s.axial_torque_nm[1 - k]);
        prove(
            &format!("contact (50, 90) 36-66 s, rod {}: axial torque, relative", k + 1),
            (axial / torque - 1.0).abs(),
            0.03,
        );
    }
}

#[test]
fn contact_of_a_soft_close_pair() {
    // Their own base (a stub and a ramp on the axis), softer and closer flagella. The transient is
    // unstable in itself, so steps are short and windows end early.
    let reference = Series::read("der_contact.csv");
    let mut robot = robot(false);
    robot.flagellum.young_pa = 1e5;
    robot.base.motor_distance_m = 0.025;
    robot.solver.step_rad = 0.1;
    let shapes = first_nodes("der_contact_nodes.csv");
    let stiffness = robot.flagellum.stiffness();
    let rod = |theirs: usize| {
        let axis = 0.025 * theirs as f64;
        let shape = (shapes[theirs].iter()).map(|x| V3::from(to_body([x.x, x.y - axis, x.z]))).collect();
        Rod::stress_free(shape, stiffness)
    };
    let mut solver = Solver::with_rods(&robot, Closure::Held, [rod(1), rod(0)]).expect("parameters");
    let (mut state, mut control) = (solver.at_rest(), StepControl::default());
    let speed = 3.0 * std::f64::consts::PI;
    let motors = |t: f64| [MotorState { angle: speed * t, speed }; 2];
    let (mut touch, mut least, mut sums) = (f64::INFINITY, f64::INFINITY, [[0.0; 2]; 2]);
    let windows = [(2.0, 6.0), (6.0, 9.0)];
    while state.time < 9.0 {
        let before = state.time;
        let report = control.advance(&mut solver, &mut state, 9.0, &motors).expect("a step");
        if report.touching > 0 {
            touch = touch.min(state.time);
        }
        least = least.min(solver.least_distance(&state));
        for (sum, (from, to)) in sums.iter_mut().zip(windows) {
            let part = (state.time.min(to) - before.max(from)).max(0.0);
            for k in 0..2 {
                sum[k] += part / (to - from) * (report.fluid[k].force.z + report.contact[k].force.z);
            }
        }
    }
    prove("soft close pair: first touch, s", (touch - 6.24).abs(), 0.5);
    prove("soft close pair: least distance, m", (least - 6.0038e-3).abs(), 2e-5);
    for (sum, (from, to)) in sums.iter().zip(windows) {
        for k in 0..2 {
            let theirs = -reference.mean(&format!("head_force{}_x_N", k + 1), from, to);
            let check = format!("soft close pair {from}-{to} s, rod {}: thrust, relative", k + 1);
            prove(&check, (sum[1 - k] / theirs - 1.0).abs(), 0.03);
        }
    }
}
