//! Rates, accelerations, temperature and attitude of the real program at every range of the sensor, against a turntable
//! whose sensor has the scales of its data sheet.

use crate::common::Host;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use protocol::units::{AccelRange, GyroRange};
use protocol::{Command, GENUINE_IMU_ID, Settings, Telemetry};
use virtual_nano::BoardOptions;
use virtual_nano::imu::source::{Source, Turntable};

/// The vertical in the sensor's axes: every axis has its part.
const UP: [f64; 3] = [0.48, -0.60, 0.64];
/// From here on the table turns, s.
const START_S: f64 = 1.5;
/// Full scales of the gyroscope, °/s (data sheet PS-MPU-6000A-00, section 6.1).
const GYRO_DPS: [f64; 4] = [250.0, 500.0, 1000.0, 2000.0];

fn attitude(telemetry: &Telemetry) -> UnitQuaternion<f64> {
    let [w, x, y, z] = telemetry.attitude.to_f64();
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// A table that turns at `dps`, seen through a sensor at these ranges for `run_ms` after its start.
fn turned(dps: f64, gyro_range: GyroRange, accel_range: AccelRange, run_ms: u64) -> Vec<Telemetry> {
    let source = Source::turntable(Turntable { up: UP, dps, swing_hz: 0.0, start_s: START_S }, 7);
    let mut host = Host::ready(BoardOptions { source, ..BoardOptions::default() });
    host.order(Command::WriteSettings(Settings { gyro_range, accel_range, ..Settings::DEFAULT }));
    // Past the start and the delay of the filter.
    host.run_ms((START_S * 1e3) as u64 + 100 - host.board.cycle() / crate::common::MS);
    host.telemetry.clear();
    host.run_ms(run_ms);
    host.telemetry.into_iter().map(|(_, telemetry)| telemetry).collect()
}

/// What the telemetry says of a table: speed by rate and by attitude, °/s; acceleration, m/s²; error of the vertical, °.
struct Seen {
    rate_dps: f64,
    turned_dps: f64,
    accel_mps2: f64,
    tilt_deg: f64,
}

fn seen(frames: &[Telemetry], gyro_range: GyroRange, accel_range: AccelRange) -> Seen {
    let up = Vector3::from(UP);
    let mean =
        |of: &dyn Fn(&Telemetry) -> Vector3<f64>| frames.iter().map(of).sum::<Vector3<f64>>() / frames.len() as f64;
    let rate = mean(&|frame| Vector3::from(frame.gyro.map(|counts| gyro_range.rad_per_s(counts).to_degrees())));
    let accel = mean(&|frame| Vector3::from(frame.accel.map(|counts| accel_range.mps2(counts))));
    let (first, last) = (&frames[0], &frames[frames.len() - 1]);
    let turns = frames.windows(2).map(|pair| {
        let [before, after] = [0, 1].map(|i| attitude(&pair[i]));
        (after * before.inverse()).scaled_axis().z.to_degrees()
    });
    let seconds = f64::from(last.time.since(first.time)) * 1e-6;
    Seen {
        rate_dps: rate.dot(&up),
        turned_dps: turns.sum::<f64>() / seconds,
        accel_mps2: accel.dot(&up),
        tilt_deg: (attitude(last).inverse() * Vector3::z()).angle(&up).to_degrees(),
    }
}

#[test]
fn every_range_of_the_gyroscope_reads_the_turntable() {
    println!("range, table deg/s: rate, turned by attitude, tilt error deg");
    for (gyro_range, full_scale) in GyroRange::ALL.into_iter().zip(GYRO_DPS) {
        for share in [0.2, -0.9] {
            let dps = share * full_scale;
            let frames = turned(dps, gyro_range, AccelRange::G2, 2000);
            let Seen { rate_dps, turned_dps, tilt_deg, .. } = seen(&frames, gyro_range, AccelRange::G2);
            println!("{full_scale:6.0} {dps:7.1}: {rate_dps:8.2} {turned_dps:8.2} {tilt_deg:.2}");
            assert!(frames.len() >= 399);
            // Attitude: the filter's step is of second order, and a tick of the fastest turn has 9 degrees.
            assert!((rate_dps / dps - 1.0).abs() < 0.002, "{full_scale}: {rate_dps} of {dps} deg/s");
            let tolerance = if share < -0.5 { 0.003 } else { 0.001 };
            assert!((turned_dps / dps - 1.0).abs() < tolerance, "{full_scale}: turned at {turned_dps} of {dps} deg/s");
            assert!(tilt_deg < 1.0, "{full_scale}: tilted by {tilt_deg} deg");
        }
    }
}

#[test]
fn every_range_of_the_accelerometer_reads_gravity() {
    for accel_range in AccelRange::ALL {
        let frames = turned(100.0, GyroRange::Dps250, accel_range, 1000);
        let Seen { accel_mps2, tilt_deg, .. } = seen(&frames, GyroRange::Dps250, accel_range);
        println!("{accel_range:?}: {accel_mps2:.4} m/s2, tilt error {tilt_deg:.2} deg");
        assert!((accel_mps2 / 9.80665 - 1.0).abs() < 0.002, "{accel_range:?}: {accel_mps2} m/s2");
        assert!(tilt_deg < 1.0, "{accel_range:?}: tilted by {tilt_deg} deg");
        let celsius = frames[0].temperature.celsius(GENUINE_IMU_ID);
        assert!((celsius - 25.0).abs() < 0.1, "{celsius} degrees in a room of 25");
    }
}
