//! What the model's choices and the effects that it can leave out change: one change at a time, at four points.
//!
//! `cargo run --release -p sim --example accuracy` prints the tables of `sim/docs/accuracy.md`. Closure full, 120 s,
//! starting phase 0 unless a row says otherwise.

use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::{HeadShape, Robot, Tank};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Summary, Trial};

/// The points of the publication, rpm.
const POINTS: [[f64; 2]; 4] = [[50.0, 10.0], [0.0, 45.0], [90.0, 90.0], [-90.0, 90.0]];

/// A change of the robot or of the start.
struct Change {
    name: &'static str,
    robot: fn(&mut Robot),
    start_deg: [f64; 2],
}

/// A change of the robot alone.
const fn robot(name: &'static str, robot: fn(&mut Robot)) -> Change {
    Change { name, robot, start_deg: [0.0; 2] }
}

const CHANGES: [Change; 8] = [
    robot("physical", |_| {}),
    robot("regularisation 1.03 r", |robot| robot.fluid.regularisation_radii = 1.03),
    robot("no drag on the rods' spin", |robot| robot.fluid.spin_drag = 0.0),
    robot("head with a drag and no flow", |robot| robot.head.shape = HeadShape::Local),
    robot("in the tank", |robot| robot.tank = Some(Tank::published())),
    robot("weight of the flagella on the base", |robot| robot.base.flagella_weight_on_base = true),
    robot("edges of 2.5 mm", |robot| robot.flagellum.edge_length_m = 0.0025),
    Change { name: "flagellum 2 starts 90 deg ahead", robot: |_| {}, start_deg: [0.0, 90.0] },
];

/// Yaw, pitch and roll in deg, thrusts in mN, torques in mN m, share of the time in contact in %.
fn run(change: &Change, rpm: [f64; 2]) -> [f64; 8] {
    let mut robot = Robot::default();
    (change.robot)(&mut robot);
    let profile = SpeedProfile::constant(rpm, 120.0).expect("a profile");
    let profile = profile.from_angles(change.start_deg.map(f64::to_radians));
    let mut trial = Trial::new(&robot, Closure::Full, profile, Options::default()).expect("parameters");
    let Summary { steady, contact_share, .. } = trial.finish().expect("a run");
    let [yaw, pitch, roll] = steady.attitude.map(|level| level.mean.to_degrees());
    let [thrust1, thrust2] = steady.force.map(|[.., z]| z.mean * 1e3);
    let [torque1, torque2] = steady.axial_torque.map(|torque| torque.mean * 1e3);
    [yaw, pitch, roll, thrust1, thrust2, torque1, torque2, 100.0 * contact_share]
}

fn main() {
    for rpm in POINTS {
        println!("({}, {}) rpm; deg, mN, mN m, % of the time\n", rpm[0], rpm[1]);
        println!("| | yaw | pitch | roll | thrust 1 | thrust 2 | torque 1 | torque 2 | contact |");
        println!("| --- |{}", " --- |".repeat(8));
        let rows: Vec<_> = CHANGES.par_iter().map(|change| run(change, rpm)).collect();
        for (Change { name, .. }, [yaw, pitch, roll, t1, t2, q1, q2, contact]) in CHANGES.iter().zip(rows) {
            println!(
                "| {name} | {yaw:.2} | {pitch:.2} | {roll:.2} | {t1:.3} | {t2:.3} | {q1:.4} | {q2:.4} | {contact:.0} |"
            );
        }
        println!();
    }
}
