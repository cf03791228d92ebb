//! The gyroscope's drift in yaw, seen while the robot is still before and after a run, and how well it is known.
//!
//! Gravity says nothing of yaw, so a bias of the gyroscope that the calibration left over, or that came since, turns the
//! yaw away. While the robot is still the yaw's rate is that bias about z, plus noise. Of the biases about x and y gravity
//! tells: the board's filter holds roll and pitch against them, and the gyroscope's rate less the attitude's own is the bias.
//! What the filter leaves is the part about the vertical: a robot that leans turns all three into yaw,
//! yaw' = -x sin pitch + cos pitch (y sin roll + z cos roll). A filter that learns the bias itself
//! ([`Series::filtered_with`]) leaves x and y nothing. Model of the measured yaw's error:
//!
//! - angle random walk, of standard deviation N √t after a time t. N is estimated from the still phases themselves: from
//!   the scatter of the mean rates of 2 s blocks, which takes in whatever slow noise there is up to some seconds. It is not
//!   taken below the sensor's data sheet. After a run the robot swings back, and its swing is told from the bias (see
//!   [`super::rest`]).
//! - a bias that changes slowly. Between the two still phases it is taken to follow the sensor's temperature, which the log
//!   has, where that went on from one to the other; and where it hardly changed, time. For what strays from that, the bias
//!   is allowed to walk at random: the variance of the integral of a random walk of W a root second that is held at both
//!   ends of a time T is W² T³ / 12. Beside the temperature W is [`BIAS_WALK`] and a part of what the bias was seen to
//!   change by; without it, all of that.
//!
//! With one still phase alone the bias is that phase's, and may walk by [`BIAS_WALK`] from then on, and change by what is
//! usual for as much as the sensor has warmed since.
//!
//! The uncertainty is that of 95 %, by Student's distribution, because N comes from a few blocks.

use super::rest::{BIAS_SPREAD, Phase, after_run, noise};
use super::series::{Series, Track};
use crate::log::LONGEST_TRIAL_S;
use std::ops::Range;

/// Random walk of the bias where nothing was seen of it, °/s/√s. A lying MPU6050 (655 s) shows about a third of this.
pub(crate) const BIAS_WALK: f64 = 3e-4;

/// Part of a bias' change that may not have followed the temperature.
const UNLIKE: f64 = 0.25;

/// A temperature that changed by less says nothing, °C: readings scatter by 0.08.
const LEAST_WARMING_C: f64 = 0.2;

/// Time between the points of the drift's course, s.
const STEP_S: f64 = 1.0;

/// The rates about x and y at rest know the tilt's noise, too: their variance over that of the rate about z.
const TILT_NOISE: f64 = 4.0;

/// After a calibration the filter finds its level anew, with a time constant of a second, s.
const SETTLED_S: f64 = 10.0;

/// The bias at rest.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Seen {
    /// When, s.
    middle_s: f64,
    /// About x, y and z, °/s.
    rates: [f64; 3],
    /// Variance of the rate about z over that of the angle random walk, 1/s.
    unknown: f64,
    temperature_c: f64,
}

/// The drift, and how well the yaw is known.
#[derive(Clone, PartialEq, Debug)]
pub struct Drift {
    /// The still phases that were used.
    pub still: Vec<Range<f64>>,
    seen: Vec<Seen>,
    /// Angle random walk, °/√s.
    pub angle_walk: f64,
    freedom: f64,
    /// Whether the bias follows the temperature.
    warms: bool,
    /// Integral of the drift's rate, degrees.
    drifted: Track,
    /// Integral of how far the bias had come from the first still phase's to the second's, s.
    come: Track,
    /// Integral of how much warmer the sensor was than in the first still phase, °C s.
    warmed: Track,
    /// Integrals of the parts that the biases about x, y and z have in the yaw, s.
    parts: [Track; 3],
}

impl Drift {
    /// The drift from the still phase before a run, and from whatever part of the phase after it is still. `None` where
    /// neither says anything.
    pub fn seen(series: &Series, before: Range<f64>, after: Range<f64>) -> Option<Self> {
        let span = series.yaw.span();
        if span.end - span.start > LONGEST_TRIAL_S {
            return None;
        }
        let calibrated_s = before.start;
        let before = Phase::still(&series.yaw, before);
        let after = match &before {
            Some(before) => after_run(&series.yaw, after, before),
            // Without a phase before, nothing tells the robot that swings back from a gyroscope that drifts.
            None => None,
        };
        let phases: Vec<_> = before.into_iter().chain(after).collect();
        let (angle_walk, freedom) = noise(&phases)?;
        let lateral: Option<Vec<[f64; 2]>> = (phases.iter())
            .map(|phase| series.lateral_bias(phase.range.start.max(calibrated_s + SETTLED_S)..phase.range.end))
            .collect();
        let look = |(i, phase): (usize, &Phase)| {
            let [x, y] = lateral.as_ref().map_or([0.0; 2], |lateral| lateral[i]);
            Seen {
                middle_s: phase.middle(),
                rates: [x, y, phase.rate],
                unknown: phase.unknown,
                temperature_c: series.temperature.mean(phase.range.clone()).unwrap_or_default(),
            }
        };
        let mut drift = Self {
            seen: phases.iter().enumerate().map(look).collect(),
            still: phases.into_iter().map(|phase| phase.range).collect(),
            angle_walk,
            freedom,
            warms: false,
            drifted: Track::default(),
            come: Track::default(),
            warmed: Track::default(),
            parts: Default::default(),
        };
        drift.follow(series);
        Some(drift)
    }

    /// Integrates the drift over a trial.
    fn follow(&mut self, series: &Series) {
        // One phase alone is both.
        let (Some(&first), Some(&second)) = (self.seen.first(), self.seen.last()) else { return };
        let span = series.yaw.span();
        let count = ((span.end - span.start) / STEP_S).ceil() as usize;
        let times: Vec<f64> = (0..=count).map(|i| (span.start + i as f64 * STEP_S).min(span.end)).collect();
        // Means, because the robot wobbles with its flagella.
        let [temperatures, pitches, rolls] = [&series.temperature, &series.pitch, &series.roll].map(|track| {
            let around = |time: &f64| (time - STEP_S).max(span.start)..(time + STEP_S).min(span.end);
            track.means(times.iter().map(around))
        });
        let shares = self.shares(&times, &temperatures);
        let mut sums = [0.0; 6];
        let mut last: Option<(f64, [f64; 6])> = None;
        let leans = pitches.into_iter().zip(rolls);
        for (((time, share), (pitch, roll)), temperature) in times.into_iter().zip(shares).zip(leans).zip(temperatures)
        {
            let bias = |axis: usize| first.rates[axis] + share * (second.rates[axis] - first.rates[axis]);
            let ((pitch, level), (roll, upright)) = (pitch.to_radians().sin_cos(), roll.to_radians().sin_cos());
            // Up in the body's axes.
            let [x, y, z] = [-pitch, level * roll, level * upright];
            let rates = [x * bias(0) + y * bias(1) + z * bias(2), share, temperature - first.temperature_c, x, y, z];
            if let Some((before, old)) = last {
                for i in 0..6 {
                    sums[i] += 0.5 * (old[i] + rates[i]) * (time - before);
                }
            }
            last = Some((time, rates));
            let [x, y, z] = &mut self.parts;
            let tracks = [&mut self.drifted, &mut self.come, &mut self.warmed, x, y, z];
            for (track, sum) in tracks.into_iter().zip(sums) {
                track.push(time, sum);
            }
        }
    }

    /// How far the bias has come at each time from the first still phase's to the second's: with the temperature where that
    /// went on from one to the other, else with time.
    fn shares(&mut self, times: &[f64], temperatures: &[f64]) -> Vec<f64> {
        let [first, second] = self.seen.as_slice() else { return vec![0.0; times.len()] };
        let between = times.iter().zip(temperatures).filter(|(t, _)| (first.middle_s..second.middle_s).contains(t));
        let extremes = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = between.fold(extremes, |(low, high), (_, t)| (low.min(*t), high.max(*t)));
        let warming = second.temperature_c - first.temperature_c;
        self.warms = warming.abs() > LEAST_WARMING_C.max(0.5 * (high - low));
        if self.warms {
            temperatures.iter().map(|t| (t - first.temperature_c) / warming).collect()
        } else {
            times.iter().map(|t| (t - first.middle_s) / (second.middle_s - first.middle_s)).collect()
        }
    }

    /// Drift from one time to another, degrees.
    pub fn between(&self, from_s: f64, to_s: f64) -> f64 {
        change(&self.drifted, from_s, to_s)
    }

    /// Standard deviation of what the sensor's warming since the first still phase usually does to a turn measured from one
    /// time to another, degrees: one with that of all other times.
    pub fn warming(&self, from_s: f64, to_s: f64) -> f64 {
        BIAS_SPREAD * change(&self.warmed, from_s, to_s)
    }

    /// 95 % uncertainty of a turn measured from one time to another, degrees.
    pub fn uncertainty(&self, from_s: f64, to_s: f64) -> f64 {
        let length = to_s - from_s;
        let walk = self.angle_walk.powi(2);
        let mean = |track: &Track| if length > 0.0 { change(track, from_s, to_s) / length } else { 0.0 };
        // What the variance of each axis' rate makes in that of the yaw's.
        let parts = self.parts.each_ref().map(|part| mean(part).powi(2));
        let seen = |unknown: f64| walk * length.powi(2) * unknown * (TILT_NOISE * (parts[0] + parts[1]) + parts[2]);
        let variance = match self.seen.as_slice() {
            [first, last] => {
                let apart = last.middle_s - first.middle_s;
                let second = mean(&self.come);
                let unknown = (1.0 - second).powi(2) * first.unknown + second.powi(2) * last.unknown;
                let strays = |axis: usize| {
                    let changed = (last.rates[axis] - first.rates[axis]).powi(2);
                    let walked =
                        if self.warms { UNLIKE.powi(2) * changed + BIAS_WALK.powi(2) * apart } else { changed };
                    parts[axis] * walked * apart.powi(2) / 12.0
                };
                walk * length + seen(unknown) + strays(0) + strays(1) + strays(2)
            }
            [first] => {
                let reach = (to_s - first.middle_s).abs().max((from_s - first.middle_s).abs());
                let warming = self.warming(from_s, to_s).powi(2);
                walk * length + seen(first.unknown) + BIAS_WALK.powi(2) * reach.powi(3) / 3.0 + warming
            }
            _ => return f64::INFINITY,
        };
        student_95(self.freedom) * variance.sqrt()
    }
}

fn change(track: &Track, from_s: f64, to_s: f64) -> f64 {
    track.at(to_s).unwrap_or_default() - track.at(from_s).unwrap_or_default()
}

/// Two-sided 95 % quantile of Student's distribution (Abramowitz and Stegun 26.7.5; within 1 % from 4 degrees of freedom
/// on).
pub(crate) fn student_95(freedom: f64) -> f64 {
    let z = 1.959_964_f64;
    let terms = [
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
    ];
    let f = freedom.max(1.0);
    z + terms[0] / f + terms[1] / f.powi(2) + terms[2] / f.powi(3)
}

#[cfg(test)]
mod tests {
    use super::super::Reading;
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn students_quantile_is_that_of_the_tables() {
        for (freedom, expected) in [(4.0, 2.776), (8.0, 2.306), (23.0, 2.069), (1000.0, 1.962)] {
            assert!((student_95(freedom) / expected - 1.0).abs() < 0.01, "{freedom}");
        }
    }

    /// A trial of 170 s at 200 Hz, by the law of the board's filter: biases (°/s), pitch and roll (degrees) and temperature
    /// (°C) at a time. Its estimate starts 3 degrees off, as after a calibration.
    fn trial(
        bias: impl Fn(f64) -> [f64; 3],
        lean: impl Fn(f64) -> [f64; 2],
        temperature: impl Fn(f64) -> f64,
    ) -> Series {
        const KP: f64 = 1.0;
        const TICK_S: f64 = 0.005;
        let truth = |t: f64| {
            let [pitch, roll] = lean(t).map(f64::to_radians);
            UnitQuaternion::from_euler_angles(roll, pitch, 0.0)
        };
        let mut series = Series::default();
        let mut estimate = UnitQuaternion::from_euler_angles(0.0, f64::to_radians(-3.0), 0.0);
        for i in 0..=34_000 {
            let t = f64::from(i) * TICK_S;
            let rates = (truth(t).inverse() * truth(t + TICK_S)).scaled_axis() / TICK_S
                + Vector3::from(bias(t).map(f64::to_radians));
            let q = estimate.into_inner();
            let reading = Reading {
                attitude: [q.w, q.i, q.j, q.k],
                lateral_dps: Some([rates.x, rates.y].map(f64::to_degrees)),
                temperature_c: temperature(t),
            };
            series.push(t, &reading);
            let up = |attitude: UnitQuaternion<f64>| attitude.inverse() * Vector3::z();
            let correction = up(truth(t)).cross(&up(estimate)) * KP;
            estimate *= UnitQuaternion::from_scaled_axis((rates + correction) * TICK_S);
        }
        series
    }

    /// The drift over the run, and what of it is left.
    fn left(series: &Series) -> (Drift, f64) {
        let drift = Drift::seen(series, 0.0..20.0, 140.0..170.0).unwrap();
        assert_eq!(drift.still.len(), 2);
        let measured = series.yaw.at(139.0).unwrap() - series.yaw.at(19.9).unwrap();
        let left = measured - drift.between(19.9, 139.0);
        (drift, left)
    }

    /// Leans within 2 s, and back.
    fn leans(t: f64, pitch: f64, roll: f64) -> [f64; 2] {
        let share = ((t - 20.0) / 2.0).clamp(0.0, 1.0).min(((140.0 - t) / 2.0).clamp(0.0, 1.0));
        [share * pitch, share * roll]
    }

    #[test]
    fn a_steady_change_of_the_bias_is_taken_out_whole() {
        let (_, left) = left(&trial(|t| [0.0, 0.0, 0.02 + 1e-4 * t], |_| [0.0; 2], |_| 25.0));
        // But for what the second phase is weighed down by: its noise is never taken for none.
        assert!(left.abs() < 1e-3, "{left}");
    }

    #[test]
    fn a_robot_that_leans_turns_all_three_biases_into_yaw() {
        for (bias, lean) in [
            ([0.03, 0.0, 0.0], [18.0, 0.0]),
            ([0.0, 0.0, 0.03], [18.0, 0.0]),
            ([0.0, 0.03, 0.0], [0.0, -18.0]),
            ([0.03, -0.03, 0.02], [-15.0, 10.0]),
        ] {
            let (drift, left) = left(&trial(|_| bias, |t| leans(t, lean[0], lean[1]), |_| 25.0));
            assert!(left.abs() < 0.02, "{left} at {bias:?}, {lean:?}");
            assert!(drift.uncertainty(19.9, 139.0) < 1.0);
        }
    }

    #[test]
    fn a_bias_follows_the_temperature() {
        let warm = |t: f64| 1.0 - (-t / 60.0).exp();
        let bias = |t: f64| [0.02 * warm(t), -0.03 + 0.04 * warm(t), 0.02 + 0.05 * warm(t)];
        let series = trial(bias, |t| leans(t, 9.0, 18.0), |t| 25.0 + 1.5 * warm(t));
        let (drift, left) = left(&series);
        // Along straight lines in time a degree would be left.
        assert!(left.abs() < 0.05, "{left}");
        assert!(drift.uncertainty(19.9, 139.0) < 1.0, "{}", drift.uncertainty(19.9, 139.0));
    }

    #[test]
    fn one_still_phase_alone_knows_less_of_a_sensor_that_warms() {
        let bias = |_| [0.0, 0.0, 0.02];
        let unknown = |warming: f64| {
            let series = trial(bias, |_| [0.0; 2], |t| 25.0 + warming * t / 170.0);
            let drift = Drift::seen(&series, 0.0..20.0, 170.0..170.0).unwrap();
            assert_eq!(drift.still.len(), 1);
            drift.uncertainty(19.9, 139.0)
        };
        // 0.03 °/s a degree, of which there are 0.33 on the way, for 119 s.
        assert!(unknown(0.0) < 1.0 && unknown(0.8) > 2.0, "{} {}", unknown(0.0), unknown(0.8));
    }

    #[test]
    fn a_clock_that_runs_away_costs_no_memory() {
        let mut series = Series::default();
        for i in 0..5000 {
            series.push(f64::from(i) * 0.005, &Reading::default());
        }
        series.push(1e13, &Reading::default());
        assert_eq!(Drift::seen(&series, 0.0..20.0, 1e13..1e13), None);
    }

    #[test]
    fn too_little_says_nothing() {
        let mut series = Series::default();
        assert_eq!(Drift::seen(&series, 0.0..20.0, 140.0..170.0), None);
        series.push(0.0, &Reading::default());
        series.push(5.0, &Reading::default());
        assert_eq!(Drift::seen(&series, 0.0..5.0, 5.0..5.0), None);
    }
}
