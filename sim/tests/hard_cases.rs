//! Random robots and speeds give a result or a clear error, never a NaN, a panic or an endless loop.
//!
//! `SIM_HARD_CASES` sets their number (60; ten thousand take some minutes).

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::rod::helix::Handedness;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};

#[derive(Clone, Debug)]
struct Case {
    robot: Robot,
    closure: Closure,
    rpm: Vec<[f64; 2]>,
    duration: f64,
}

/// A factor between 1/most and most.
fn factor(most: f64) -> impl Strategy<Value = f64> {
    (-1.0f64..1.0).prop_map(move |e| most.powf(e))
}

prop_compose! {
    fn case()(
        shape in (factor(1.5), factor(1.5), factor(1.5), factor(1.5), factor(1.5)),
        matter in (factor(30.0), factor(10.0), factor(1.3), 0.3f64..1.05),
        base in (factor(10.0), factor(2.0), factor(3.0), -0.003f64..0.01),
        joint in (factor(30.0), 0.0f64..1e-3, 0.0f64..1e-3),
        friction in prop_oneof![Just(0.0), 0.0f64..1.0],
        hands in (any::<bool>(), any::<bool>()),
        closure in prop_oneof![Just(Closure::Full), Just(Closure::Lumped), Just(Closure::Paper), Just(Closure::Held)],
        rpm in prop::collection::vec(prop::array::uniform2(-200.0f64..200.0), 1..4),
        duration in 0.05f64..1.0,
    ) -> Case {
        let mut robot = Robot::published();
        let f = &mut robot.flagellum;
        f.rod_radius_m *= shape.0;
        f.helix_radius_m *= shape.1;
        f.pitch_m *= shape.2;
        f.axial_length_m *= 0.5 * shape.3;
        f.edge_length_m *= 1.3;
        f.young_pa *= matter.0;
        f.density_kg_m3 *= matter.2;
        let hand = |right| if right { Handedness::Right } else { Handedness::Left };
        f.handedness = [hand(hands.0), hand(hands.1)];
        robot.fluid.viscosity_pa_s *= matter.1;
        robot.fluid.regularisation_radii = matter.3 * f.edge_length_m / f.rod_radius_m;
        robot.base.inertia_kg_m2 = robot.base.inertia_kg_m2.map(|i| i * base.0);
        robot.base.motor_distance_m *= base.1 * shape.4;
        robot.base.rotational_drag *= base.2;
        robot.base.mass_centre_below_joint_m = base.3;
        robot.joint.tether_full_nm_per_rad *= joint.0;
        robot.joint.viscous_nms = joint.1;
        robot.joint.coulomb_nm = joint.2;
        robot.contact.friction = friction;
        Case { robot, closure, rpm, duration }
    }
}

fn run(case: &Case) -> Result<&'static str, TestCaseError> {
    // Speeds jump at the start and change along ramps and a jump.
    let mut points = vec![];
    let parts = case.rpm.len() as f64;
    for (i, rpm) in case.rpm.iter().enumerate() {
        points.push((i as f64 / parts * case.duration, *rpm));
        points.push(((i as f64 + 0.6) / parts * case.duration, *rpm));
    }
    points.push((0.6 + case.duration, case.rpm[0]));
    let profile = SpeedProfile::from_points(&points).expect("a profile");
    let options = Options { rate_hz: 50.0, shapes: true };
    let trial = match Trial::new(&case.robot, case.closure, profile, options) {
        Ok(trial) => trial,
        Err(error) => {
            prop_assert!(!error.reason.is_empty());
            return Ok("refused");
        }
    };
    for sample in trial {
        match sample {
            Err(error) => {
                prop_assert!(error.to_string().len() > 20);
                return Ok("stopped with an error");
            }
            Ok(s) => {
                let numbers =
                    s.attitude.iter().chain(&s.rate_rad_s).chain(s.force_n.iter().flatten()).chain(&s.axial_torque_nm);
                let shapes = s.shapes_m.iter().flatten().flatten().flatten();
                prop_assert!(numbers.chain(shapes).all(|v| v.is_finite()), "{s:?}");
                prop_assert!(s.yaw_rad.is_finite() && s.min_gap_m.is_finite());
                let unit: f64 = s.attitude.iter().map(|c| c * c).sum();
                prop_assert!((unit - 1.0).abs() < 1e-9);
            }
        }
    }
    Ok("ran")
}

#[test]
fn random_robots_run_or_say_why_not() {
    let cases = std::env::var("SIM_HARD_CASES").ok().and_then(|v| v.parse().ok()).unwrap_or(60);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let counts = std::cell::RefCell::new(std::collections::BTreeMap::<&str, u32>::new());
    let outcome = TestRunner::new(config).run(&case(), |case| {
        *counts.borrow_mut().entry(run(&case)?).or_default() += 1;
        Ok(())
    });
    println!("{cases} random robots: {:?}", counts.borrow());
    if let Err(error) = outcome {
        panic!("{error}");
    }
}
