//! Checks whether the robot of an imported trial was still before its run.

use super::rest::START_S;
use crate::attitude::{Motion, Track};
use crate::statistics::Line;
use sim::functions::hypot;
use std::ops::Range;

/// Time before the run in which the robot must be still, and the shortest rest that can be judged, s.
pub(super) const REST_S: f64 = 5.0;
const LEAST_REST_S: f64 = 2.0;

/// Returns the motion in the rest before the run, if yaw, pitch or roll still changed beyond what their scatter explains.
pub(super) fn moved(angles: [Track; 3], rest: &Range<f64>) -> Option<Motion> {
    let last = rest.start.max(rest.end - REST_S)..rest.end;
    if last.end - last.start < LEAST_REST_S {
        return None;
    }
    let [yaw_dps, pitch_dps, roll_dps] = angles.map(|angle| certain_rate(angle, &last).max(certain_step(angle, &last)));
    let motion = Motion { yaw_dps, tilt_dps: hypot(pitch_dps, roll_dps) };
    (motion.relative() > 1.0).then_some(motion)
}

/// Returns the smallest rate at which the mean of the last second, which is the zero, has left the mean of the rest before. It
/// shows a run that began earlier than said, which hardly raises the slope of the whole. Twice the scatter of the readings also
/// covers noise that lasts for a second.
fn certain_step(angle: Track, over: &Range<f64>) -> f64 {
    let middle = over.end - START_S;
    let [before, after] = [over.start..middle, middle..over.end].map(|part| line(angle, &part));
    let change = (after.level - before.level).abs() - 2.0 * (before.squares / before.count).sqrt();
    (change / (after.middle - before.middle)).max(0.0)
}

/// Returns the smallest rate of change compatible with the readings: their slope minus four standard errors. Noise alone hardly
/// ever makes it positive.
fn certain_rate(angle: Track, over: &Range<f64>) -> f64 {
    let line = line(angle, over);
    let variance = line.squares / (line.count - 2.0) / line.spread;
    // Of fewer than three readings it is not a number, and then neither is the difference: `max` returns 0.
    (line.slope.abs() - 4.0 * variance.sqrt()).max(0.0)
}

/// Returns the straight line through the readings of an angle.
pub(super) fn line(angle: Track, over: &Range<f64>) -> Line {
    Line::through(
        angle
            .time_s
            .iter()
            .zip(angle.value)
            .map(|(time, value)| (*time, *value))
            .filter(|(time, _)| over.contains(time)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::Columns;

    /// Returns angles over 6 s at 10 Hz. The first changes at a rate, with an alternating scatter of 0.1 degrees.
    fn angles(rate_dps: f64) -> Columns<3> {
        let mut angles = Columns::default();
        for i in 0..60 {
            let time_s = 0.1 * f64::from(i);
            angles.push(time_s, [rate_dps * time_s + if i % 2 == 0 { 0.1 } else { -0.1 }, 1.0, 2.0]);
        }
        angles
    }

    #[test]
    fn a_run_that_began_earlier_than_said_is_found() {
        // The yaw leaves its rest by up to 8 degrees in the last 0.2 to 0.5 s.
        let moved = |late_s: f64| {
            let mut angles = angles(0.0);
            for (time_s, yaw) in angles.time_s.iter().zip(&mut angles.values[0]) {
                *yaw += 16.0 * (time_s - (6.0 - late_s)).max(0.0);
            }
            moved(angles.tracks(), &(0.0..6.0)).map(|motion| motion.relative() > 4.0)
        };
        assert_eq!([0.0, 0.2, 0.5].map(moved), [None, None, Some(true)]);
    }

    #[test]
    fn a_robot_that_still_turns_is_found_and_scatter_is_not() {
        let moved = |rate_dps: f64| moved(angles(rate_dps).tracks(), &(0.0..6.0)).map(|motion| motion.relative() > 4.0);
        assert_eq!([0.0, 0.04, 0.12, 0.4].map(moved), [None, None, Some(false), Some(true)]);
    }
}
