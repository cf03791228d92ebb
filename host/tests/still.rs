//! When a robot counts as still: the readings of a real MPU6050 that lies still for 655 s, with motions added to them.

use host::attitude::{STILL_TILT_DPS, STILL_YAW_DPS, Still};
use std::path::Path;

/// Counts per °/s and per g in the ranges of the recording.
const COUNTS_PER_DPS: f64 = 131.0;
const COUNTS_PER_G: f64 = 4096.0;

/// Interval at which `record` judges, s.
const CHECK_S: f64 = 0.5;

/// Time, rates, °/s, and forces, g, upright.
type Row = (f64, [f64; 3], [f64; 3]);

fn recorded() -> Vec<Row> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/mpu6050/still-655s.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let lines = text.lines().skip_while(|line| !line.starts_with("t_s")).skip(1);
    lines
        .map(|line| {
            let fields: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
            let [time_s, ax, ay, az, gx, gy, gz, ..] = fields[..] else { panic!("{line}") };
            (time_s, [gx, gy, gz].map(|g| g / COUNTS_PER_DPS), [ax, ay, -az].map(|a| a / COUNTS_PER_G))
        })
        .collect()
}

/// Returns after how many seconds from `start_s` on a robot counts as still whose gyroscope's z axis reads as the recording's
/// axis `axis`, and which moves by `yaw_dps` and `tilt_deg` more; `None` if the recording ends before.
fn still_after(
    rows: &[Row],
    start_s: f64,
    axis: usize,
    yaw_dps: impl Fn(f64) -> f64,
    tilt_deg: impl Fn(f64) -> f64,
) -> Option<f64> {
    let mut still = Still::default();
    let mut check_s = CHECK_S;
    for (time_s, rates, [x, y, z]) in &rows[rows.partition_point(|(time, ..)| *time < start_s)..] {
        let time = time_s - start_s;
        let (sine, cosine) = tilt_deg(time).to_radians().sin_cos();
        still.push(*time_s, rates[axis] + yaw_dps(time), [x * cosine + z * sine, *y, z * cosine - x * sine]);
        if time >= check_s {
            check_s += CHECK_S;
            if still.motion().is_some_and(|motion| motion.is_still()) {
                return Some(time);
            }
        }
    }
    None
}

#[test]
fn a_real_sensor_at_rest_is_still_within_fifty_seconds() {
    let rows = recorded();
    for axis in 0..3 {
        let mut after: Vec<f64> = (0..80)
            .map(|i| still_after(&rows, 7.3 * f64::from(i), axis, |_| 0.0, |_| 0.0).expect("it is still"))
            .collect();
        after.sort_by(f64::total_cmp);
        println!("axis {axis}: after {:.1} s, {:.1} s, {:.1} s at most", after[0], after[40], after[79]);
        assert!(after[79] < 50.0, "{after:?}");
    }
}

/// Returns to rest that nobody tuned for, with a bias of 20 °/s that drifts.
#[test]
fn a_robot_that_moves_is_not_still() {
    let rows = recorded();
    let (mut calls, mut early) = (0, Vec::new());
    for (time_constant_s, drift) in
        [(5.3, 4e-4), (7.9, -3e-4), (11.7, 0.0), (19.3, 2e-4), (31.7, -4e-4), (45.1, 0.0), (59.3, 3e-4)]
    {
        let mut late: Vec<f64> = Vec::new();
        for (i, start_dps) in [0.31, -0.83, 2.7, -14.3].into_iter().enumerate() {
            for (k, start_s) in [3.7, 61.9, 133.1, 199.7].into_iter().enumerate() {
                let axis = (i + k) % 3;
                let yaw_dps = |t: f64| start_dps * (-t / time_constant_s).exp();
                let biased = |t: f64| yaw_dps(t) + 20.0 + drift * t;
                let Some(after) = still_after(&rows, start_s, axis, biased, |_| 0.0) else { continue };
                calls += 1;
                let reached = time_constant_s * (start_dps / STILL_YAW_DPS).abs().ln();
                late.push(after - reached);
                if yaw_dps(after).abs() > STILL_YAW_DPS {
                    early.push((time_constant_s, start_dps, start_s, yaw_dps(after)));
                }
            }
        }
        late.sort_by(f64::total_cmp);
        let (first, middle, last) = (late[0], late[late.len() / 2], late[late.len() - 1]);
        println!("yaw, {time_constant_s} s: {first:.1}, {middle:.1}, {last:.1} s at most after it was at the limit");
    }
    println!("{} of {calls} early: {early:.3?}", early.len());
    let far = early.iter().filter(|(.., dps)| dps.abs() > 1.1 * STILL_YAW_DPS).count();
    assert!(far * 20 <= calls, "{early:?}");
    assert!(early.iter().all(|(.., dps)| dps.abs() < 2.0 * STILL_YAW_DPS), "{early:?}");
}

#[test]
fn a_robot_that_rights_itself_is_not_still() {
    let rows = recorded();
    for time_constant_s in [4.3, 9.7, 13.9, 27.1] {
        for (i, start_deg) in [0.9, -4.7, 23.1].into_iter().enumerate() {
            let tilt_deg = |t: f64| start_deg * (-t / time_constant_s).exp();
            let after = still_after(&rows, 17.9 * i as f64, i, |_| 0.0, tilt_deg).expect("it comes to rest");
            let dps = tilt_deg(after).abs() / time_constant_s;
            println!("tilt, {time_constant_s} s: still after {after:.1} s, at {dps:.4} °/s");
            assert!(dps < 1.1 * STILL_TILT_DPS, "{time_constant_s} s, {start_deg} deg: {dps} at {after} s");
        }
    }
}
