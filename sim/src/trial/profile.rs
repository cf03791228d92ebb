//! Speeds of both motors over time: the phases of a trial, ramps, or the record of a rig.
//!
//! Speeds are linear between points; two points at one time are a jump. Angles are the exact integral. For motors
//! outside of the simulator, the profile is extended during the run ([`SpeedProfile::open`]).

use crate::body::shaft::MotorState;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Why points are not a profile.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum ProfileError {
    /// Fewer than two points, or no time between the first and the last.
    #[error("a profile needs a duration above zero")]
    Empty,
    /// A time or speed is not a number.
    #[error("point {index} is not finite")]
    NotFinite { index: usize },
    /// The time of a point is before that of the previous point.
    #[error("the time of point {index} is before that of the point before it")]
    Unordered { index: usize },
    /// The motor to reverse does not exist, or the reversal is outside of the run.
    #[error("motor {motor} cannot reverse {after} s after the start of the run")]
    Reverse { motor: usize, after: f64 },
    /// The run phase is not within the profile, or its duration is not positive.
    #[error("the run from {start} s to {end} s has no length, or is not within the profile")]
    RunOutside { start: f64, end: f64 },
    /// A speed is too large for slow motion in a viscous fluid.
    #[error("point {index}: {rpm:.0} rpm is beyond {limit:.0} rpm")]
    TooFast { index: usize, rpm: f64, limit: f64 },
}

/// Largest speed of a profile, rpm.
pub const LARGEST_RPM: f64 = 10_000.0;

/// Points that an extended profile keeps.
const REMEMBERED: usize = 8;

/// A motor that turned the other way at more than this share of its last speed has reversed. Measured speeds scatter.
const REVERSED: f64 = 0.5;

/// A motor whose target is slower than this, rad/s, stands still: 1 rpm. Its measured speeds are scatter.
const STANDING: f64 = PI / 30.0;

/// A run that begins or ends this close (s) to an end of its profile is moved to that end: times computed in different ways
/// differ by rounding, and the solver cannot take a step between them.
const ROUNDING_S: f64 = 1e-9;

/// Durations of the phases of a trial, s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Phases {
    /// At rest, for the sensor's calibration.
    pub calibrate: f64,
    /// At rest.
    pub preroll: f64,
    /// Motors at their speeds.
    pub run: f64,
    /// Motors off.
    pub decay: f64,
    /// Duration of the motors' ramps at the start and the end of the run.
    pub ramp: f64,
    /// A motor that reverses within the run.
    pub reverse: Option<Reverse>,
}

/// A motor that reverses at some time of the run, to the same speed in the other direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reverse {
    /// Index of the motor, 0 or 1.
    pub motor: usize,
    /// Time from the start of the run, s.
    pub after: f64,
}

impl Default for Phases {
    fn default() -> Self {
        Self { calibrate: 0.0, preroll: 0.0, run: 120.0, decay: 0.0, ramp: 0.25, reverse: None }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Point {
    time: f64,
    speed: [f64; 2],
    angle: [f64; 2],
}

/// Speeds of both motors over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedProfile {
    points: Vec<Point>,
    run: [f64; 2],
    /// Target speeds of the motors in the run, rad/s.
    target: Option<[f64; 2]>,
}

impl SpeedProfile {
    /// Returns the profile of these times in s and speeds in rpm, linear in between. The run phase is the whole
    /// profile.
    ///
    /// Measured speeds should be smoothed first: a step's formula takes the speed at its end for the whole step.
    ///
    /// # Errors
    /// Points that are not a valid profile, see [`ProfileError`].
    pub fn from_points(points: &[(f64, [f64; 2])]) -> Result<Self, ProfileError> {
        let mut built: Vec<Point> = Vec::with_capacity(points.len());
        for (index, (time, rpm)) in points.iter().enumerate() {
            if !time.is_finite() || rpm.iter().any(|r| !r.is_finite()) {
                return Err(ProfileError::NotFinite { index });
            }
            if let Some(fast) = rpm.iter().find(|r| r.abs() > LARGEST_RPM) {
                return Err(ProfileError::TooFast { index, rpm: *fast, limit: LARGEST_RPM });
            }
            let speed = rpm.map(|r| r * PI / 30.0);
            let angle = match built.last() {
                None => [0.0; 2],
                Some(last) if last.time <= *time => {
                    let half = 0.5 * (time - last.time);
                    [0, 1].map(|k| last.angle[k] + half * (last.speed[k] + speed[k]))
                }
                Some(_) => return Err(ProfileError::Unordered { index }),
            };
            built.push(Point { time: *time, speed, angle });
        }
        let (Some(first), Some(last)) = (built.first(), built.last()) else {
            return Err(ProfileError::Empty);
        };
        let run = [first.time, last.time];
        if run[1] <= run[0] {
            return Err(ProfileError::Empty);
        }
        Ok(Self { points: built, run, target: None })
    }

    /// Returns the same profile with its run phase from `start` to `end`, s.
    ///
    /// # Errors
    /// A run phase that is not within the profile.
    pub fn with_run(mut self, start: f64, end: f64) -> Result<Self, ProfileError> {
        let start = if (start - self.start()).abs() < ROUNDING_S { self.start() } else { start };
        let end = if (end - self.end()).abs() < ROUNDING_S { self.end() } else { end };
        if start >= self.start() && end <= self.end() && start < end {
            self.run = [start, end];
            Ok(self)
        } else {
            Err(ProfileError::RunOutside { start, end })
        }
    }

    /// Sets the target speeds of the run (rpm). They then decide the length of the steady window instead of the speeds
    /// at the run's end: measured speeds scatter about their target, and the number of revolutions in the window could
    /// vary with them.
    pub fn with_target(mut self, rpm: [f64; 2]) -> Self {
        self.target = Some(rpm.map(|rpm| rpm * PI / 30.0));
        self
    }

    /// Returns the target speeds of the run in rad/s, or without a target the speeds at its end; if these are zero, the
    /// speeds in its middle.
    pub fn target(&self) -> [f64; 2] {
        let [start, stop] = self.run;
        let at = |time: f64| self.motors(time).map(|motor| motor.speed);
        self.target.unwrap_or_else(|| {
            let last = at(stop);
            if last == [0.0; 2] { at(0.5 * (start + stop)) } else { last }
        })
    }

    /// Returns the same speeds with these angles (rad) added to the motors' angles. The flagella of a rig start a trial
    /// where the last one left them; [`crate::steady::phase`] says when this matters.
    pub fn from_angles(mut self, start_rad: [f64; 2]) -> Self {
        for point in &mut self.points {
            point.angle = [0, 1].map(|k| point.angle[k] + start_rad[k]);
        }
        self
    }

    /// Returns constant speeds (rpm) from time 0 on, for `duration` s.
    ///
    /// # Errors
    /// A duration that is not positive, or an impossible speed.
    pub fn constant(rpm: [f64; 2], duration: f64) -> Result<Self, ProfileError> {
        Self::from_points(&[(0.0, rpm), (duration, rpm)])
    }

    /// Returns the part of constant speeds between two times (s), with the angles of the whole profile.
    ///
    /// # Errors
    /// Times without a duration.
    pub(crate) fn between(&self, start: f64, end: f64) -> Result<Self, ProfileError> {
        let motors = self.motors(start);
        let rpm = motors.map(|motor| motor.speed * 30.0 / PI);
        Ok(Self::from_points(&[(start, rpm), (end, rpm)])?.from_angles(motors.map(|motor| motor.angle)))
    }

    /// Returns the phases of a trial at the speeds `rpm`.
    ///
    /// # Errors
    /// Durations or a reversal that are not valid, see [`ProfileError`].
    pub fn phases(phases: &Phases, rpm: [f64; 2]) -> Result<Self, ProfileError> {
        let start = phases.calibrate + phases.preroll;
        let stop = start + phases.run;
        let end = stop + phases.decay;
        let mut ramp = phases.ramp.clamp(0.0, 0.5 * phases.run.max(0.0));
        if let Some(Reverse { motor, after }) = phases.reverse {
            if motor > 1 || !(after > 0.0 && after < phases.run) {
                return Err(ProfileError::Reverse { motor, after });
            }
            ramp = ramp.min(after);
        }
        let still = [0.0; 2];
        let mut points = vec![(0.0, still), (start, still), (start + ramp, rpm)];
        let mut rpm = rpm;
        if let Some(Reverse { motor, after }) = phases.reverse {
            // A motor stops before it reverses.
            let (from, to) = (start + after, (start + after + 2.0 * ramp).min(stop));
            points.push((from, rpm));
            rpm[motor] = -rpm[motor];
            points.push((to, rpm));
        }
        points.push((stop, rpm));
        if phases.decay > 0.0 {
            points.push(((stop + ramp).min(end), still));
            points.push((end, still));
        }
        let mut profile = Self::from_points(&points)?;
        profile.run = [start, stop];
        Ok(profile)
    }

    /// Returns a profile of motors at rest that ends at its start, `time` (s); [`SpeedProfile::extend`] adds to it. It has
    /// no run phase.
    pub fn open(time: f64) -> Self {
        Self { points: vec![Point { time, speed: [0.0; 2], angle: [0.0; 2] }], run: [time; 2], target: None }
    }

    /// Extends the profile to `time` (s), with speeds that change linearly from the last ones to these (rad/s). Only the
    /// last points are kept.
    ///
    /// # Errors
    /// A time that is not after the last one, or an impossible speed.
    pub fn extend(&mut self, time: f64, speed: [f64; 2]) -> Result<(), ProfileError> {
        let index = self.points.len();
        let last = self.points[index - 1];
        if !time.is_finite() || speed.iter().any(|s| !s.is_finite()) {
            return Err(ProfileError::NotFinite { index });
        }
        if time <= last.time {
            return Err(ProfileError::Unordered { index });
        }
        if let Some(fast) = speed.iter().map(|s| s * 30.0 / PI).find(|rpm| rpm.abs() > LARGEST_RPM) {
            return Err(ProfileError::TooFast { index, rpm: fast, limit: LARGEST_RPM });
        }
        let half = 0.5 * (time - last.time);
        let angle = [0, 1].map(|k| last.angle[k] + half * (last.speed[k] + speed[k]));
        self.points.push(Point { time, speed, angle });
        self.points.drain(..self.points.len().saturating_sub(REMEMBERED));
        Ok(())
    }

    /// Returns the first time, s; for an extended profile, the first one kept.
    pub fn start(&self) -> f64 {
        self.points[0].time
    }

    /// Returns the last time, s.
    pub fn end(&self) -> f64 {
        self.points[self.points.len() - 1].time
    }

    /// Returns start and end of the run phase, s.
    pub fn run(&self) -> [f64; 2] {
        self.run
    }

    /// Returns angles and speeds of both motors at a time (s). Beyond the ends the speed of the nearest end applies; at
    /// a jump it is the speed after the jump.
    pub fn motors(&self, time: f64) -> [MotorState; 2] {
        let after = self.points.partition_point(|p| p.time <= time);
        let Some(before) = self.points.get(after.wrapping_sub(1)) else {
            let first = &self.points[0];
            return [0, 1].map(|k| MotorState {
                angle: first.angle[k] + first.speed[k] * (time - first.time),
                speed: first.speed[k],
            });
        };
        let passed = time - before.time;
        let slope = match self.points.get(after) {
            Some(next) => [0, 1].map(|k| (next.speed[k] - before.speed[k]) / (next.time - before.time)),
            None => [0.0; 2],
        };
        [0, 1].map(|k| MotorState {
            angle: before.angle[k] + passed * (before.speed[k] + 0.5 * slope[k] * passed),
            speed: before.speed[k] + slope[k] * passed,
        })
    }

    /// Returns the time of the run (s) after which no motor reverses: the run's start, unless one does.
    pub fn last_reversal(&self) -> f64 {
        let [start, stop] = self.run;
        let last = self.motors(stop).map(|motor| motor.speed);
        let turns = self.target().map(|speed| speed.abs() > STANDING);
        let other_way =
            |point: &Point| (0..2).any(|k| turns[k] && point.speed[k] * last[k] < -REVERSED * last[k] * last[k]);
        let within = self.points.partition_point(|point| point.time < stop);
        let end_of_ramp = |i: usize| self.points.get(i + 1).map_or(stop, |next| next.time.min(stop));
        self.points[..within].iter().rposition(other_way).map_or(start, |i| end_of_ramp(i).max(start))
    }

    /// Returns the time of the first jump of a speed after `time`, s.
    pub fn next_jump(&self, time: f64) -> Option<f64> {
        (self.points.windows(2))
            .filter(|p| p[0].time == p[1].time && p[0].speed != p[1].speed)
            .map(|p| p[1].time)
            .find(|t| *t > time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 399 * 0.1 s is 7e-15 s after 39.9 s.
    #[test]
    fn a_run_that_ends_a_rounding_error_beside_its_profile_ends_with_it() {
        let end = 0.1 * 399.0;
        assert_ne!(end, 39.9);
        for (of_run, of_profile) in [(39.9, end), (end, 39.9)] {
            let profile = SpeedProfile::from_points(&[(0.0, [50.0, 10.0]), (of_profile, [50.0, 10.0])]).unwrap();
            let run = profile.with_run(1e-14, of_run).unwrap().run();
            assert_eq!(run, [0.0, of_profile]);
        }
    }

    #[test]
    fn a_reversal_is_found_and_scatter_is_none() {
        let phases = Phases { preroll: 5.0, run: 40.0, decay: 10.0, ..Phases::default() };
        let reversed = Phases { reverse: Some(Reverse { motor: 1, after: 37.0 }), ..phases };
        let last = |phases: &Phases, rpm| SpeedProfile::phases(phases, rpm).unwrap().last_reversal();
        assert_eq!(last(&phases, [47.3, -61.9]), 5.0);
        assert_eq!(last(&reversed, [47.3, -61.9]), 42.5);
        assert_eq!(last(&reversed, [47.3, 0.0]), 5.0, "a motor that stands");
        let measured = [(0.0, [3.0, 0.4]), (1.0, [-0.9, -0.3]), (2.0, [2.9, 0.2]), (3.0, [3.1, -0.1])];
        assert_eq!(SpeedProfile::from_points(&measured).unwrap().with_target([3.0, 0.0]).last_reversal(), 0.0);
    }

    #[test]
    fn angles_are_the_integral_of_the_speeds() {
        let profile = SpeedProfile::from_points(&[
            (0.0, [0.0, 30.0]),
            (2.0, [60.0, 30.0]),
            (2.0, [10.0, 30.0]),
            (5.0, [10.0, -30.0]),
        ])
        .expect("a profile");
        let mut angle = [0.0; 2];
        let step = 1e-4;
        for i in 0..50_000 {
            let t = (i as f64 + 0.5) * step;
            let motors = profile.motors(t);
            for k in 0..2 {
                angle[k] += motors[k].speed * step;
            }
        }
        let end = profile.motors(5.0);
        for k in 0..2 {
            assert!((end[k].angle - angle[k]).abs() < 1e-6);
        }
        assert_eq!(profile.next_jump(0.0), Some(2.0));
        assert_eq!(profile.next_jump(2.0), None);
    }

    #[test]
    fn a_profile_grows_without_a_jump_and_forgets_its_beginning() {
        let mut profile = SpeedProfile::open(1.0);
        let mut whole = vec![(1.0, [0.0; 2])];
        for i in 1..40 {
            let (time, rpm) = (1.0 + 0.02 * f64::from(i), [f64::from(i), -10.0]);
            profile.extend(time, rpm.map(|rpm| rpm * PI / 30.0)).expect("a later time");
            whole.push((time, rpm));
        }
        let whole = SpeedProfile::from_points(&whole).expect("a profile");
        for time in [profile.end(), profile.end() - 0.013, profile.start()] {
            for (a, b) in profile.motors(time).into_iter().zip(whole.motors(time)) {
                assert!((a.angle - b.angle).abs() < 1e-12 && (a.speed - b.speed).abs() < 1e-12);
            }
        }
        assert!(profile.end() - profile.start() < 0.2 && profile.next_jump(profile.start()).is_none());
        assert!(profile.extend(profile.end(), [0.0; 2]).is_err() && profile.extend(9.0, [f64::NAN; 2]).is_err());
    }

    #[test]
    fn a_motor_reverses_within_the_run() {
        let phases =
            |after| Phases { run: 10.0, decay: 1.0, reverse: Some(Reverse { motor: 1, after }), ..Phases::default() };
        let rpm = |profile: &SpeedProfile, t| profile.motors(t).map(|m| (m.speed * 30.0 / PI).round());
        let profile = SpeedProfile::phases(&phases(4.0), [50.0, -10.0]).expect("a profile");
        assert_eq!(profile.run(), [0.0, 10.0]);
        let at = [3.99, 4.25, 4.51, 9.99, 11.0].map(|t| rpm(&profile, t));
        assert_eq!(at, [[50.0, -10.0], [50.0, 0.0], [50.0, 10.0], [50.0, 10.0], [0.0, 0.0]]);
        for after in [0.01, 9.99] {
            let profile = SpeedProfile::phases(&phases(after), [50.0, -10.0]).expect("a profile");
            assert_eq!(rpm(&profile, 10.0), [50.0, 10.0]);
        }
        assert!(SpeedProfile::phases(&phases(10.0), [50.0, 0.0]).is_err());
        let third = Phases { reverse: Some(Reverse { motor: 2, after: 1.0 }), ..Phases::default() };
        assert!(SpeedProfile::phases(&third, [50.0, 0.0]).is_err());
    }

    #[test]
    fn other_angles_leave_the_speeds() {
        let profile = SpeedProfile::constant([60.0, -30.0], 4.0).expect("a profile");
        let turned = profile.clone().from_angles([1.0, -2.0]);
        for time in [-1.0, 0.0, 2.5, 5.0] {
            for (k, start) in [1.0, -2.0].into_iter().enumerate() {
                let (a, b) = (profile.motors(time)[k], turned.motors(time)[k]);
                assert!((b.angle - a.angle - start).abs() < 1e-12 && a.speed == b.speed);
            }
        }
    }

    #[test]
    fn impossible_profiles_are_refused() {
        assert_eq!(SpeedProfile::from_points(&[]), Err(ProfileError::Empty));
        assert_eq!(SpeedProfile::constant([1.0, 2.0], 0.0), Err(ProfileError::Empty));
        assert!(SpeedProfile::constant([f64::NAN, 0.0], 1.0).is_err());
        assert!(SpeedProfile::constant([1e9, 0.0], 1.0).is_err());
        assert!(SpeedProfile::from_points(&[(1.0, [0.0; 2]), (0.0, [0.0; 2])]).is_err());
        let profile = SpeedProfile::constant([1.0, 2.0], 10.0).expect("a profile");
        assert_eq!(profile.clone().with_run(2.0, 10.0).map(|p| p.run()), Ok([2.0, 10.0]));
        for (start, end) in [(-1.0, 5.0), (5.0, 11.0), (5.0, 5.0), (f64::NAN, 5.0)] {
            assert!(profile.clone().with_run(start, end).is_err());
        }
    }
}
