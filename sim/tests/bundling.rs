//! Flagella that wrap round each other with contact, and unwrap when one motor reverses.

use crate::common::prove;
use sim::body::closure::Closure;
use sim::contact::bundling::{BUNDLED_TURNS, Bundling};
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::sample::Sample;
use sim::trial::{Options, Summary, Trial};

/// Softer, longer and closer flagella than the published ones.
fn soft_robot() -> Robot {
    let mut robot = Robot::published();
    robot.flagellum.young_pa = 1e5;
    robot.flagellum.axial_length_m = 0.3;
    robot.base.motor_distance_m = 0.025;
    robot
}

fn run(robot: &Robot) -> (Vec<Sample>, Summary) {
    let profile = SpeedProfile::from_points(&[
        (0.0, [0.0, 0.0]),
        (0.5, [90.0, 90.0]),
        (35.0, [90.0, 90.0]),
        (36.0, [90.0, -90.0]),
        (60.0, [90.0, -90.0]),
    ])
    .expect("a profile");
    let options = Options { rate_hz: 2.0, shapes: false };
    let mut trial = Trial::new(robot, Closure::Full, profile, options).expect("parameters");
    let samples = trial.by_ref().collect::<Result<Vec<_>, _>>().expect("a run");
    (samples, trial.summary())
}

#[test]
fn a_soft_pair_bundles_and_unwraps() {
    let robot = soft_robot();
    let (samples, summary) = run(&robot);
    let at = |time: f64| samples.iter().find(|s| s.time_s >= time).expect("a sample");
    println!("winding {:.2} turns at 34 s, {:.2} at 60 s", at(34.0).winding_turns, at(60.0).winding_turns);
    assert_eq!(summary.bundling, Bundling::Bundled);
    assert_eq!(at(34.0).bundling, Bundling::Bundled);
    assert_ne!(at(60.0).bundling, Bundling::Bundled);
    // Once unwrapped they still cross, which is half a turn and a little more.
    let late = samples.iter().filter(|s| s.time_s >= 45.0).map(|s| s.winding_turns.abs()).fold(0.0, f64::max);
    prove("bundle: turns from 10 s after the reversal on, over those of a bundle", late / BUNDLED_TURNS, 1.0);
    prove(
        "bundle: turns that make a bundle over those before the reversal",
        BUNDLED_TURNS / at(34.0).winding_turns.abs(),
        1.0,
    );
    prove("bundle: largest penetration over the tolerance", summary.max_penetration_m / robot.contact.tolerance_m, 1.0);
}

/// The reversal is left out: while the rods unwrap they stick and snap, and with a coefficient of 0.1 or more a step fails.
#[test]
fn a_bundle_with_friction_holds() {
    let mut robot = soft_robot();
    robot.contact.friction = 0.3;
    // Rods that spin without drag twist too freely for it.
    robot.fluid.spin_drag = 1.0;
    let profile = SpeedProfile::from_points(&[(0.0, [0.0, 0.0]), (0.5, [90.0, 90.0]), (35.0, [90.0, 90.0])]);
    let options = Options { rate_hz: 2.0, shapes: false };
    let mut trial = Trial::new(&robot, Closure::Full, profile.expect("a profile"), options).expect("parameters");
    let samples = trial.by_ref().collect::<Result<Vec<_>, _>>().expect("a run");
    let summary = trial.summary();
    let last = samples.last().expect("a sample");
    println!("with friction: winding {:.2} turns at {:.0} s", last.winding_turns, last.time_s);
    assert_eq!((summary.bundling, last.bundling), (Bundling::Bundled, Bundling::Bundled));
    prove(
        "bundle with friction: largest penetration over the tolerance",
        summary.max_penetration_m / robot.contact.tolerance_m,
        1.0,
    );
}

/// Soft flagella of which one pushes itself together: its turns press on each other, while the flagella stay 1 cm apart.
#[test]
fn a_flagellum_that_touches_itself_does_not_touch_the_other() {
    let mut robot = Robot::default();
    robot.flagellum.young_pa = 2.5e5;
    let profile = SpeedProfile::constant([-70.7, 70.1], 20.0).expect("a profile");
    let mut trial = Trial::new(&robot, Closure::Full, profile, Options::default()).expect("parameters");
    let samples = trial.by_ref().collect::<Result<Vec<_>, _>>().expect("a run");
    let summary = trial.summary();
    println!("largest force {:.1} mN, gap {:.1} mm", summary.largest_contact_n * 1e3, summary.min_gap_m * 1e3);
    assert!(summary.largest_contact_n > 1e-4 && summary.min_gap_m > 5e-3, "{summary:?}");
    assert_eq!((summary.contact_share, summary.first_contact_s, summary.bundling), (0.0, None, Bundling::Apart));
    assert!(samples.iter().all(|sample| sample.bundling == Bundling::Apart));
    // What it is known to is what contact leaves of it.
    let errors = summary.steady.attitude.map(|level| level.standard_error);
    assert!(errors.iter().all(|error| error.is_none_or(|error| error >= 0.075f64.to_radians())), "{errors:?}");
}

#[test]
fn two_way_contact_in_the_hard_quadrant() {
    // Both flagella pull inwards: they cross and are forced past each other.
    for rpm in [[-90.0, -80.0], [-50.0, -30.0]] {
        let robot = Robot::published();
        let profile = SpeedProfile::constant(rpm, 20.0).expect("a profile");
        let mut trial = Trial::new(&robot, Closure::Full, profile, Options::default()).expect("parameters");
        let summary = trial.finish().expect("a run");
        assert!(summary.contact_share > 0.1);
        println!(
            "{rpm:?}: largest force {:.0} mN, contact {:.2} of the time",
            summary.largest_contact_n * 1e3,
            summary.contact_share
        );
        prove(
            &format!("full, ({}, {}): largest penetration over the tolerance", rpm[0], rpm[1]),
            summary.max_penetration_m / robot.contact.tolerance_m,
            1.0,
        );
    }
}

/// Both senses negative: the flagella stick and snap past each other once a beat.
#[test]
fn flagella_mesh_with_friction() {
    for (name, mut robot, seconds) in [("published", Robot::published(), 20.0), ("physical", Robot::default(), 8.0)] {
        robot.contact.friction = 0.3;
        let profile = SpeedProfile::constant([-80.0, -20.0], seconds).expect("a profile");
        let mut trial = Trial::new(&robot, Closure::Full, profile, Options::default()).expect("parameters");
        let summary = trial.finish().expect("a run");
        assert!(summary.contact_share > 0.3, "{name}: in contact {} of the time", summary.contact_share);
        prove(
            &format!("{name} meshes with friction: largest penetration over the tolerance"),
            summary.max_penetration_m / robot.contact.tolerance_m,
            1.0,
        );
    }
}
