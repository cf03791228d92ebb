//! After a run with opposite speeds the yaw is back within seconds, and the tilt returns slowly: it takes the yaw along.

use sim::body::closure::Closure;
use sim::params::{Precision, Robot};
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Trial};

const RUN_S: f64 = 60.0;
const STEP_S: f64 = 2.0;

/// Returns the rates of yaw and of pitch and roll together, °/s, in steps from 16 to 30 s after a run.
fn rates(rpm: [f64; 2]) -> Vec<[f64; 2]> {
    let still = [0.0; 2];
    let points = [(0.0, still), (0.5, rpm), (RUN_S, rpm), (RUN_S + 0.5, still), (RUN_S + 30.0, still)];
    let profile = SpeedProfile::from_points(&points).unwrap();
    let options = Options { rate_hz: 1.0 / STEP_S, shapes: false };
    let mut robot = Robot::default();
    // The noise of single precision is as large as the slowest of these rates.
    robot.solver.far_field = Precision::Double;
    let samples = Trial::new(&robot, Closure::Full, profile, options).unwrap().map(Result::unwrap);
    let angles: Vec<_> = samples.map(|s| [s.yaw_rad, s.pitch_rad, s.roll_rad].map(f64::to_degrees)).collect();
    let first = ((RUN_S + 16.0) / STEP_S) as usize;
    let rate = |pair: &[[f64; 3]]| [0, 1, 2].map(|k| (pair[1][k] - pair[0][k]) / STEP_S);
    angles[first..].windows(2).map(rate).map(|[yaw, pitch, roll]| [yaw, pitch.hypot(roll)]).collect()
}

#[test]
fn yaw_follows_the_returning_tilt_by_some_hundredths() {
    let mut largest: f64 = 0.0;
    for rpm in [[-90.0, 90.0], [-77.3, 81.9]] {
        let shares: Vec<f64> = rates(rpm).iter().map(|[yaw, tilt]| yaw / tilt).collect();
        println!("{rpm:?} rpm: {shares:.3?}");
        largest = shares.iter().fold(largest, |largest, share| largest.max(share.abs()));
    }
    assert!((0.01..0.06).contains(&largest), "{largest}");
}
