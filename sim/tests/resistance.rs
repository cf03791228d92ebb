//! The resistance of the rigid robot against resolved surfaces (`tests/data/surface`), its symmetry and its invariance.

use crate::common::prove;
use nalgebra::DVector;
use sim::V3;
use sim::accuracy::ModelError;
use sim::params::{Face, HeadShape, Robot, Tank};
use sim::resistance::{Resistance, resistance};
use std::f64::consts::PI;

/// A case of rigid parts whose true surfaces are resolved; forces and torques of the fluid on the parts.
#[derive(serde::Deserialize)]
struct Case {
    case: String,
    speeds_rpm: Vec<f64>,
    phase_deg: Vec<f64>,
    #[serde(rename = "force1_mN")]
    force1: [f64; 3],
    #[serde(rename = "torque1_mNm")]
    torque1: f64,
    #[serde(rename = "force2_mN")]
    force2: Option<[f64; 3]>,
    #[serde(rename = "torque2_mNm")]
    torque2: Option<f64>,
    #[serde(rename = "moment_flagella_mNm")]
    moment: [f64; 3],
    #[serde(rename = "head_force_mN")]
    head_force: Option<[f64; 3]>,
    #[serde(rename = "head_moment_mNm")]
    head_moment: Option<[f64; 3]>,
}

fn cases() -> Vec<Case> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/surface/cases.json");
    serde_json::from_str(&std::fs::read_to_string(path).expect("the cases")).expect("cases")
}

/// Forces and moments of the fluid on each part when the motors turn and the base is held still, N and N m.
fn loads(resistance: &Resistance, rpm: &[f64]) -> Vec<[V3; 2]> {
    let mut motion = DVector::zeros(resistance.matrix.nrows());
    for (k, rpm) in rpm.iter().enumerate() {
        motion[6 * (k + 1) + 5] = rpm * PI / 30.0;
    }
    let load = -(&resistance.matrix * motion);
    (0..=rpm.len()).map(|part| [0, 3].map(|side| load.fixed_rows::<3>(6 * part + side).into_owned())).collect()
}

/// The walls at y = +-225 mm of the data, and nothing else.
fn channel() -> Tank {
    Tank {
        length_m: 2.0,
        width_m: 0.45,
        height_m: 2.0,
        joint_m: [1.0, 0.225],
        joint_depth_m: 1.0,
        walls: vec![Face::MinusY, Face::PlusY],
        free_surface: false,
    }
}

#[test]
fn resolved_surfaces_agree() {
    for case in &cases() {
        let name = &case.case;
        let mut robot = Robot::default();
        if case.head_force.is_none() {
            robot.head.shape = HeadShape::None;
        }
        if case.case.contains("channel") {
            robot.tank = Some(channel());
        }
        let angles: Vec<f64> = case.phase_deg.iter().map(|phase| phase.to_radians()).collect();
        let found = resistance(&robot, &angles).expect("parameters");
        let parts = loads(&found, &case.speeds_rpm);
        let forces: Vec<[f64; 3]> = [Some(case.force1), case.force2].into_iter().flatten().collect();
        let torques: Vec<f64> = [Some(case.torque1), case.torque2].into_iter().flatten().collect();
        let size = |v: &[f64]| v.iter().fold(0f64, |a, b| a.max(b.abs()));
        let largest_force = size(&forces.concat());
        let largest_torque = size(&torques);
        let largest_moment = size(&case.moment);
        let feet = robot.shaft_feet();
        let mut moment = V3::zeros();
        for (k, (force, torque)) in forces.iter().zip(&torques).enumerate() {
            let [f, m] = parts[k + 1];
            moment += m + feet[k].cross(&f);
            let f = f * 1e3;
            println!(
                "{name}, flagellum {}: force {:.3}, {:.3}, {:.3} against {force:.3?} mN, torque {:.4} against {torque:.4} mN m",
                k + 1,
                f.x,
                f.y,
                f.z,
                m.z * 1e3
            );
            let thrust = (f.z - force[2]).abs() / largest_force;
            prove(&format!("{name}, flagellum {}: thrust over the row's largest force", k + 1), thrust, 0.03);
            let axial = (m.z * 1e3 - torque).abs() / largest_torque;
            prove(&format!("{name}, flagellum {}: torque over the row's largest", k + 1), axial, 0.06);
            println!(
                "{name}, flagellum {}: lateral forces off by {:.1} %",
                k + 1,
                100.0 * (f.xy() - V3::from(*force).xy()).amax() / largest_force
            );
        }
        let m = moment * 1e3;
        println!("{name}: moment {:.3}, {:.3}, {:.3} against {:.3?} mN m", m.x, m.y, m.z, case.moment);
        prove(&format!("{name}: yaw moment, relative"), (m.z / case.moment[2] - 1.0).abs(), 0.04);
        println!(
            "{name}: tilting moments off by {:.1} % of the largest moment",
            100.0 * (m.xy() - V3::from(case.moment).xy()).amax() / largest_moment
        );
        if let (Some(force), Some(moment)) = (case.head_force, case.head_moment) {
            let [f, m] = parts[0].map(|v| v * 1e3);
            println!(
                "{name}, head: force {:.3}, {:.3}, {:.3} against {force:.3?} mN, moment {:.4}, {:.4}, {:.4} against {moment:.4?} mN m",
                f.x, f.y, f.z, m.x, m.y, m.z
            );
            // Its lateral force is that of the flagella's, which the line model has too small.
            prove(
                &format!("{name}, head: thrust over the row's largest force"),
                (f.z - force[2]).abs() / largest_force,
                0.04,
            );
            println!(
                "{name}, head: lateral force off by {:.1} %",
                100.0 * (f.xy() - V3::from(force).xy()).amax() / largest_force
            );
            let tilting = (m - V3::from(moment)).amax() / largest_moment;
            prove(&format!("{name}, head: moment over the flagella's largest"), tilting, 0.01);
        }
        prove(&format!("{name}: reciprocity error"), found.reciprocity_error, 0.01);
    }
}

/// The swirl about a flagellum is that of its whole torque, and lines lack that of the couples about the rod. The stated error
/// is at least their share in the torque of the resolved helix, and not much more.
#[test]
fn stated_error_of_lines_is_the_couples_share_in_the_torque() {
    // `tests/data/surface/README.md`: the single published helix, and the same whose cross-sections do not turn, mN m.
    let (whole, without_spin) = (1.1705, 0.938);
    let share = 1.0 - without_spin / whole;
    let stated = ModelError::of_lines(&Robot::default()).tilt;
    prove("share of the couples in the torque of the resolved helix, over the stated one", share / stated, 1.0);
    prove("stated share of the couples, over that of the resolved helix", stated / share, 1.2);
    // The line model's own: its torque without couples, against the resolved torque.
    let mut robot = Robot::default();
    (robot.head.shape, robot.fluid.spin_drag) = (HeadShape::None, 0.0);
    let lines = loads(&resistance(&robot, &[0.0]).expect("parameters"), &[90.0]);
    let missed = 1.0 - lines[1][1].z.abs() * 1e3 / whole;
    prove("torque that lines lack, over the stated share", missed / stated, 1.0);
}

#[test]
fn resistance_is_reciprocal_and_dissipates() {
    for (phase, robot) in [([0.3, -1.2], Robot::default()), ([2.0, 0.0], Robot::published())] {
        let found = resistance(&robot, &phase).expect("parameters");
        assert_eq!(found.matrix.shape(), (18, 18));
        assert_eq!(found.matrix, found.matrix.transpose());
        let least = found.matrix.symmetric_eigenvalues().min();
        println!("least eigenvalue {least:e}");
        assert!(least > -1e-12, "every motion costs power, but for that of a base without drag: {least:e}");
        prove("reciprocity error of the robot", found.reciprocity_error, 0.01);
    }
}

#[test]
fn half_a_turn_of_the_robot_exchanges_its_flagella() {
    // Turned by 180 degrees about z, flagellum 1 is where flagellum 2 was, and 2 where 1 was.
    let here = resistance(&Robot::default(), &[0.4, 1.1]).expect("parameters").matrix;
    let there = resistance(&Robot::default(), &[1.1 + PI, 0.4 + PI]).expect("parameters").matrix;
    let place = |row: usize| [row, row + 6, row - row.min(6)][row / 6];
    let sign = |row: usize| if row % 3 == 2 { 1.0 } else { -1.0 };
    let mut worst = 0f64;
    for row in 0..18 {
        for column in 0..18 {
            let scale = (here[(row, row)] * here[(column, column)]).sqrt();
            let turned = sign(row) * sign(column) * there[(place(row), place(column))];
            worst = worst.max((here[(row, column)] - turned).abs() / scale);
        }
    }
    prove("robot turned by half a turn: resistance, relative", worst, 1e-9);
}
