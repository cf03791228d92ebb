//! Starting phases: what they change, and where they come again.

use crate::common::prove;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Summary, Trial};

/// Steady state of 60 s of the published robot whose motors start at these angles, deg.
fn run(rpm: [f64; 2], start_deg: [f64; 2]) -> Summary {
    let profile = SpeedProfile::constant(rpm, 60.0).expect("a profile").from_angles(start_deg.map(f64::to_radians));
    let mut trial = Trial::new(&Robot::published(), Closure::Full, profile, Options::default()).expect("parameters");
    trial.finish().expect("a run")
}

/// Yaw, pitch and roll, deg.
fn angles(summary: &Summary) -> [f64; 3] {
    summary.steady.attitude.map(|level| level.mean.to_degrees())
}

#[test]
fn equal_speeds_keep_their_phase_and_it_decides_contact_and_thrust() {
    let [aligned, turned] = [0.0, 90.0].map(|phase| run([90.0, 90.0], [0.0, phase]));
    let thrust = |summary: &Summary, k: usize| summary.steady.force[k][2].mean * 1e3;
    for (phase, summary) in [(0, &aligned), (90, &turned)] {
        let [yaw, pitch, roll] = angles(summary);
        let (contact, [f1, f2]) = (summary.contact_share, [0, 1].map(|k| thrust(summary, k)));
        println!(
            "(90, 90) from {phase} deg: yaw {yaw:.2} pitch {pitch:.2} roll {roll:.2} deg, thrusts {f1:.2} {f2:.2} mN, \
             contact {contact:.2}"
        );
    }
    prove("(90, 90) in phase: share of contact", aligned.contact_share, 0.0);
    prove("(90, 90) in phase: largest of pitch and roll, deg", angles(&aligned)[1].hypot(angles(&aligned)[2]), 0.1);
    prove(
        "(90, 90) in phase: thrust 1 against 2, relative",
        (thrust(&aligned, 0) / thrust(&aligned, 1) - 1.0).abs(),
        0.01,
    );
    prove("(90, 90) a quarter of a turn apart: time without contact", 1.0 - turned.contact_share, 0.5);
    prove("(90, 90) a quarter of a turn apart: thrust 1 over thrust 2", thrust(&turned, 0) / thrust(&turned, 1), 0.6);
    prove("(90, 90) a quarter of a turn apart: 1.8 deg over the pitch", 1.8 / angles(&turned)[1].abs(), 1.0);
}

#[test]
fn a_flagellum_that_stands_leans_the_robot_its_way() {
    for (rpm, which) in [([90.0, 0.0], 1), ([0.0, 90.0], 0)] {
        let pitch = [0.0, 180.0].map(|phase| {
            let mut start = [0.0; 2];
            start[which] = phase;
            angles(&run(rpm, start))[1]
        });
        let turning = angles(&run(rpm, if which == 1 { [90.0, 0.0] } else { [0.0, 90.0] }))[1];
        let [a, b] = pitch;
        println!("{rpm:?}: pitch {a:.2} and {b:.2} deg, from another angle of the turning one {turning:.2} deg");
        prove(
            "a standing flagellum: 1 deg over the change of pitch with its phase",
            1.0 / (pitch[0] - pitch[1]).abs(),
            1.0,
        );
        prove("a standing flagellum: change of pitch with the other's phase, deg", (pitch[0] - turning).abs(), 0.1);
    }
}

#[test]
fn phases_come_again_after_the_part_of_a_turn_that_starts_cover() {
    // 2:1: flagellum 1 has made a turn when flagellum 2 has made half of one.
    let [here, again, elsewhere] = [30.0, 210.0, 120.0].map(|phase| run([90.0, 45.0], [0.0, phase]));
    let [a, b, c] = [&here, &again, &elsewhere].map(angles);
    println!("(90, 45) from 30, 210 and 120 deg: yaw {:.2} {:.2} {:.2} deg", a[0], b[0], c[0]);
    let both = [&here, &again].map(|s| s.steady.attitude[0].uncertainty().to_degrees()).iter().sum::<f64>();
    prove("(90, 45): yaw half a turn of flagellum 2 later, over both ±", (a[0] - b[0]).abs() / both, 1.0);
    prove("(90, 45): 1 deg over the change of yaw a quarter of a turn later", 1.0 / (a[0] - c[0]).abs(), 1.0);
}

#[test]
fn a_helix_that_is_turned_on_its_shaft_is_a_motor_that_starts_elsewhere() {
    let start = [40.0f64, -110.0];
    let samples = |robot: &Robot, start_deg: [f64; 2]| {
        let profile =
            SpeedProfile::constant([60.0, 60.0], 5.0).expect("a profile").from_angles(start_deg.map(f64::to_radians));
        let options = Options { shapes: true, ..Options::default() };
        let trial = Trial::new(robot, Closure::Full, profile, options).expect("parameters");
        trial.collect::<Result<Vec<_>, _>>().expect("a run")
    };
    let mut turned = Robot::published();
    turned.flagellum.phase_deg = start;
    let (turned, moved) = (samples(&turned, [0.0; 2]), samples(&Robot::published(), start));
    assert_eq!(turned[0].motor_angle_rad, [0.0; 2], "encoders count from the zero of the motors");
    for (a, b) in turned.iter().zip(&moved) {
        assert_eq!((a.attitude, &a.shapes_m), (b.attitude, &b.shapes_m), "{} s", a.time_s);
        for (k, start) in start.into_iter().enumerate() {
            assert!((b.motor_angle_rad[k] - a.motor_angle_rad[k] - start.to_radians()).abs() < 1e-12);
        }
    }
}
