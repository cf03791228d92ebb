//! Drift of the yaw over five and a half minutes of data from a real sensor at rest, through the real firmware, and coverage of
//! the stated uncertainty. `host/tests/drift.rs` has all eleven minutes, without the firmware.

use host::attitude::{Drift, Rest, Series};
use host::sensor::Sensor;
use host::statistics::student_95;
use host::trial::{Judged, Want};
use std::path::Path;
use tests::{Bench, data};

const RUN_S: f64 = 330.0;

/// Returns the attitude during the run as sent by the board.
fn attitude(log: &Path) -> Series {
    let data = Judged::read(log, Want::default()).unwrap().data;
    let start = data.times.run.start;
    let mut series = Series::default();
    for (time_s, reading) in data.readings.iter().filter(|(time_s, _)| *time_s >= start) {
        series.push(time_s - start, reading);
    }
    series
}

#[test]
#[ignore = "a minute of the emulated board: part of `make proof`"]
fn yaw_of_a_sensor_at_rest_stays_within_its_stated_uncertainty() {
    let bench = Bench::new();
    let plan = bench.file(
        "plan.toml",
        &format!(
            "[session]\nname = \"at rest\"\n[trial]\ncalibrate = 5\npreroll = 0\nrun = {RUN_S}\ndecay = 0\n\
             [speeds]\npairs = [[0, 0]]\n[board]\naccel_range_g = 8\naccel_axes = [\"x\", \"y\", \"-z\"]\n"
        ),
    );
    let imu = format!("--virtual={}", data("mpu6050/still-655s.csv").display());
    let run = bench.run(["record", plan.to_str().unwrap(), &imu, "--out", "session", "--json"]).expect_code(0);
    let trial = &run.json()["trials"][0];
    assert_eq!(trial["lost"], 0);
    let series = attitude(&bench.path().join(trial["log"].as_str().unwrap()));
    let yaw = series.yaw();
    let on_board = (yaw.at(RUN_S - 1.0).unwrap() - yaw.at(0.0).unwrap()) / (RUN_S - 1.0) * 60.0;

    let sensor = Sensor::of_data_sheet();
    let (mut square, mut plain_square, mut covered, mut windows) = (0.0, 0.0, 0, 0);
    let mut from = 20.0;
    while from + 150.0 < RUN_S {
        let to = from + 120.0;
        let rest = Rest {
            before: from - 20.0..from,
            after: to..to + 30.0,
            calibrate_s: 5.0,
            filter_s: 1.0,
            bias_noise: sensor.bias_noise,
            angle_walk: None,
            time_constant_s: None,
        };
        let drift = Drift::estimate(&series, &rest, from).unwrap();
        let moved = yaw.at(to).unwrap() - yaw.at(from).unwrap();
        let error: f64 = moved - drift.at(to);
        let plain = moved - 120.0 * yaw.rate(from - 20.0..from).unwrap();
        square += error * error;
        plain_square += plain * plain;
        let variance = drift.variance(to).unwrap() + drift.noise_variance(to);
        covered += u32::from(error.abs() <= student_95(drift.degrees_of_freedom) * variance.sqrt());
        windows += 1;
        from += 1.0;
    }
    let rms = (square / f64::from(windows)).sqrt();
    let share = f64::from(covered) / f64::from(windows);
    println!("on-board yaw drift {on_board:.2} deg/min over {RUN_S} s");
    println!("{windows} windows of 120 s: reported yaw drifts {rms:.2} deg RMS");
    println!("(with the first still phase alone {:.2})", (plain_square / f64::from(windows)).sqrt());
    println!("stated uncertainty covers {:.1} %", 100.0 * share);
    assert!(rms <= 0.4, "{rms} deg RMS");
    assert!(share >= 0.95, "{share}");
}
