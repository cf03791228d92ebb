//! Imports of one motion in wrong frames. Two seconds of processor time.

use crate::import::{Conditions, Mapping, Table, write};
use crate::plan::RobotFile;
use crate::swing::tests::{RATE_HZ, Truth, quick};
use crate::trial::{Collector, Judged, Records, Want};
use crate::twin::{OnMismatch, compare};
use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Motor, Telemetry, Truth as Row};
use biflag_log::{End, Identity, ModelMeta, Origin, Summary, TrialMeta};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use protocol::units::CentiRpm;
use sim::body::attitude::{euler_zyx, of_euler_zyx};
use sim::params::Robot;
use std::ops::Range;

type Turn = UnitQuaternion<f64>;

const REST_S: f64 = 5.0;
const RUN_S: f64 = 36.0;

/// Returns the attitudes of a motion after a rest at a yaw, with their times.
fn attitudes(truth: &Truth, rest_deg: f64) -> Vec<(f64, Turn)> {
    let [yaw, pitch, roll] = &truth.angles_deg;
    let rest = (0..(REST_S * RATE_HZ) as usize).map(|_| [rest_deg, 0.0, 0.0]);
    let run = (0..(RUN_S * RATE_HZ) as usize).map(|i| [yaw[i] + rest_deg, pitch[i], roll[i]]);
    let all = rest.chain(run).enumerate();
    all.map(|(i, deg)| (i as f64 / RATE_HZ, of_euler_zyx(deg.map(f64::to_radians)))).collect()
}

/// Imports attitudes as quaternions.
fn import(rows: &[(f64, Turn)], rpm: [f64; 2], as_read: impl Fn(Turn) -> Quaternion<f64>) -> Judged {
    let row = |(time_s, q): &(f64, Turn)| {
        let q = as_read(*q);
        format!("{time_s},{},{},{},{}\n", q.w, q.i, q.j, q.k)
    };
    let table: String = rows.iter().map(row).collect();
    judged(&table, "time=#1,qw=#2,qx=#3,qy=#4,qz=#5", rpm, REST_S..REST_S + RUN_S - 0.1, &quick())
}

/// Imports a table.
pub(in crate::trial::findings) fn judged(
    table: &str,
    columns: &str,
    rpm: [f64; 2],
    run_s: Range<f64>,
    robot: &Robot,
) -> Judged {
    let folder = tempfile::tempdir().unwrap();
    let (csv, log) = (folder.path().join("a.csv"), folder.path().join("a.mcap"));
    std::fs::write(&csv, table).unwrap();
    let mapping: Mapping = columns.parse().unwrap();
    let states = Table::read(&csv, 0).unwrap().states(&mapping).unwrap();
    let conditions = Conditions {
        speeds: Some(rpm.map(CentiRpm::from_rpm)),
        run_s: Some(run_s),
        reverse: None,
        robot: RobotFile { name: "robot".to_owned(), text: toml::to_string(robot).unwrap() },
        uncertainty_deg: Some([0.5, 0.3]),
        temperature_c: None,
        note: String::new(),
    };
    write(&states, &conditions, "a.csv", &log).unwrap();
    Judged::read(&log, Want::default()).unwrap()
}

/// Returns the motion as a trial of the model.
fn model(truth: &Truth) -> Judged {
    let mut collector = Collector::new(Want::default(), 2);
    for (name, time_s) in [("preroll", 0.0), ("run", REST_S), ("end", REST_S + RUN_S)] {
        collector.event(time_s, Kind::Phase, name);
    }
    for (i, (time_s, _)) in attitudes(truth, 0.0).iter().enumerate() {
        let run = i.checked_sub((REST_S * RATE_HZ) as usize);
        let [yaw_deg, pitch_deg, roll_deg] = [0, 1, 2].map(|k| run.map_or(0.0, |i| truth.angles_deg[k][i]));
        collector.truth(&Row { time_s: *time_s, yaw_deg, pitch_deg, roll_deg, ..Row::default() });
        let motor = |k: usize| {
            let turns = truth.rpm[k] / 60.0 * (time_s - REST_S).max(0.0);
            Some(Motor { target_rpm: truth.rpm[k], speed_rpm: truth.rpm[k], turns, ..Motor::default() })
        };
        collector.telemetry(&Telemetry { time_s: *time_s, motor1: motor(0), motor2: motor(1), ..Telemetry::default() });
    }
    let [w1_rpm, w2_rpm] = truth.rpm;
    let records = Records {
        identity: Some(Identity { format: 2, origin: Origin::Model, ..Identity::default() }),
        trial: Some(TrialMeta { w1_rpm, w2_rpm, preroll_s: REST_S, run_s: RUN_S, ..TrialMeta::default() }),
        model: Some(ModelMeta {
            rate_hz: RATE_HZ,
            parameters: toml::to_string(&quick()).unwrap(),
            ..ModelMeta::default()
        }),
        summary: Some(Summary { end: End::Complete, ..Summary::default() }),
        ..Records::default()
    };
    Judged::of(collector.finish("model".as_ref(), records))
}

/// Returns the rotations of a cube.
fn cube() -> Vec<Turn> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let axes: Vec<Vector3<f64>> = axes.into_iter().flat_map(|axis| [axis, -axis]).collect();
    let pairs = axes.iter().flat_map(|x| axes.iter().map(move |y| (*x, *y)));
    let turns = pairs.filter(|(x, y)| x.dot(y) == 0.0);
    turns.map(|(x, y)| Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)])).into()).collect()
}

/// Returns the name of the vertical axis in a frame with this direction of up.
fn name(up: Vector3<f64>) -> String {
    let axis = ["x", "y", "z"][up.iamax()];
    format!("{axis} axis WHOSE points {}", if up.sum() > 0.0 { "up" } else { "down" })
}

#[test]
fn no_wrong_frame_is_silent_that_changes_a_result() {
    let rpm = [37.3, 14.9];
    let truth = Truth::of(&quick(), rpm, RUN_S + 1.0, RUN_S + 1.0);
    let (model, rows) = (model(&truth), attitudes(&truth, 23.0));
    let check_of = |expected: &str, rows: &[(f64, Turn)], as_read: &dyn Fn(Turn) -> Quaternion<f64>| {
        let trial = import(rows, rpm, as_read);
        let found = trial.findings.iter().filter(|finding| !finding.text.starts_with("not settled"));
        let found: Vec<&str> = found.map(|finding| &finding.text[..]).collect();
        match expected {
            "" => assert!(found.is_empty(), "{found:?}"),
            name => {
                if name.contains("quarter") {
                    let compared = compare(&trial, &model, OnMismatch::Accept).unwrap().comparison.warnings;
                    assert!(compared.iter().any(|text| text.contains(name)), "{name}: {compared:?}");
                }
                assert!(found.iter().any(|text| text.contains(name)), "{name}: {found:?}");
                // Near a pitch of 90 degrees the angles of a body jump.
                let are_all = found.iter().all(|text| text.contains(name));
                assert!(are_all || found.iter().any(|text| text.contains("jumps")), "{name}: {found:?}");
            }
        }
    };
    let check = |expected: &str, as_read: &dyn Fn(Turn) -> Quaternion<f64>| check_of(expected, &rows, as_read);
    for turn in cube() {
        let (up, angle_deg) = (turn * Vector3::z(), turn.angle().to_degrees().round());
        let both = match (up.iamax(), up.sum() > 0.0, angle_deg as u32) {
            (2, true, 0) => String::new(),
            (2, true, 90) => "turned by a quarter about the vertical".to_owned(),
            (2, true, _) => "turned by a half about the vertical".to_owned(),
            (2, false, _) => "its z axis points down".to_owned(),
            _ => name(up).replace("WHOSE", "of both frames"),
        };
        check(&both, &|q| (turn * q * turn.inverse()).into_inner());
        // One turn for each axis.
        if angle_deg == 90.0 && up.z.abs() < 0.5 {
            check(&name(up).replace("WHOSE", "of the instrument's frame"), &|q| (turn * q).into_inner());
            check(&name(up).replace("WHOSE", "of the body's frame"), &|q| (q * turn.inverse()).into_inner());
        }
    }
    check("scalar last", &|q| Quaternion::new(q.i, q.j, q.k, q.w));
    check("scalar first", &|q| Quaternion::new(q.k, q.w, q.i, q.j));
    check("clockwise", &|q| {
        let [yaw, pitch, roll] = euler_zyx(&q);
        of_euler_zyx([-yaw, pitch, roll]).into_inner()
    });
    // If the yaw is small, only its sign shows the inverse.
    let turned = attitudes(&truth, 140.0);
    for rows in [&rows, &turned] {
        check_of("turns the world's axes into the body's", rows, &|q| q.inverse().into_inner());
    }
    check_of("turns in another order", &turned, &|q| {
        let m = q.to_rotation_matrix();
        let (yaw, pitch, roll) = ((-m[(0, 1)]).atan2(m[(0, 0)]), m[(0, 2)].asin(), (-m[(1, 2)]).atan2(m[(2, 2)]));
        of_euler_zyx([yaw, pitch, roll]).into_inner()
    });
    for (angle, scaled) in ["yaw swings 2.0", "pitch swings 0.5"].into_iter().zip([[2.0, 1.0, 1.0], [1.0, 0.5, 1.0]]) {
        check(angle, &|q| {
            let [yaw, pitch, roll] = euler_zyx(&q);
            of_euler_zyx([scaled[0] * yaw, scaled[1] * pitch, scaled[2] * roll]).into_inner()
        });
    }
    let spoilt = |of: &dyn Fn(f64, Turn) -> Turn| rows.iter().map(|(t, q)| (*t, of(*t, *q))).collect::<Vec<_>>();
    let about = |axis: Vector3<f64>, deg: f64| Turn::from_scaled_axis(axis * deg.to_radians());
    let flipping = spoilt(&|t, q| if t % 4.0 < 0.7 { about(Vector3::x(), 4.0) * q } else { q });
    check_of("the attitude jumps by 4", &flipping, &|q| q.into_inner());
}
