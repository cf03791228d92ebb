//! The groups that carry a map to other robots.

use sim::body::closure::Closure;
use sim::groups::Groups;
use sim::params::{Robot, Tank};
use sim::trial::profile::{Phases, SpeedProfile};
use sim::trial::{Options, Summary, Trial};

fn run(robot: &Robot, rpm: [f64; 2]) -> Summary {
    robot.validate().unwrap();
    let profile = SpeedProfile::phases(&Phases { run: 12.0, ..Phases::default() }, rpm).unwrap();
    Trial::new(robot, Closure::Full, profile, Options::default()).unwrap().finish().unwrap()
}

/// A robot twice as large in a fluid three times as viscous, with the same groups, has the same angles; its forces are
/// those of its size.
#[test]
fn similar_robots_turn_alike() {
    let tank = Robot { tank: Some(Tank::published()), ..Robot::default() };
    for (name, robot, rpm) in [
        ("physical", Robot::default(), [50.0, 10.0]),
        ("physical, in contact", Robot::default(), [-90.0, 90.0]),
        ("published", Robot::published(), [0.0, 45.0]),
        ("in the tank", tank, [50.0, 10.0]),
    ] {
        let groups = Groups::of(&robot);
        let [small, large] = [run(&robot, rpm), run(&groups.robot(&robot, 2.0, 3.0), rpm)];
        let angles = |summary: &Summary| summary.steady.attitude.map(|level| level.mean.to_degrees());
        let worst = angles(&small).iter().zip(angles(&large)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{name}: {:?}, largest difference {worst:.2e} degrees", angles(&small));
        assert!(worst < 0.1, "{name}: {:?} {:?}", angles(&small), angles(&large));
        assert!(angles(&small).iter().any(|deg| deg.abs() > 0.5), "{name} has not turned");
        let thrust = |summary: &Summary| summary.steady.force[1][2].mean;
        let ratio = thrust(&large) / thrust(&small);
        assert!((ratio - 3.0 * 2f64.powi(2)).abs() < 0.02, "{name}: thrust {ratio}");
    }
}

/// Each group matters: a robot that differs in one of them has other angles.
#[test]
fn robots_with_other_groups_turn_otherwise() {
    let robot = Robot::default();
    let own = Groups::of(&robot);
    let yaw = |groups: &Groups| run(&groups.robot(&robot, 1.0, 1.0), [50.0, 10.0]).steady.attitude[0].mean.to_degrees();
    let before = yaw(&own);
    for (name, groups) in [
        ("stiffness", Groups { stiffness: 4.0 * own.stiffness, ..own }),
        ("spacing", Groups { spacing: 1.5 * own.spacing, ..own }),
        ("pitch", Groups { pitch: 0.7 * own.pitch, ..own }),
        ("radius", Groups { radius: 1.5 * own.radius, ..own }),
    ] {
        let change = yaw(&groups) - before;
        println!("{name}: yaw changes by {change:.2} degrees from {before:.2}");
        assert!(change.abs() > 0.5, "{name}: {change}");
    }
}
