//! Steady states that are solved for, against trials of 120 s.

use crate::common::prove;
use nalgebra::{DVector, Quaternion, UnitQuaternion};
use sim::V3;
use sim::body::closure::Closure;
use sim::fluid::mobility::{mobility, nodal_lengths};
use sim::params::Robot;
use sim::steady::{self, Kind, Method, Periodic, Problem, SolveError, SteadyState};
use sim::trial::means::WINDOW;
use sim::trial::profile::SpeedProfile;
use sim::trial::sample::Sample;
use sim::trial::{Options, Summary, Trial, quantity};

const LONGEST_S: f64 = 120.0;

/// Returns a trial with a quarter of the tolerance, as the last periods of a search have it.
fn trial(rpm: [f64; 2], start_deg: [f64; 2]) -> Summary {
    let start = start_deg.map(f64::to_radians);
    let profile = SpeedProfile::constant(rpm, LONGEST_S).expect("a profile").from_angles(start);
    let mut robot = Robot::default();
    robot.solver.tolerance *= 0.25;
    let mut trial = Trial::new(&robot, Closure::Full, profile, Options::default()).expect("parameters");
    trial.finish().expect("a run")
}

fn problem(robot: &Robot, rpm: [f64; 2]) -> Problem<'_> {
    Problem {
        robot,
        closure: Closure::Full,
        rpm,
        start_rad: [0.0; 2],
        longest_s: LONGEST_S,
        output: None,
        at_rest: None,
    }
}

fn solve(rpm: [f64; 2], start_deg: [f64; 2]) -> Periodic {
    let robot = Robot::default();
    let problem = Problem { start_rad: start_deg.map(f64::to_radians), ..problem(&robot, rpm) };
    steady::solve(&problem, &|_| true).expect("a steady state")
}

#[test]
fn solved_states_are_those_that_trials_end_in() {
    for (rpm, start, kind) in [
        ([50.0, 10.0], [0.0, 0.0], Kind::Steady),
        ([-60.0, 60.0], [0.0, 0.0], Kind::Steady),
        ([90.0, 90.0], [0.0, 0.0], Kind::Steady),
        ([0.0, 30.0], [0.0, 0.0], Kind::Steady),
        // The phase decides to which side a flagellum that stands leans the robot.
        ([0.0, 30.0], [180.0, 0.0], Kind::Steady),
        ([0.0, 0.0], [0.0, 0.0], Kind::Steady),
        // No common period: means over both motor angles.
        ([37.0, 53.0], [0.0, 0.0], Kind::Beating),
        // There are two stable motions, with yaws of -82.65 and -80.02 degrees; a trial ends in the second one.
        ([80.66, 0.0], [0.0, 0.0], Kind::Beating),
        // Here with yaws of 78.61 and 74.32 degrees.
        ([-60.0, 0.0], [0.0, 0.0], Kind::Steady),
        // The motion that a search finds is none that a trial ends in.
        ([70.0, 10.0], [0.0, 0.0], Kind::Beating),
        // The flagella touch in each turn.
        ([80.0, 40.0], [0.0, 0.0], Kind::Steady),
        ([-60.0, -60.0], [0.0, 0.0], Kind::Steady),
    ] {
        let (solved, trial) = (solve(rpm, start), trial(rpm, start));
        println!("{rpm:?} from {start:?} deg: {:?} after {:.0} s", solved.kind, solved.simulated_s);
        assert_eq!((solved.kind, solved.summary.steady.settled), (kind, true), "{rpm:?} {start:?}");
        let angles = solved.summary.steady.attitude.iter().zip(&trial.steady.attitude);
        for (name, (solved, trial)) in ["yaw", "pitch", "roll"].into_iter().zip(angles) {
            let off = (solved.mean - trial.mean).abs() / (solved.uncertainty() + trial.uncertainty());
            prove(&format!("steady state of {rpm:?}: {name} against the trial, over both ±"), off, 1.0);
        }
        for k in 0..2 {
            let (solved, ended) = (&solved.summary.steady.force[k][2], &trial.steady.force[k][2]);
            let off = (solved.mean - ended.mean).abs();
            let both = solved.uncertainty() + ended.uncertainty();
            prove(
                &format!("steady state of {rpm:?}: thrust {} against the trial, over both ±", k + 1),
                off / both,
                1.0,
            );
            if trial.steady.settled {
                prove(&format!("steady state of {rpm:?}: thrust {} against the trial, mN", k + 1), off * 1e3, 0.1);
            }
        }
    }
}

/// Speeds without a common period, and runs that are shorter than two windows: their means are over the whole run, or its end.
#[test]
fn a_run_without_a_search_has_the_values_of_a_trial() {
    for (rpm, longest_s) in [([1.0, 90.0], 6.0), ([37.0, 53.0], 8.0)] {
        let mut robot = Robot::default();
        // The solution ends a step where its window begins, which a trial does not: with short steps that is no difference.
        robot.solver.step_error *= 0.1;
        robot.solver.step_rad *= 0.2;
        robot.solver.tolerance *= 0.05;
        let solved = steady::solve(&Problem { longest_s, ..problem(&robot, rpm) }, &|_| true).expect("a run");
        let profile = SpeedProfile::constant(rpm, longest_s).expect("a profile");
        let mut trial = Trial::new(&robot, Closure::Full, profile, Options::default()).expect("parameters");
        let trial = trial.finish().expect("a run");
        assert_eq!(solved.summary.steady.window_s, trial.steady.window_s, "{rpm:?}");
        for (solved, trial) in solved.summary.steady.attitude.iter().zip(&trial.steady.attitude) {
            prove(&format!("mean at {rpm:?}, deg"), (solved.mean - trial.mean).to_degrees().abs(), 3e-4);
        }
    }
}

#[test]
fn a_motion_that_repeats_costs_less_than_half_of_a_trial() {
    for rpm in [[50.0, 10.0], [90.0, 90.0], [0.0, 30.0]] {
        prove(&format!("simulated time at {rpm:?}, s"), solve(rpm, [0.0; 2]).simulated_s, 0.5 * LONGEST_S);
    }
}

#[test]
fn samples_are_those_of_the_results() {
    for (rpm, longest_s) in [
        // A motion that repeats.
        ([0.0, 45.0], LONGEST_S),
        // No common period, and runs that end when the means are known, and before.
        ([37.0, 53.0], 120.0),
        ([37.0, 53.0], 15.0),
        // No common period, and runs of some windows and of less than one and a half.
        ([1.0, 90.0], 40.0),
        ([90.0, 47.0], 15.0),
    ] {
        let robot = Robot::default();
        let output = Some(Options { rate_hz: 50.0, shapes: true });
        let problem = Problem { longest_s, ..problem(&robot, rpm) };
        let plain = steady::solve(&problem, &|_| true).expect("a steady state");
        let solved = steady::solve(&Problem { output, ..problem }, &|_| true).expect("a steady state");
        assert_eq!((solved.kind, solved.summary), (plain.kind, plain.summary.clone()), "samples change no result");
        assert!(plain.samples.is_empty());
        println!(
            "{rpm:?}, {longest_s} s: {:?} after {:.1} s, {:.2} s",
            plain.kind, plain.simulated_s, plain.duration_s
        );
        let window_s = plain.summary.steady.window_s;
        // Means over both motor angles are from more than the last window.
        let is_longer = plain.kind != Kind::Steady && plain.simulated_s >= 2.0 * WINDOW;
        assert_eq!(plain.duration_s < window_s - 1e-6, is_longer, "{rpm:?}: the means are over {window_s} s");
        assert!(plain.summary.first_contact_s.is_none_or(|time| (0.0..=plain.duration_s).contains(&time)));
        let samples = &solved.samples;
        assert_eq!(samples.len(), (solved.duration_s * 50.0 + 1e-6) as usize + 1, "{rpm:?}");
        for (i, sample) in samples.iter().enumerate() {
            assert!((sample.time_s - i as f64 / 50.0).abs() < 1e-9, "{rpm:?}: sample {i} at {} s", sample.time_s);
            assert!(sample.shapes_m.is_some());
        }
        let yaw: f64 = samples.windows(2).map(|pair| 0.5 * (pair[0].yaw_rad + pair[1].yaw_rad)).sum();
        let off = yaw / (samples.len() - 1) as f64 - plain.summary.steady.attitude[0].mean;
        // A mean over another time differs by no more than its ±.
        let stated = plain.summary.steady.attitude[0].uncertainty().to_degrees();
        let allowed = if is_longer { stated.clamp(0.05, 0.5) } else { 0.05 };
        prove(&format!("samples at {rpm:?}: mean yaw off the result, deg"), off.to_degrees().abs(), allowed);
    }
}

#[test]
fn a_closure_that_never_settles_is_not_found() {
    let robot = Robot::published();
    let never = Problem { closure: Closure::Paper, longest_s: 60.0, ..problem(&robot, [50.0, 10.0]) };
    let solved = steady::solve(&never, &|_| true).expect("a run");
    assert_eq!((solved.kind, solved.summary.steady.settled), (Kind::NotFound, false));
    prove("never settled: simulated time beyond the longest, s", (solved.simulated_s - 60.0).max(0.0), 60.0);
}

/// A beat of 33 minutes: after two of them the means are those of the phases that have passed.
#[test]
fn the_means_of_a_phase_that_slips_are_not_known() {
    let robot = Robot::default();
    let slips = problem(&robot, [45.5, -45.53]);
    for method in [Method::Steady, Method::Trial] {
        let state = SteadyState::by(method, &slips, &|_| true).expect("a run");
        assert_eq!((state.kind, state.summary.steady.settled), (Kind::NotFound, false), "{method:?}");
    }
}

#[test]
fn impossible_input_and_an_interruption_are_errors() {
    let robot = Robot::default();
    let solve = |rpm, longest_s, go_on: bool| {
        steady::solve(&Problem { longest_s, ..problem(&robot, rpm) }, &|_| go_on).map(|found| found.kind)
    };
    assert!(matches!(solve([f64::NAN, 0.0], 120.0, true), Err(SolveError::Profile(_))));
    assert!(matches!(solve([50.0, 10.0], 0.0, true), Err(SolveError::Profile(_))));
    assert_eq!(solve([50.0, 10.0], 120.0, false), Err(SolveError::Interrupted));
    let mut heavy = robot.clone();
    heavy.base.mass_kg = -1.0;
    let wrong = steady::solve(&problem(&heavy, [1.0, 90.0]), &|_| true);
    assert!(matches!(wrong, Err(SolveError::Parameter(_))));
}

/// The dissipation is that of nodes whose velocities are differences of their positions, with the dense mobility of the fluid. A
/// published flagellum does not resist its spin, and its head only turns in place.
#[test]
fn work_at_the_shafts_equals_dissipation() {
    const RATE_HZ: f64 = 100.0;
    const TIMES: usize = 12;
    let robot = Robot::published();
    let output = Some(Options { rate_hz: RATE_HZ, shapes: true });
    let solved = steady::solve(&Problem { output, ..problem(&robot, [50.0, 10.0]) }, &|_| true).expect("a run");
    let lines = |sample: &Sample| -> Vec<Vec<V3>> {
        let [w, i, j, k] = sample.attitude;
        let attitude = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
        let shapes = sample.shapes_m.as_ref().expect("shapes");
        shapes.iter().map(|line| line.iter().map(|x| attitude * V3::from(*x)).collect()).collect()
    };
    let step = (solved.samples.len() - 2) / TIMES;
    let dissipated = |at: usize| {
        let [before, now, after] = [at, at + 1, at + 2].map(|i| lines(&solved.samples[i]));
        let nodes = before.concat().into_iter().zip(after.concat());
        let velocity: Vec<f64> = nodes.flat_map(|(from, to)| <[f64; 3]>::from((to - from) * (0.5 * RATE_HZ))).collect();
        let views: Vec<&[V3]> = now.iter().map(Vec::as_slice).collect();
        let mobility = mobility(&views, robot.epsilon(), robot.fluid.viscosity());
        let density = mobility.lu().solve(&DVector::from_vec(velocity.clone())).expect("a mobility");
        let lengths: Vec<f64> = views.iter().flat_map(|line| nodal_lengths(line)).collect();
        (0..velocity.len()).map(|i| density[i] * velocity[i] * lengths[i / 3]).sum::<f64>()
    };
    let dissipated = (0..TIMES).map(|time| dissipated(time * step)).sum::<f64>() / TIMES as f64;
    let work = quantity::Values::of(&solved.summary).get(&quantity::POWER);
    prove("work at the shafts over what the flagella dissipate, less one", (work / dissipated - 1.0).abs(), 0.01);
}
