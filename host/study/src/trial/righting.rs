//! The righting of a robot: the error of the zero due to a tilt that is still returning to rest exponentially, with the robot's
//! time constant; and the largest tilt of a run.

use super::data::Data;
use crate::swing::PerRpm;
use biflag_log::RestMeta;
use sim::functions::{asin, exp};
use sim::params::Robot;
use sim::return_to_rest::TimeConstants;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Longest time constant, s: with longer ones, a tilt hardly changes over a rest of a minute.
const LONGEST_S: f64 = 600.0;

/// Returns the time constant with which the tilt of a robot returns to rest, s.
pub(super) fn righting_s(constants: Option<TimeConstants>) -> f64 {
    constants.map_or(LONGEST_S, |constants| constants.tilt_s.min(LONGEST_S))
}

/// Returns the standard deviation of the tilt that may remain in the mean over `zero` after the recorder's wait for a still
/// robot, degrees; 0 without a wait, or if it was too brief for a bound.
pub(super) fn left_deg(wait: Option<&RestMeta>, righting_s: f64, zero: &Range<f64>) -> f64 {
    let Some((waited_s, tilt_dps)) = wait.and_then(|wait| Some((wait.waited_s, wait.tilt_dps?))) else { return 0.0 };
    let passed_s = (0.5 * (zero.start + zero.end) - waited_s).max(0.0);
    // The bound is two standard deviations.
    0.5 * tilt_dps * righting_s * exp(-passed_s / righting_s)
}

/// Returns the time constants of the robot in the log, or of the robot `physical` if the log has no valid one.
pub(super) fn time_constants(data: &Data) -> Option<TimeConstants> {
    let of = |robot: &Robot| righting(robot).0;
    data.robot().ok().and_then(|robot| of(&robot)).or_else(|| of(&Robot::default()))
}

/// Speed of the fastest motors, rpm.
const FASTEST_RPM: f64 = 90.0;

/// Factor on the tilt by rigid flagella: flagella bend, and the fluid may be colder than in the robot's file. The built-in robots
/// tilt by up to 1.35 times as much, at (-90, 90) rpm.
const MORE: f64 = 2.5;

/// Tilt above which the yaw of any robot is meaningless, degrees.
const LARGEST_DEG: f64 = 80.0;

/// Returns the largest tilt of a robot, degrees, at which the righting moment of its weight balances the moment of both thrusts
/// at the fastest speed on the levers of their shafts ([`PerRpm`]); `None` if its file is invalid.
pub(super) fn largest_tilt_deg(robot: &Robot) -> Option<f64> {
    let sine = MORE * FASTEST_RPM * righting(robot).1?.tilt_deg.map(|deg| deg.to_radians().abs()).iter().sum::<f64>();
    Some(asin(sine.min(1.0)).to_degrees().min(LARGEST_DEG))
}

/// Returns the steady yaw and tilt of a robot per rpm of each motor with rigid flagella; `None` if its file is invalid.
pub(super) fn per_rpm(robot: &Robot) -> Option<PerRpm> {
    righting(robot).1
}

/// The time constants of a robot, and its steady attitude per rpm.
type Righting = (Option<TimeConstants>, Option<PerRpm>);

fn righting(robot: &Robot) -> Righting {
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    match &*last {
        Some((known, righting)) if known == robot => *righting,
        _ => last.insert((robot.clone(), (TimeConstants::of(robot).ok(), PerRpm::of(robot)))).1,
    }
}

/// The last robot and its righting: the trials of a session have one robot.
static LAST: Mutex<Option<(Robot, Righting)>> = Mutex::new(None);

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest tilts of the published map: 20.5 and 18.8 degrees at (-90, 90) rpm.
    #[test]
    fn largest_tilt_is_beyond_that_of_the_published_map() {
        let [physical, published] =
            [Robot::default(), Robot::published()].map(|robot| largest_tilt_deg(&robot).unwrap());
        assert!((40.0..46.0).contains(&physical) && (34.0..40.0).contains(&published), "{physical} {published}");
        let mut loose = Robot::default();
        loose.base.mass_centre_below_joint_m = 0.0;
        assert_eq!(largest_tilt_deg(&loose), Some(LARGEST_DEG));
    }

    #[test]
    fn slow_robot_has_more_left_after_its_wait() {
        let wait = RestMeta { waited_s: 10.0, tilt_dps: Some(0.01), ..RestMeta::default() };
        let left = |righting_s: f64| left_deg(Some(&wait), righting_s, &(25.0..35.0));
        assert!((left(12.0) - 0.06 * (-20.0f64 / 12.0).exp()).abs() < 1e-12);
        assert!((left(45.0) - 0.225 * (-20.0f64 / 45.0).exp()).abs() < 1e-12);
    }
}
