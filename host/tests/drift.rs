//! Residual drift of the yaw of a real MPU6050 at rest for 655 s, and coverage of the stated uncertainty.

use host::attitude::{Columns, Drift, Reading, Rest, Series};
use host::sensor::Sensor;
use host::statistics::student_95;
use std::path::Path;

/// Duration of the calibration, whose noise does not reach the yaw of an upright robot, s.
const CALIBRATE_S: f64 = 5.0;
const PREROLL_S: f64 = 20.0;
const RUN_S: f64 = 120.0;
const DECAY_S: f64 = 30.0;

/// Counts per °/s in the range of the recording.
const COUNTS_PER_DPS: f64 = 131.0;

/// Yaw, integrated from the recorded rates by the trapezium rule, and the sensor's temperature.
struct Recorded {
    yaw: Columns<1>,
    temperature_c: Vec<f64>,
}

fn recorded() -> Recorded {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/mpu6050/still-655s.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text.lines().skip_while(|line| !line.starts_with("t_s")).skip(1).map(|line| {
        let mut fields = line.split(',').map(|field| field.parse::<f64>().unwrap());
        let mut next = |skipped: usize| fields.nth(skipped).unwrap();
        (next(0), next(5) / COUNTS_PER_DPS, next(0))
    });
    let mut recorded = Recorded { yaw: Columns::default(), temperature_c: Vec::new() };
    let mut last: Option<(f64, f64, f64)> = None;
    for (time, rate, temperature_c) in rows {
        let angle = last.map_or(0.0, |(t, r, angle)| angle + 0.5 * (r + rate) * (time - t));
        recorded.yaw.push(time, [angle]);
        recorded.temperature_c.push(temperature_c);
        last = Some((time, rate, angle));
    }
    assert_eq!(recorded.yaw.len(), recorded.temperature_c.len());
    recorded
}

struct Figures {
    rms_deg: f64,
    largest_deg: f64,
    coverage: f64,
    mean_uncertainty_deg: f64,
    with_end: f64,
}

/// Evaluates windows over the whole recording, `step_s` apart, with `motion` added after the run. The true yaw is 0.
fn over_windows(Recorded { yaw, temperature_c }: &Recorded, step_s: f64, motion: impl Fn(f64) -> f64) -> Figures {
    let yaw = yaw.track(0);
    let span = yaw.span();
    let (mut squares, mut largest, mut covered, mut stated, mut ends, mut windows) = (0.0, 0.0f64, 0, 0.0, 0, 0);
    let mut start = span.start;
    while start + PREROLL_S + RUN_S + DECAY_S <= span.end {
        let (run, stop) = (start + PREROLL_S, start + PREROLL_S + RUN_S);
        let end = stop + DECAY_S;
        let mut trial = Series::default();
        for (i, time) in yaw.time_s.iter().enumerate().filter(|(_, time)| (start..=end).contains(*time)) {
            let yaw_deg = yaw.value[i] + if *time > stop { motion(time - stop) } else { 0.0 };
            let half = 0.5 * yaw_deg.to_radians();
            let attitude = [half.cos(), 0.0, 0.0, half.sin()];
            trial.push(*time, &Reading { attitude, temperature_c: temperature_c[i], ..Reading::default() });
        }
        let rest = Rest {
            before: start..run,
            after: stop..end,
            calibrate_s: CALIBRATE_S,
            filter_s: 1.0,
            bias_noise: Sensor::of_data_sheet().bias_noise,
            angle_walk: None,
            time_constant_s: None,
        };
        let drift = Drift::estimate(&trial, &rest, run).unwrap();
        let error = yaw.at(stop).unwrap() - yaw.at(run).unwrap() - drift.at(stop);
        let variance = drift.variance(stop).unwrap() + drift.noise_variance(stop);
        let uncertainty = student_95(drift.degrees_of_freedom) * variance.sqrt();
        squares += error * error;
        largest = largest.max(error.abs());
        covered += i32::from(error.abs() <= uncertainty);
        stated += uncertainty;
        ends += i32::from(drift.still.len() == 2);
        windows += 1;
        start += step_s;
    }
    let count = f64::from(windows);
    Figures {
        rms_deg: (squares / count).sqrt(),
        largest_deg: largest,
        coverage: f64::from(covered) / count,
        mean_uncertainty_deg: stated / count,
        with_end: f64::from(ends) / count,
    }
}

fn print(name: &str, figures: &Figures) {
    let Figures { rms_deg, largest_deg, coverage, mean_uncertainty_deg, with_end } = figures;
    println!(
        "{name}: drift {rms_deg:.3} deg RMS, {largest_deg:.2} at most; uncertainty {mean_uncertainty_deg:.2} deg (95 %) \
         covers {:.1} % of the windows; still after the run in {:.0} %",
        coverage * 100.0,
        with_end * 100.0
    );
}

#[test]
fn drift_of_a_sensor_at_rest_is_within_the_stated_uncertainty() {
    let figures = over_windows(&recorded(), 1.0, |_| 0.0);
    print("at rest", &figures);
    assert!(figures.rms_deg <= 0.4);
    assert!(figures.coverage >= 0.95);
    // The uncertainty must not be much too large either.
    assert!(figures.mean_uncertainty_deg < 3.0 * figures.rms_deg);
}

#[test]
fn return_to_rest_does_not_disturb_yaw_and_uncertainty() {
    let recorded = recorded();
    // A return in 15 s leaves open whether the robot still moved before the run, with the same time constant; and of the
    // still phase before it, the seconds in which the filter settles after a calibration are not used.
    for (name, time_constant_s, turns_deg, rms_deg) in [
        ("swings back in 1 s", 1.0, 180.0, 0.5),
        ("in 3 s", 3.0, 60.0, 0.5),
        ("in 6 s", 6.0, 60.0, 0.5),
        ("in 15 s", 15.0, 60.0, 0.9),
    ] {
        let figures = over_windows(&recorded, 3.0, |t| turns_deg * ((-t / time_constant_s).exp() - 1.0));
        print(name, &figures);
        assert!(figures.coverage >= 0.95, "{name}");
        assert!(figures.rms_deg <= rms_deg, "{name}");
    }
}
