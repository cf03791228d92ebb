//! The time constants of the return to rest against decays of the full model.

use crate::common::prove;
use sim::body::closure::Closure;
use sim::params::{Flagellum, Fluid, Glycerol, Robot};
use sim::return_to_rest::TimeConstants;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};

/// Duration of the run before the decay, s.
const RUN_S: f64 = 20.0;

/// Part of the decay over which the time constant is measured, in expected ones: faster motions have faded.
const MEASURED: [f64; 2] = [4.0, 6.0];

/// Returns the time constant of an angle after a run at these speeds, s.
fn measured_s(robot: &Robot, rpm: [f64; 2], expected_s: f64, angle: impl Fn([f64; 3]) -> f64) -> f64 {
    let still = [0.0; 2];
    let [from_s, to_s] = MEASURED.map(|constants| RUN_S + constants * expected_s);
    let points = [(0.0, still), (0.5, rpm), (RUN_S, rpm), (RUN_S + 0.5, still), (to_s + 1.0, still)];
    let profile = SpeedProfile::from_points(&points).expect("a profile");
    let trial = Trial::new(robot, Closure::Full, profile, Options { rate_hz: 10.0, shapes: false }).expect("a robot");
    let samples: Vec<_> = trial.map(|sample| sample.expect("a step")).collect();
    let at = |time_s: f64| {
        let sample = samples.iter().find(|sample| sample.time_s >= time_s).expect("a sample");
        (sample.time_s, angle([sample.yaw_rad, sample.pitch_rad, sample.roll_rad]).abs())
    };
    let ((from_s, from), (to_s, to)) = (at(from_s), at(to_s));
    (to_s - from_s) / (from / to).ln()
}

/// Robots of every kind: built-in, as a fit finds them, cold, soft, and hardly tethered.
fn robots() -> [(&'static str, Robot); 6] {
    let with = |change: &dyn Fn(&mut Robot)| {
        let mut robot = Robot::default();
        change(&mut robot);
        robot
    };
    let mut cold = Robot::published();
    cold.fluid.glycerol = Some(Glycerol { mass_fraction: 0.987, temperature_c: 18.3 });
    [
        ("physical", Robot::default()),
        ("published", Robot::published()),
        (
            "fitted",
            with(&|robot| {
                robot.fluid = Fluid { viscosity_pa_s: 0.8473, ..Fluid::default() };
                robot.joint.tether_full_nm_per_rad = 6.13e-4;
                robot.base.mass_centre_below_joint_m = 0.00237;
            }),
        ),
        ("cold", cold),
        ("soft", with(&|robot| robot.flagellum = Flagellum { young_pa: 4.3e5, ..Flagellum::default() })),
        ("hardly tethered", with(&|robot| robot.joint.tether_full_nm_per_rad = 1.37e-4)),
    ]
}

#[test]
fn time_constants_are_those_of_the_full_model() {
    for (name, robot) in robots() {
        let expected = TimeConstants::of(&robot).expect("a robot");
        // Nearly equal speeds turn the robot and hardly tilt it; opposite ones tilt it.
        let yaw_s = measured_s(&robot, [63.7, 58.9], expected.yaw_s, |[yaw, ..]| yaw);
        let tilt_s = measured_s(&robot, [-52.9, 78.3], expected.tilt_s, |[_, pitch, roll]| pitch.hypot(roll));
        println!("{name}: yaw {:.2} of {yaw_s:.2} s, tilt {:.2} of {tilt_s:.2} s", expected.yaw_s, expected.tilt_s);
        prove(&format!("{name}: time constant of the yaw"), (expected.yaw_s / yaw_s - 1.0).abs(), 0.2);
        prove(&format!("{name}: time constant of the tilt"), (expected.tilt_s / tilt_s - 1.0).abs(), 0.07);
        prove(&format!("{name}: slowest"), (expected.slowest_s() / yaw_s.max(tilt_s) - 1.0).abs(), 0.1);
    }
}

/// Without a spring nothing comes back.
#[test]
fn a_robot_without_a_tether_never_returns() {
    let mut robot = Robot::default();
    robot.joint.tether_full_nm_per_rad = 0.0;
    let constants = TimeConstants::of(&robot).expect("a robot");
    assert!(constants.yaw_s.is_infinite() && constants.tilt_s.is_finite(), "{constants:?}");
}
