//! Converts encoder readings to smooth speeds for the model.
//!
//! The angle of an encoder is exact to a count and does not drift, but the speed between two counts is noisy. Therefore
//! a quadratic spline is fitted to the angle; its derivative is linear between the spline's knots, like a
//! [`SpeedProfile`]. Knots are close together while the motors start and stop, and far apart in between, so that noise
//! is averaged and the solver gets a smooth speed.

use super::TwinError;
use crate::trial::Data;
use sim::trial::profile::SpeedProfile;
use std::f64::consts::TAU;
use std::ops::Range;

/// Largest difference between spline and encoder, turns: one degree, which does not change the forces of a helix
/// noticeably.
const TOLERANCE: f64 = 1.0 / 360.0;

/// Initial and smallest distance of the knots, s.
const LONGEST_S: f64 = 2.0;
const SHORTEST_S: f64 = 0.03;

/// Weight of the changes of speed between knots, as turns in a knot's distance, relative to the readings. It is too
/// small to affect the fit if there are readings, and determines the spline in gaps.
const STIFFNESS: f64 = 1e-3;

/// Time at rest of the model before the start of a rig's log, s. The model starts with straight flagella, and the
/// motion of the base as they sag decays in 11 s. Modelled trials begin in the same way.
const REST_S: f64 = 40.0;

/// Largest initial speed that counts as noise of an encoder at rest, rpm.
const MOVING_RPM: f64 = 0.5;

/// Resolution of the board's clock, s.
const CLOCK_S: f64 = 1e-6;

/// Time and turns of both flagella.
type Turns = (f64, [f64; 2]);

/// Returns the speeds of a trial from its first frame to its last, with its run phase, after a rest.
pub(super) fn profile(data: &Data) -> Result<SpeedProfile, TwinError> {
    let turns = encoders(data);
    let rest = (!data.is_model()).then_some(turns[0].0 - REST_S);
    build(data, &turns, rest)
}

/// Returns the speeds from the start of the run on, after a rest that begins n + 1/2 steps before it, so that the
/// samples fall in the middle of the steps of the run.
pub(super) fn profile_of_run(data: &Data, step_s: f64) -> Result<SpeedProfile, TwinError> {
    let turns = encoders(data);
    let run = data.times.run.start;
    let rest_s = if data.is_model() { run - turns[0].0 } else { REST_S };
    let rest = run - ((rest_s / step_s - 0.5).floor().max(0.0) + 0.5) * step_s;
    // The readings shortly before the run make the spline start at rest.
    let first = turns.partition_point(|(time, _)| *time < rest.max(run - 0.5));
    build(data, &turns[first.min(turns.len() - 2)..], Some(rest))
}

/// Returns the encoders' angles.
fn encoders(data: &Data) -> Vec<Turns> {
    let [.., one, two] = &data.motors.values;
    data.motors.time_s.iter().zip(one.iter().zip(two)).map(|(time, (one, two))| (*time, [*one, *two])).collect()
}

fn build(data: &Data, readings: &[Turns], rest_from_s: Option<f64>) -> Result<SpeedProfile, TwinError> {
    let run = within(&data.times.run, readings);
    let knots = knots(readings, run.start);
    let speeds = [0, 1].map(|k| Spline::fit(&knots, readings.iter().map(|(time, turns)| (*time, turns[k]))).speeds());
    let mut points: Vec<_> =
        knots.iter().enumerate().map(|(i, time)| (*time, [speeds[0][i] * 60.0, speeds[1][i] * 60.0])).collect();
    if let (Some(rest), Some((first, rpm))) = (rest_from_s, points.first_mut()) {
        let first = *first;
        if rpm.iter().all(|rpm| rpm.abs() < MOVING_RPM) {
            *rpm = [0.0; 2];
            points.insert(0, (rest, [0.0; 2]));
        } else {
            points.splice(0..0, [(rest, [0.0; 2]), (first, [0.0; 2])]);
        }
    }
    let start = points.first().map_or(run.start, |(time, _)| run.start.max(*time));
    let angles = readings[0].1.map(|turns| turns * TAU);
    let profile = SpeedProfile::from_points(&points).and_then(|profile| profile.with_run(start, run.end));
    let target = data.speeds().map(|speed| speed.rpm());
    profile.map(|profile| profile.from_angles(angles).with_target(target)).map_err(|error| {
        let help = "check the encoders' counts in the log with `biflag export`";
        TwinError::Unusable { path: data.path.clone(), reason: error.to_string(), help }
    })
}

/// Returns the run without the fraction of a microsecond by which it may end after the last reading: the board's clock
/// counts microseconds, and a model's phases count nanoseconds. A run that begins after the last reading is empty.
fn within(run: &Range<f64>, readings: &[Turns]) -> Range<f64> {
    let last = readings.last().map_or(run.end, |(time, _)| *time);
    let end = if run.end - last < CLOCK_S { run.end.min(last) } else { run.end };
    if run.start < last { run.start..end } else { last..last }
}

/// Returns knots that keep both splines within the tolerance. One knot is at the start of the run.
fn knots(turns: &[Turns], run_start: f64) -> Vec<f64> {
    let (Some((start, _)), Some((end, _))) = (turns.first(), turns.last()) else { return Vec::new() };
    let mut knots = if run_start > *start { even(*start, run_start) } else { vec![*start] };
    knots.pop();
    knots.extend(even(run_start.max(*start), *end));
    loop {
        let mut worst = vec![0.0f64; knots.len().saturating_sub(1)];
        for k in 0..2 {
            let spline = Spline::fit(&knots, turns.iter().map(|(time, turns)| (*time, turns[k])));
            for (time, turns) in turns {
                let (interval, angle) = spline.at(*time);
                worst[interval] = worst[interval].max((angle - turns[k]).abs());
            }
        }
        let split = |i: usize| worst[i] > TOLERANCE && knots[i + 1] - knots[i] >= 2.0 * SHORTEST_S;
        let mut finer = Vec::with_capacity(knots.len());
        for i in 0..worst.len() {
            finer.push(knots[i]);
            if split(i) {
                finer.push(0.5 * (knots[i] + knots[i + 1]));
            }
        }
        finer.extend(knots.last());
        if finer.len() == knots.len() {
            return knots;
        }
        knots = finer;
    }
}

/// Returns evenly spaced times from `start` to `end`, at most the initial distance apart.
fn even(start: f64, end: f64) -> Vec<f64> {
    if end <= start {
        return vec![start];
    }
    let count = ((end - start) / LONGEST_S).ceil().max(1.0);
    // `start + (end - start)` may be rounded to less than the end.
    (0..count as usize).map(|i| start + (end - start) * i as f64 / count).chain([end]).collect()
}

/// A quadratic spline with simple knots inside and triple ones at its ends.
struct Spline<'a> {
    knots: &'a [f64],
    coefficients: Vec<f64>,
}

impl<'a> Spline<'a> {
    /// Fits (time, angle) by least squares, with a penalty on changes of speed.
    fn fit(knots: &'a [f64], readings: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut spline = Self { knots, coefficients: Vec::new() };
        let count = knots.len() + 1;
        // Rows of the lower half of a matrix with a bandwidth of five.
        let mut normal = vec![[0.0; 3]; count];
        let mut right = vec![0.0; count];
        let mut add = |first: usize, row: [f64; 3], value: f64| {
            for i in 0..3 {
                for j in 0..=i {
                    normal[first + i][2 - (i - j)] += row[i] * row[j];
                }
                right[first + i] += row[i] * value;
            }
        };
        for (time, angle) in readings {
            let (interval, basis) = spline.basis(time);
            add(interval, basis, angle);
        }
        for i in 0..count.saturating_sub(2) {
            let (before, after) = (spline.span(i), spline.span(i + 1));
            let length = 0.5 * (before + after);
            let weight = STIFFNESS * length;
            let (a, b) = (2.0 * weight / before, 2.0 * weight / after);
            add(i, [a, -a - b, b], 0.0);
        }
        spline.coefficients = solve(normal, right);
        spline
    }

    /// Returns a knot. The end knots are tripled: 0, -1 and -2 are all the first.
    fn knot(&self, index: isize) -> f64 {
        self.knots[index.clamp(0, self.knots.len() as isize - 1) as usize]
    }

    /// Returns the support of the derivative between coefficient `i` and the next, s.
    fn span(&self, i: usize) -> f64 {
        let i = i as isize;
        self.knot(i + 1) - self.knot(i - 1)
    }

    /// Returns the interval of a time, and the three basis functions that are not zero in it (de Boor's recursion).
    fn basis(&self, time: f64) -> (usize, [f64; 3]) {
        let interval = self.knots.partition_point(|knot| *knot <= time).clamp(1, self.knots.len() - 1) - 1;
        let i = interval as isize;
        let (before, left, right, after) = (self.knot(i - 1), self.knot(i), self.knot(i + 1), self.knot(i + 2));
        let (falling, rising) = ((right - time) / (right - left), (time - left) / (right - left));
        let first = falling * (right - time) / (right - before);
        let last = rising * (time - left) / (after - left);
        (interval, [first, 1.0 - first - last, last])
    }

    fn at(&self, time: f64) -> (usize, f64) {
        let (interval, basis) = self.basis(time);
        (interval, (0..3).map(|k| basis[k] * self.coefficients[interval + k]).sum())
    }

    /// Returns the derivative at each knot, turns per second.
    fn speeds(&self) -> Vec<f64> {
        let change = |i: usize| self.coefficients[i + 1] - self.coefficients[i];
        (0..self.knots.len()).map(|i| 2.0 * change(i) / self.span(i)).collect()
    }
}

/// Solves a positive definite system with a bandwidth of five by Cholesky factorisation. `rows[i]` holds the entries of
/// row i from two before the diagonal to the diagonal.
fn solve(mut rows: Vec<[f64; 3]>, mut right: Vec<f64>) -> Vec<f64> {
    let count = rows.len();
    for i in 0..count {
        for j in i.saturating_sub(2)..=i {
            let common = (i.saturating_sub(2)).max(j.saturating_sub(2))..j;
            let sum: f64 = common.map(|k| rows[i][2 + k - i] * rows[j][2 + k - j]).sum();
            let rest = rows[i][2 + j - i] - sum;
            rows[i][2 + j - i] = if i == j { rest.max(f64::MIN_POSITIVE).sqrt() } else { rest / rows[j][2] };
        }
        let sum: f64 = (i.saturating_sub(2)..i).map(|k| rows[i][2 + k - i] * right[k]).sum();
        right[i] = (right[i] - sum) / rows[i][2];
    }
    for i in (0..count).rev() {
        let sum: f64 = (i + 1..count.min(i + 3)).map(|k| rows[k][2 + i - k] * right[k]).sum();
        right[i] = (right[i] - sum) / rows[i][2];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::board;
    use crate::swing::tests::{RATE_HZ, Truth, quick};
    use crate::trial::{Collector, Judged, Records, Want};
    use biflag_log::schema::biflag::event::Kind;
    use biflag_log::schema::biflag::{Motor, Quaternion, Telemetry};
    use biflag_log::{FORMAT, TrialMeta};
    use proptest::prelude::*;
    use protocol::{Info, Settings, SpeedFrom};
    use sim::body::attitude::of_euler_zyx;

    /// The steady angles are those of the last seconds, so a replay has to turn as the motors did then.
    #[test]
    fn a_replay_without_encoders_turns_at_the_speeds_of_each_part_of_the_run() {
        const REST_S: f64 = 5.0;
        const RUN_S: f64 = 75.0;
        let commanded = [44.0, -27.0];
        let rpm = |t: f64| [41.2 * (1.0 - 0.0006 * t), -29.3 * (1.0 + 0.03 * (t / 14.0).sin())];
        let points: Vec<_> =
            (0..=150).map(|i| (0.5 * f64::from(i), if i == 0 { [0.0; 2] } else { rpm(0.5 * f64::from(i)) })).collect();
        let truth = SpeedProfile::from_points(&points).unwrap();
        let Truth { angles_deg, .. } = Truth::by(&quick(), commanded, truth.clone());
        let mut collector = Collector::new(Want::default(), FORMAT);
        for (name, time_s) in [("preroll", 0.0), ("run", REST_S), ("end", REST_S + RUN_S)] {
            collector.event(time_s, Kind::Phase, name);
        }
        for i in 0..((REST_S + RUN_S) * RATE_HZ) as usize {
            let run = i.checked_sub((REST_S * RATE_HZ) as usize);
            let q = of_euler_zyx([0, 1, 2].map(|k| run.map_or(0.0, |i| angles_deg[k][i].to_radians())));
            let motor = |k: usize| {
                let target_rpm = if run.is_some() { commanded[k] } else { 0.0 };
                Some(Motor { target_rpm, speed_rpm: f64::NAN, turns: f64::NAN, ..Motor::default() })
            };
            collector.telemetry(&Telemetry {
                time_s: i as f64 / RATE_HZ,
                imu_fresh: true,
                attitude: Some(Quaternion { w: q.w, x: q.i, y: q.j, z: q.k }),
                motor1: motor(0),
                motor2: motor(1),
                ..Telemetry::default()
            });
        }
        let settings = Settings { speed_from: SpeedFrom::Duty, ..Settings::DEFAULT };
        let [w1_rpm, w2_rpm] = commanded;
        let records = Records {
            board: Some(board::to_log(&Info::default(), &settings)),
            trial: Some(TrialMeta { w1_rpm, w2_rpm, ..TrialMeta::default() }),
            ..Records::default()
        };
        let Judged { data, .. } = Judged::of(collector.finish("a.mcap".as_ref(), records));
        let replayed = profile(&data).unwrap();
        let turned = |profile: &SpeedProfile, part_s: &Range<f64>| {
            let [from, to] = [part_s.start, part_s.end].map(|t| profile.motors(t).map(|motor| motor.angle));
            [0, 1].map(|k| to[k] - from[k])
        };
        for part_s in [16.0..30.0, 30.0..45.0, 45.0..60.0, 64.0..RUN_S - 0.1] {
            let on_clock = part_s.start + REST_S..part_s.end + REST_S;
            let (told, true_rad) = (turned(&replayed, &on_clock), turned(&truth, &part_s));
            let is_near = |k: usize| (told[k] - true_rad[k]).abs() < 0.003 * true_rad[k].abs();
            assert!(is_near(0) && is_near(1), "{part_s:?}: {told:?}, {true_rad:?}");
        }
    }

    /// Returns readings at 200 Hz of an encoder with 1204.44 counts per turn.
    fn encoder(angle: impl Fn(f64) -> f64, end_s: f64) -> Vec<Turns> {
        let count = |turns: f64| (turns * 1204.44).round() / 1204.44;
        (0..=(end_s * 200.0) as u32)
            .map(|i| f64::from(i) * 0.005)
            .map(|time| (time, [count(angle(time)), 0.0]))
            .collect()
    }

    fn fitted(readings: &[Turns], run_start: f64) -> (Vec<f64>, Vec<f64>) {
        let knots = knots(readings, run_start);
        let speeds = Spline::fit(&knots, readings.iter().map(|(t, turns)| (*t, turns[0]))).speeds();
        (knots, speeds)
    }

    #[test]
    fn start_run_and_stop_of_a_motor_need_few_knots() {
        // 50 rpm, reached and lost with a time constant of 0.1 s.
        let speed = 50.0 / 60.0;
        let angle = |t: f64| {
            let ran = (t.min(122.0) - 2.0).max(0.0);
            let fall = (t - 122.0).max(0.0);
            speed * (ran - 0.1 * (1.0 - (-ran / 0.1).exp()) + 0.1 * (1.0 - (-fall / 0.1).exp()))
        };
        let readings = encoder(angle, 125.0);
        let (knots, speeds) = fitted(&readings, 2.0);
        assert!(knots.len() < 150, "{} knots", knots.len());
        let at = |time: f64| {
            let after = knots.partition_point(|k| *k <= time).clamp(1, knots.len() - 1);
            let share = (time - knots[after - 1]) / (knots[after] - knots[after - 1]);
            speeds[after - 1] + share * (speeds[after] - speeds[after - 1])
        };
        for time in [10.0, 60.0, 115.0] {
            assert!((at(time) - speed).abs() < 0.002 * speed, "{} at {time}", at(time));
        }
        assert!(at(0.5).abs() < 0.002 && at(124.5).abs() < 0.002);
        assert!((at(2.1) - speed * (1.0 - (-1f64).exp())).abs() < 0.05 * speed, "{}", at(2.1));
        let spline = Spline::fit(&knots, readings.iter().map(|(t, turns)| (*t, turns[0])));
        let worst = readings.iter().map(|(t, turns)| (spline.at(*t).1 - turns[0]).abs()).fold(0.0, f64::max);
        assert!(worst < 1.5 * TOLERANCE, "{worst} turns");
    }

    #[test]
    fn a_gap_is_bridged_at_its_mean_speed() {
        let mut readings = encoder(|t| 0.5 * t, 30.0);
        readings.retain(|(time, _)| !(10.0..13.0).contains(time));
        let (knots, speeds) = fitted(&readings, 0.0);
        for (time, speed) in knots.iter().zip(&speeds) {
            assert!((speed - 0.5).abs() < 0.005, "{speed} at {time}");
        }
    }

    #[test]
    fn run_ends_with_the_readings_if_only_a_rounding_is_between() {
        let readings = encoder(|t| 0.5 * t, 30.0);
        assert_eq!(within(&(0.0..30.000_000_000_000_004), &readings), 0.0..30.0);
        assert_eq!(within(&(1.0..29.5), &readings), 1.0..29.5);
        assert_eq!(within(&(1.0..30.9), &readings), 1.0..30.9, "a part of the run without readings is not left out");
        // One knot per second up to the run would fill the memory.
        assert!(within(&(1e10..2e10), &readings).is_empty());
    }

    proptest! {
        #[test]
        fn last_knot_is_the_last_reading(start in 0.0..100.0f64, length in 1e-3..200.0f64) {
            let end = start + length;
            prop_assert_eq!(even(start, end).last().copied(), Some(end));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// The spline's angle follows the encoder for any possible motion of a motor.
        #[test]
        fn angles_follow_any_smooth_motion(
            speed in -1.5..1.5f64,
            swing in 0.0..0.3f64,
            period in 0.5..20.0f64,
            phase in 0.0..6.0f64,
        ) {
            let angle = |t: f64| speed * t + swing * (std::f64::consts::TAU * t / period + phase).sin();
            let readings = encoder(angle, 20.0);
            let (knots, _) = fitted(&readings, 3.0);
            let spline = Spline::fit(&knots, readings.iter().map(|(t, turns)| (*t, turns[0])));
            for (time, turns) in &readings {
                prop_assert!((spline.at(*time).1 - turns[0]).abs() < 2.0 * TOLERANCE);
            }
        }
    }
}
