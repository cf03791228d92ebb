//! Speed of trials on one core, with the error of the mean forces printed beside it.
//!
//! `cargo bench -p sim --bench trials`: real-time factor of 60 s, and the mean thrusts over its last 12 s
//! against a run with steps and tolerance small enough not to matter (up to twenty times as long).
//! Then error and speed of soft flagella, with shorter steps for the softest, and the growth of a step's cost with the number of edges, with the share of the
//! dense inverse and the least cost of an iteration without it.
//! Times are the processor's: other load hardly counts. `-- speed`, `-- soft` and `-- growth` select one of the three.

use nalgebra::{DMatrix, DVector};
use sim::V3;
use sim::body::closure::Closure;
use sim::body::shaft::MotorState;
use sim::fluid::far::{Sources, Targets, gauss_rule};
use sim::params::{Precision, Robot};
use sim::rod::Rod;
use sim::step::{Solver, StepControl};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Summary, Trial};
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Instant;

fn run(robot: &Robot, closure: Closure, rpm: [f64; 2]) -> (Summary, f64) {
    let (summary, used, _) = run_for(60.0, robot, closure, rpm);
    (summary, used)
}

/// Returns the summary, the processor's time it took in s and the number of inverses.
fn run_for(duration_s: f64, robot: &Robot, closure: Closure, rpm: [f64; 2]) -> (Summary, f64, usize) {
    let profile = SpeedProfile::constant(rpm, duration_s).expect("a profile");
    let mut trial = Trial::new(robot, closure, profile, Options::default()).expect("parameters");
    let start = processor_s();
    let summary = trial.finish().expect("a run");
    (summary, processor_s() - start, trial.solver().inverses_used())
}

/// Largest difference of the mean thrusts, over the larger thrust.
fn thrust_error(a: &Summary, b: &Summary) -> f64 {
    let thrust = |s: &Summary, k: usize| s.steady.force[k][2].mean;
    let scale = thrust(b, 0).abs().max(thrust(b, 1).abs());
    (0..2).map(|k| (thrust(a, k) - thrust(b, k)).abs()).fold(0.0, f64::max) / scale
}

/// The published robot with steps that no longer matter.
fn fine() -> Robot {
    let mut robot = Robot::published();
    robot.solver.step_rad = 0.1;
    robot.solver.step_error = 5e-5;
    robot.solver.tolerance = 2.5e-4;
    robot.solver.far_field = Precision::Double;
    robot
}

fn speed_and_error() {
    println!("| speeds rpm | closure | real-time factor | error of mean thrust | contact | sweeps a step |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let cases = [
        ([90.0, 90.0], Closure::Paper),
        ([50.0, 10.0], Closure::Paper),
        ([50.0, 10.0], Closure::Full),
        ([90.0, 90.0], Closure::Full),
        ([-90.0, 90.0], Closure::Full),
        ([90.0, 60.0], Closure::Full),
        ([-60.0, -60.0], Closure::Full),
        ([-90.0, -80.0], Closure::Full),
    ];
    for (rpm, closure) in cases {
        let robot = Robot::published();
        let (summary, mut used) = run(&robot, closure, rpm);
        let begun = Instant::now();
        while begun.elapsed().as_secs_f64() < 6.0 {
            used = used.min(run(&robot, closure, rpm).1);
        }
        let error = thrust_error(&summary, &run(&fine(), closure, rpm).0);
        println!(
            "| ({}, {}) | {closure:?} | {:.0} | {:.2} % | {:.2} | {:.2} |",
            rpm[0],
            rpm[1],
            60.0 / used,
            100.0 * error,
            summary.contact_share,
            summary.sweeps as f64 / summary.steps as f64,
        );
    }
}

/// Returns the processor's time that this program has used, s: other load does not count.
fn processor_s() -> f64 {
    // The kernel brings its account up to date when it chooses what runs next.
    std::thread::yield_now();
    let text = std::fs::read_to_string("/proc/self/schedstat").expect("the kernel's statistics of this process");
    let nanoseconds: f64 = text.split(' ').next().and_then(|field| field.parse().ok()).expect("a time");
    nanoseconds * 1e-9
}

/// Soft flagella over 10 s: speed by the processor's time, and errors of the means over these 10 s.
fn soft() {
    println!(
        "\n| E Pa | speeds rpm | motors apart m, length m | real-time factor | steps | sweeps a step | inverses | contact | error of mean thrust | of yaw deg | of tilt deg |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    let cases = [
        (3e5, [-90.0, -90.0], None),
        (1e5, [-90.0, -90.0], None),
        (3e5, [90.0, 90.0], None),
        (1e5, [90.0, 90.0], Some((0.025, 0.3))),
    ];
    for (young_pa, rpm, sizes) in cases {
        let change = |mut robot: Robot| {
            robot.flagellum.young_pa = young_pa;
            if let Some((apart, length)) = sizes {
                (robot.base.motor_distance_m, robot.flagellum.axial_length_m) = (apart, length);
            }
            robot
        };
        let robot = change(Robot::published());
        let one = || {
            let begun = processor_s();
            let (summary, _, inverses) = run_for(10.0, &robot, Closure::Full, rpm);
            (summary, inverses, processor_s() - begun)
        };
        let (summary, inverses, mut used) = one();
        for _ in 0..8 {
            used = used.min(one().2);
        }
        let tight = run_for(10.0, &change(fine()), Closure::Full, rpm).0;
        let [yaw, pitch, roll] =
            [0, 1, 2].map(|k| (summary.steady.attitude[k].mean - tight.steady.attitude[k].mean).to_degrees().abs());
        println!(
            "| {young_pa:.0e} | ({}, {}) | {}, {} | {:.0} | {} | {:.2} | {inverses} | {:.2} | {:.2} % | {yaw:.2} | {:.2} |",
            rpm[0],
            rpm[1],
            robot.base.motor_distance_m,
            robot.flagellum.axial_length_m,
            10.0 / used,
            summary.steps,
            summary.sweeps as f64 / summary.steps as f64,
            summary.contact_share,
            100.0 * thrust_error(&summary, &tight),
            pitch.max(roll),
        );
    }
}

/// The softest flagella of [`soft`] with shorter and shorter steps: means over 10 s.
fn shorter_steps() {
    println!(
        "\n| step error, times the default | step_rad | tolerance | steps | thrust 1 mN | thrust 2 mN | yaw deg | tilt deg |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for halvings in 0..6 {
        let mut robot = Robot::published();
        robot.flagellum.young_pa = 1e5;
        let share = 0.5f64.powi(halvings);
        if halvings > 0 {
            robot.solver.step_error *= share;
            robot.solver.step_rad = 0.1;
            robot.solver.tolerance = 2.5e-4;
            robot.solver.far_field = Precision::Double;
        }
        let (summary, ..) = run_for(10.0, &robot, Closure::Full, [-90.0, -90.0]);
        let [thrust1, thrust2] = summary.steady.force.map(|force| force[2].mean * 1e3);
        let [yaw, pitch, roll] = summary.steady.attitude.map(|level| level.mean.to_degrees());
        println!(
            "| {share:.3} | {} | {:.1e} | {} | {thrust1:.3} | {thrust2:.3} | {yaw:.2} | {:.2} |",
            robot.solver.step_rad,
            robot.solver.tolerance,
            summary.steps,
            pitch.hypot(roll),
        );
    }
}

/// Seconds of a call, the best of some runs of several calls.
fn seconds(mut call: impl FnMut()) -> f64 {
    let calls = 200;
    let one = |call: &mut dyn FnMut()| {
        let start = processor_s();
        (0..calls).for_each(|_| call());
        (processor_s() - start) / f64::from(calls)
    };
    (0..5).map(|_| one(&mut call)).fold(f64::INFINITY, f64::min)
}

/// Seconds for a dense product in single precision as large as one rod's inverse.
fn dense_product(edges: usize) -> f64 {
    let size = 4 * (edges + 1) - 2;
    let matrix = DMatrix::<f32>::repeat(size, size, 0.5);
    let (vector, mut product) = (DVector::<f32>::repeat(size, 0.25), DVector::<f32>::zeros(size));
    seconds(|| product.gemv(1.0, black_box(&matrix), black_box(&vector), 0.0))
}

/// Seconds for the far flow of one rod on itself: the least that an iteration of GMRES costs.
fn own_flow(robot: &Robot, edges: usize) -> f64 {
    let nodes = robot.flagellum.helix(0).nodes(edges);
    let density = vec![V3::new(0.1, 0.2, 0.3); nodes.len()];
    let (mut sources, mut targets) = (Sources::default(), Targets::new(nodes.len(), Precision::Single));
    sources.push_edges(0..edges, gauss_rule(2), |i| nodes[i], |i| density[i]);
    seconds(|| {
        targets.set(black_box(&nodes));
        targets.add_flow(&sources, robot.epsilon());
    })
}

fn growth() {
    println!(
        "\n| edges a flagellum | ms a step at (90, 90) | real-time factor | inverses | ms for one | share of a 120 s trial | products with it, share of a step | one product over one flow |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    let mut points = vec![];
    for edges in [25usize, 50, 100, 150, 200] {
        let mut robot = Robot::published();
        let length = robot.flagellum.helix(0).contour_length() / edges as f64;
        robot.flagellum.edge_length_m = length.min(robot.flagellum.edge_length_m);
        let rods = [0, 1].map(|k| Rod::stress_free(robot.flagellum.helix(k).nodes(edges), robot.flagellum.stiffness()));
        let mut solver = Solver::with_rods(&robot, Closure::Held, rods).expect("parameters");
        let (mut state, mut control) = (solver.at_rest(), StepControl::default());
        let speed = 3.0 * PI;
        let motors = |t: f64| [MotorState { angle: speed * t, speed }; 2];
        // A step that is cut short by an end would need an inverse of its own.
        const FAR: f64 = 1e3;
        let (start, mut first) = (processor_s(), 0);
        while state.time < 0.8 {
            control.advance(&mut solver, &mut state, FAR, &motors).expect("a step");
            first += 1;
        }
        // After the start no new inverse is needed: its cost is the rest of the start's time.
        let (warm, built, begun_s) = (processor_s() - start, solver.inverses_used(), state.time);
        let (start, mut sweeps) = (processor_s(), 0);
        let steps = if edges > 150 { 25 } else { 100 };
        for _ in 0..steps {
            sweeps += control.advance(&mut solver, &mut state, FAR, &motors).expect("a step").sweeps;
        }
        assert_eq!(solver.inverses_used(), built, "the steps that are timed need no inverse");
        let step = (processor_s() - start) / f64::from(steps);
        let length_s = (state.time - begun_s) / f64::from(steps);
        let inverse = (warm - f64::from(first) * step).max(0.0) / built as f64;
        let inverses = inverse * built as f64;
        let (product, flow) = (dense_product(edges), own_flow(&robot, edges));
        points.push(((edges as f64).ln(), step.ln()));
        println!(
            "| {edges} | {:.3} | {:.1} | {built} | {:.1} | {:.0} % | {:.0} % | {:.1} |",
            step * 1e3,
            length_s / step,
            inverse * 1e3,
            100.0 * inverses / (inverses + 120.0 / length_s * step),
            100.0 * 2.0 * f64::from(sweeps) / f64::from(steps) * product / step,
            product / flow,
        );
    }
    let n = points.len() as f64;
    let (sx, sy) = points.iter().fold((0.0, 0.0), |a, p| (a.0 + p.0 / n, a.1 + p.1 / n));
    let slope = points.iter().map(|p| (p.0 - sx) * (p.1 - sy)).sum::<f64>()
        / points.iter().map(|p| (p.0 - sx).powi(2)).sum::<f64>();
    println!("cost of a step grows as edges^{slope:.2}");
}

fn main() {
    let only = std::env::args().nth(1).unwrap_or_default();
    let wanted = |part: &str| !["speed", "soft", "growth"].contains(&only.as_str()) || only == part;
    if wanted("speed") {
        speed_and_error();
    }
    if wanted("soft") {
        soft();
        shorter_steps();
    }
    if wanted("growth") {
        growth();
    }
}
