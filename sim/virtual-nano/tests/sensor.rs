//! What the real program makes of a sensor with errors: turns by hand, gravity in the gyroscope, and noise.

use crate::common::{Host, yaw_deg};
use protocol::units::SensorCounts;
use virtual_nano::BoardOptions;
use virtual_nano::imu::errors::Errors;
use virtual_nano::imu::hand::{Grip, Pose};
use virtual_nano::imu::source::Source;

/// Duration of a tick by the board's own clock, s.
const TICK_S: f64 = 1.0 / protocol::TICK_HZ as f64;

/// A board whose sensor lies in a hand that errs in nothing.
fn in_hand(errors: Errors) -> Host {
    let source = Source::hand(Grip::EXACT, errors, 3);
    let mut host = Host::ready(BoardOptions { source, ..BoardOptions::default() });
    host.run_linked_ms(500);
    host
}

/// Runs for some seconds. Returns the readings of the gyroscope, °/s, a row a tick.
fn readings(host: &mut Host, seconds: u64) -> Vec<[f64; 3]> {
    host.telemetry.clear();
    host.run_linked_ms(1000 * seconds);
    host.telemetry.iter().map(|(_, frame)| frame.gyro.map(|SensorCounts(counts)| f64::from(counts) / 131.0)).collect()
}

fn sum_deg(readings: &[[f64; 3]], axis: usize) -> f64 {
    readings.iter().map(|rates| rates[axis] * TICK_S).sum()
}

/// Returns the angle about the vertical, °, added up over all frames.
fn turned_deg(host: &Host) -> f64 {
    let yaws: Vec<f64> = host.telemetry.iter().map(|(_, frame)| yaw_deg(frame)).collect();
    yaws.windows(2).map(|pair| (pair[1] - pair[0] + 540.0).rem_euclid(360.0) - 180.0).sum()
}

#[test]
fn a_turn_by_hand_is_its_angle_times_scale_and_clock() {
    for (scale_z, clock, angle_deg) in [(0.0175, 0.0, 720.0), (-0.03, 0.004, 720.0), (0.0123, -0.005, -361.5)] {
        let gyro_scale = [0.021, -0.013, scale_z];
        let mut host = in_hand(Errors { gyro_scale, board_clock_error: clock, ..Errors::white() });
        let begin_s = host.board.seconds() + 0.2;
        let z = nalgebra::Vector3::z_axis();
        host.board.change_imu(|imu| imu.source.hand_mut().unwrap().turn(begin_s, z, angle_deg, 10.3));
        let sum = sum_deg(&readings(&mut host, 11), 2);
        let yaw = turned_deg(&host);
        let expected = angle_deg * (1.0 + scale_z) * (1.0 + clock);
        println!("scale {scale_z}, clock {clock}: readings {sum:.3}, attitude {yaw:.3}, expected {expected:.3} deg");
        assert!((sum - expected).abs() < 0.1, "{sum} of {expected}");
        assert!((yaw - expected).abs() < 0.15, "{yaw} of {expected}");
    }
}

#[test]
fn posed_on_its_side_the_gyroscope_reads_gravity() {
    let errors = Errors {
        gyro_g_dps: [[0.1, 0.0, -0.05], [-0.08, 0.0, 0.0], [0.0, 0.0, 0.06]],
        accel_scale: [-0.02, 0.0, 0.0],
        ..Errors::white()
    };
    let mut host = in_hand(errors);
    let mean = |rows: &[[f64; 3]]| [0, 1, 2].map(|i| rows.iter().map(|row| row[i]).sum::<f64>() / rows.len() as f64);
    let upright = mean(&readings(&mut host, 6));
    let now_s = host.board.seconds();
    let pose: Pose = "+x".parse().unwrap();
    host.board.change_imu(|imu| imu.source.hand_mut().unwrap().pose(now_s, pose, 1.2));
    host.run_linked_ms(1500);
    let side = mean(&readings(&mut host, 6));
    println!("z up {upright:.4?}, x up {side:.4?} deg/s");
    for (read, expected) in upright.iter().zip([-0.05, 0.0, 0.06]).chain(side.iter().zip([0.1, -0.08, 0.0])) {
        assert!((read - expected).abs() < 0.008, "{read}, not {expected}");
    }
    let force = host.last().accel.map(|SensorCounts(counts)| f64::from(counts) / 16384.0);
    assert!((force[0] - 0.98).abs() < 0.02 && force[2].abs() < 0.02, "{force:?}");
}

/// The walk of the integrated rate as the real program samples it, with a sensor and a board whose clocks differ.
#[test]
fn the_program_reads_noise_of_the_data_sheets_density() {
    const SECONDS: u64 = 60;
    let errors = Errors { sample_clock_error: 0.007, board_clock_error: -0.004, ..Errors::white() };
    let rows = readings(&mut in_hand(errors), SECONDS);
    let squares: f64 = rows.chunks_exact(100).flat_map(|part| (0..3).map(|i| sum_deg(part, i).powi(2))).sum();
    // One-sided density / √2 is the walk in a root of a second; each sum is over half a second.
    let density = (2.0 * squares / (3.0 * SECONDS as f64)).sqrt();
    println!("{density:.5} deg/s/sqrt(Hz)");
    assert!((density / 0.005 - 1.0).abs() < 0.12, "{density}");
}
