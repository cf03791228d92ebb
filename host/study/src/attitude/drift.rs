//! The drift of the yaw and its uncertainty, estimated from the still phases before and after a run.
//!
//! Yaw cannot be observed from gravity, so the residual bias of the gyroscope after calibration makes it drift. While
//! the robot is still, the rate of the yaw is the bias about z, plus noise. Roll and pitch can be observed from
//! gravity: the board's filter holds them, and the gyroscope's rate minus that of the attitude is the bias about x and
//! y. The part about the vertical remains, so that in a leaning robot all three biases contribute to the yaw: yaw' = -x
//! sin pitch + cos pitch (y sin roll + z cos roll). With a filter that estimates the bias itself ([`Series::new`]) the
//! contributions of x and y are zero. Model of the error of the measured yaw:
//!
//! - Angle random walk, of standard deviation N √t after a time t. N is estimated from the still phases: from the
//!   scatter of the mean rates of 2 s blocks, which includes slow noise up to some seconds. It is at least that of the
//!   sensor's data sheet. After a run the robot returns to rest, and this return is separated from the bias (see
//!   [`super::rest`]).
//! - A bias that changes slowly. Between the two still phases it follows the sensor's temperature in the log if the
//!   change between them exceeds half of its range, and time otherwise. Deviations are modelled as a random walk: the
//!   variance of the integral of a random walk of W per root second that is fixed at both ends of a time T is
//!   W² T³ / 12. With the temperature, W is [`BIAS_WALK`] and a share of the bias' observed change; without it, all of
//!   the change.
//!
//! The biases about x and y are found in still phases that are longer than the filter's settling. If no phase is, they
//! are those of the calibration, with the noise of its mean; without a calibration they are unknown, and so is the
//! uncertainty of the yaw.
//!
//! With only one still phase, the bias is that of the phase, with a random walk of [`BIAS_WALK`] from then on and the
//! usual change for the warming of the sensor.
//!
//! The uncertainty is a 95 % bound by Student's distribution, because N is estimated from few blocks.

use super::rest::{BIAS_SPREAD, Phase, after_run, noise};
use super::{Columns, Series};
use std::ops::Range;

/// Random walk of the bias without a second still phase, °/s/√s: about three times that of an MPU6050 at
/// rest for 655 s.
pub const BIAS_WALK: f64 = 3e-4;

/// Share of the change of the bias that is not explained by the temperature.
const UNEXPLAINED_SHARE: f64 = 0.25;

/// Smallest significant change of the temperature, °C: readings scatter by 0.08.
const LEAST_WARMING_C: f64 = 0.2;

/// Step of the integration of the drift, s.
const STEP_S: f64 = 1.0;

/// Ratio of the variance of the rates about x and y at rest to that about z: they also contain the noise of the tilt.
const TILT_NOISE: f64 = 4.0;

/// Time in which the filter settles after a calibration, with a time constant of a second, s.
const SETTLED_S: f64 = 10.0;

/// The bias in a still phase.
#[derive(Clone, Copy, PartialEq, Debug)]
struct BiasEstimate {
    /// Middle of the phase, s.
    middle_s: f64,
    /// About x, y and z, °/s.
    rates: [f64; 3],
    /// Ratio of the variance of the rate about z to that of the angle random walk, 1/s.
    relative_variance: f64,
    /// Temperature of the sensor.
    temperature_c: f64,
}

/// Indexes of the integrals for the drift and its uncertainty.
mod integral {
    /// The drift, degrees.
    pub const DRIFT: usize = 0;
    /// Interpolation weight between the biases of the two still phases, s.
    pub const SHARE: usize = 1;
    /// Warming since the first still phase, °C s.
    pub const WARMING: usize = 2;
    /// Components of the vertical along the body's x, y and z, s.
    pub const VERTICAL: [usize; 3] = [3, 4, 5];
}

/// The drift of the yaw and its uncertainty.
#[derive(Clone, PartialEq, Debug)]
pub struct Drift {
    /// The still phases that were used.
    pub still: Vec<Range<f64>>,
    biases: Vec<BiasEstimate>,
    /// Angle random walk, °/√s.
    pub angle_walk: f64,
    degrees_of_freedom: f64,
    /// Ratio of the variance of the biases about x and y to that of the angle random walk, 1/s, if no still phase shows
    /// them: 0 if one does, `None` if they are unknown.
    lateral_variance: Option<f64>,
    /// Whether the bias is assumed to follow the temperature.
    follows_temperature: bool,
    /// See [`integral`].
    integrals: Columns<6>,
}

impl Drift {
    /// Estimates the drift from the still phase before a run, and from the part of the phase after it in which the
    /// robot is still. Returns `None` if neither is long enough. `calibrate_s`: duration of the gyroscope's calibration,
    /// which ended at the start of the phase; 0 for none.
    pub fn estimate(series: &Series, before: Range<f64>, after: Range<f64>, calibrate_s: f64) -> Option<Self> {
        let calibrated_s = before.start;
        let before = Phase::still(series.yaw(), before);
        let after = match &before {
            Some(before) => after_run(series.yaw(), after, before),
            // Without the phase before the run, the return to rest cannot be separated from a drift.
            None => None,
        };
        let phases: Vec<_> = before.into_iter().chain(after).collect();
        let (angle_walk, degrees_of_freedom) = noise(&phases)?;
        let lateral: Vec<Option<[f64; 2]>> = (phases.iter())
            .map(|phase| series.lateral_bias(phase.range.start.max(calibrated_s + SETTLED_S)..phase.range.end))
            .collect();
        // A phase that is too short has the bias of the other one.
        let shown = lateral.iter().flatten().next().copied();
        let lateral_variance = match shown {
            None if !series.learns_bias() => (calibrate_s > 0.0).then(|| 1.0 / calibrate_s),
            _ => Some(0.0),
        };
        let estimate = |(i, phase): (usize, &Phase)| {
            let [x, y] = lateral[i].or(shown).unwrap_or_default();
            BiasEstimate {
                middle_s: phase.middle(),
                rates: [x, y, phase.rate],
                relative_variance: phase.relative_variance,
                temperature_c: series.temperature().mean(phase.range.clone()).unwrap_or_default(),
            }
        };
        let mut drift = Self {
            biases: phases.iter().enumerate().map(estimate).collect(),
            still: phases.into_iter().map(|phase| phase.range).collect(),
            angle_walk,
            degrees_of_freedom,
            lateral_variance,
            follows_temperature: false,
            integrals: Columns::default(),
        };
        drift.integrate(series);
        Some(drift)
    }

    /// Integrates the drift over a trial.
    fn integrate(&mut self, series: &Series) {
        // A single phase serves as both.
        let (Some(&first), Some(&second)) = (self.biases.first(), self.biases.last()) else { return };
        let span = series.yaw().span();
        let count = ((span.end - span.start) / STEP_S).ceil() as usize;
        let times: Vec<f64> = (0..=count).map(|i| (span.start + i as f64 * STEP_S).min(span.end)).collect();
        // Means remove the wobble of the robot with its flagella.
        let [temperatures, pitches, rolls] = [series.temperature(), series.pitch(), series.roll()].map(|track| {
            let around = |time: &f64| (time - STEP_S).max(span.start)..(time + STEP_S).min(span.end);
            times.iter().map(|time| track.mean(around(time)).unwrap_or_default()).collect::<Vec<_>>()
        });
        let shares = self.shares(&times, &temperatures);
        let mut sums = [0.0; 6];
        let mut last: Option<(f64, [f64; 6])> = None;
        for (i, &time) in times.iter().enumerate() {
            let bias = |axis: usize| first.rates[axis] + shares[i] * (second.rates[axis] - first.rates[axis]);
            let ((pitch, level), (roll, upright)) =
                (pitches[i].to_radians().sin_cos(), rolls[i].to_radians().sin_cos());
            // Up in the body's axes.
            let [x, y, z] = [-pitch, level * roll, level * upright];
            let warming = temperatures[i] - first.temperature_c;
            let rates = [x * bias(0) + y * bias(1) + z * bias(2), shares[i], warming, x, y, z];
            if let Some((before, old)) = last {
                for k in 0..6 {
                    sums[k] += 0.5 * (old[k] + rates[k]) * (time - before);
                }
            }
            last = Some((time, rates));
            self.integrals.push(time, sums);
        }
    }

    /// Returns the interpolation weight between the biases of the two still phases at each time: by the temperature if
    /// its change between them exceeds half of its range, by time otherwise.
    fn shares(&mut self, times: &[f64], temperatures: &[f64]) -> Vec<f64> {
        let [first, second] = self.biases.as_slice() else { return vec![0.0; times.len()] };
        let between = times.iter().zip(temperatures).filter(|(t, _)| (first.middle_s..second.middle_s).contains(t));
        let extremes = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = between.fold(extremes, |(low, high), (_, t)| (low.min(*t), high.max(*t)));
        let warming = second.temperature_c - first.temperature_c;
        self.follows_temperature = warming.abs() > LEAST_WARMING_C.max(0.5 * (high - low));
        if self.follows_temperature {
            temperatures.iter().map(|t| (t - first.temperature_c) / warming).collect()
        } else {
            times.iter().map(|t| (t - first.middle_s) / (second.middle_s - first.middle_s)).collect()
        }
    }

    /// Returns the change of an [`integral`] from one time to another.
    fn change(&self, integral: usize, from_s: f64, to_s: f64) -> f64 {
        let track = self.integrals.track(integral);
        track.at(to_s).unwrap_or_default() - track.at(from_s).unwrap_or_default()
    }

    /// Returns the drift from one time to another, degrees.
    pub fn between(&self, from_s: f64, to_s: f64) -> f64 {
        self.change(integral::DRIFT, from_s, to_s)
    }

    /// Returns the standard deviations of the effect on a rotation from one time to another of the biases about x and y
    /// that no still phase shows, degrees. Each is fully correlated between all times. `None` if the biases are unknown.
    pub fn lateral(&self, from_s: f64, to_s: f64) -> Option<[f64; 2]> {
        let rate = self.angle_walk * self.lateral_variance?.sqrt();
        let [x, y, _] = integral::VERTICAL;
        Some([x, y].map(|part| rate * self.change(part, from_s, to_s)))
    }

    /// Returns the standard deviation of the effect of the sensor's usual warming since the first still phase on a
    /// rotation from one time to another, degrees. It is fully correlated between all times.
    pub fn warming(&self, from_s: f64, to_s: f64) -> f64 {
        BIAS_SPREAD * self.change(integral::WARMING, from_s, to_s)
    }

    /// Returns the 95 % uncertainty of a rotation measured from one time to another, degrees; `None` if the biases
    /// about x and y are unknown.
    pub fn uncertainty(&self, from_s: f64, to_s: f64) -> Option<f64> {
        let lateral = self.lateral(from_s, to_s)?.map(|deg| deg * deg);
        let length = to_s - from_s;
        let walk = self.angle_walk.powi(2);
        let mean = |integral: usize| if length > 0.0 { self.change(integral, from_s, to_s) / length } else { 0.0 };
        // Weight of the variance of each axis' rate in that of the yaw.
        let parts = integral::VERTICAL.map(|part| mean(part).powi(2));
        let of_rates =
            |variance: f64| walk * length.powi(2) * variance * (TILT_NOISE * (parts[0] + parts[1]) + parts[2]);
        let variance = match self.biases.as_slice() {
            [first, last] => {
                let apart = last.middle_s - first.middle_s;
                let share = mean(integral::SHARE);
                let relative = (1.0 - share).powi(2) * first.relative_variance + share.powi(2) * last.relative_variance;
                let deviation = |axis: usize| {
                    let changed = (last.rates[axis] - first.rates[axis]).powi(2);
                    let walked = if self.follows_temperature {
                        UNEXPLAINED_SHARE.powi(2) * changed + BIAS_WALK.powi(2) * apart
                    } else {
                        changed
                    };
                    parts[axis] * walked * apart.powi(2) / 12.0
                };
                walk * length + of_rates(relative) + deviation(0) + deviation(1) + deviation(2)
            }
            [first] => {
                let reach = (to_s - first.middle_s).abs().max((from_s - first.middle_s).abs());
                let warming = self.warming(from_s, to_s).powi(2);
                walk * length + of_rates(first.relative_variance) + BIAS_WALK.powi(2) * reach.powi(3) / 3.0 + warming
            }
            _ => f64::INFINITY,
        };
        Some(student_95(self.degrees_of_freedom) * (variance + lateral[0] + lateral[1]).sqrt())
    }
}

/// Returns the two-sided 95 % quantile of Student's distribution (Abramowitz and Stegun 26.7.5; from their table 26.10
/// between one and four degrees of freedom, where the series is too small).
pub fn student_95(degrees_of_freedom: f64) -> f64 {
    const FEW: [f64; 4] = [12.706, 4.303, 3.182, 2.776];
    let f = degrees_of_freedom.max(1.0);
    if f < FEW.len() as f64 {
        // The quantile falls about as a power of the freedom.
        let (i, whole) = (f as usize - 1, f.floor());
        return FEW[i] * (FEW[i + 1] / FEW[i]).powf((f / whole).ln() / ((whole + 1.0) / whole).ln());
    }
    let z = 1.959_964_f64;
    let terms = [
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
    ];
    z + terms[0] / f + terms[1] / f.powi(2) + terms[2] / f.powi(3)
}

#[cfg(test)]
mod tests {
    use super::super::Reading;
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn student_quantile_agrees_with_tables() {
        for (freedom, expected) in [
            (1.0, 12.706),
            (2.0, 4.303),
            (3.0, 3.182),
            (3.999, 2.776),
            (4.0, 2.776),
            (8.0, 2.306),
            (23.0, 2.069),
            (1000.0, 1.962),
        ] {
            assert!((student_95(freedom) / expected - 1.0).abs() < 0.01, "{freedom}");
        }
    }

    /// Returns a trial of 170 s at 200 Hz from a model of the board's filter, given biases (°/s), pitch and roll
    /// (degrees) and temperature (°C) over time. The filter starts with an error of 3 degrees, as after a calibration.
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

    /// Returns the drift over the run, and its residual.
    fn left(series: &Series) -> (Drift, f64) {
        let drift = Drift::estimate(series, 0.0..20.0, 140.0..170.0, 5.0).unwrap();
        assert_eq!(drift.still.len(), 2);
        let measured = series.yaw().at(139.0).unwrap() - series.yaw().at(19.9).unwrap();
        let left = measured - drift.between(19.9, 139.0);
        (drift, left)
    }

    /// Returns pitch and roll of a robot that leans within 2 s, and returns.
    fn leans(t: f64, pitch: f64, roll: f64) -> [f64; 2] {
        let share = ((t - 20.0) / 2.0).clamp(0.0, 1.0).min(((140.0 - t) / 2.0).clamp(0.0, 1.0));
        [share * pitch, share * roll]
    }

    #[test]
    fn linear_change_of_the_bias_is_removed() {
        let (_, left) = left(&trial(|t| [0.0, 0.0, 0.02 + 1e-4 * t], |_| [0.0; 2], |_| 25.0));
        // The residual is due to the weight of the second phase, whose noise is never assumed to be zero.
        assert!(left.abs() < 1e-3, "{left}");
    }

    #[test]
    fn leaning_robot_turns_all_three_biases_into_yaw() {
        for (bias, lean) in [
            ([0.03, 0.0, 0.0], [18.0, 0.0]),
            ([0.0, 0.0, 0.03], [18.0, 0.0]),
            ([0.0, 0.03, 0.0], [0.0, -18.0]),
            ([0.03, -0.03, 0.02], [-15.0, 10.0]),
        ] {
            let (drift, left) = left(&trial(|_| bias, |t| leans(t, lean[0], lean[1]), |_| 25.0));
            assert!(left.abs() < 0.02, "{left} at {bias:?}, {lean:?}");
            assert!(drift.uncertainty(19.9, 139.0).unwrap() < 1.0);
        }
    }

    #[test]
    fn bias_follows_the_temperature() {
        let warm = |t: f64| 1.0 - (-t / 60.0).exp();
        let bias = |t: f64| [0.02 * warm(t), -0.03 + 0.04 * warm(t), 0.02 + 0.05 * warm(t)];
        let series = trial(bias, |t| leans(t, 9.0, 18.0), |t| 25.0 + 1.5 * warm(t));
        let (drift, left) = left(&series);
        // Linear interpolation in time would leave a residual of a degree.
        assert!(left.abs() < 0.05, "{left}");
        assert!(drift.uncertainty(19.9, 139.0).unwrap() < 1.0, "{}", drift.uncertainty(19.9, 139.0).unwrap());
    }

    #[test]
    fn warming_increases_the_uncertainty_from_one_still_phase() {
        let bias = |_| [0.0, 0.0, 0.02];
        let unknown = |warming: f64| {
            let series = trial(bias, |_| [0.0; 2], |t| 25.0 + warming * t / 170.0);
            let drift = Drift::estimate(&series, 0.0..20.0, 170.0..170.0, 5.0).unwrap();
            assert_eq!(drift.still.len(), 1);
            drift.uncertainty(19.9, 139.0).unwrap()
        };
        // 0.03 °/s per °C times a mean warming of 0.33 °C times 119 s.
        assert!(unknown(0.0) < 1.0 && unknown(0.8) > 2.0, "{} {}", unknown(0.0), unknown(0.8));
    }

    /// Still phases of 12 s are too short for the biases about x and y, of which the yaw of a leaning robot has a share.
    #[test]
    fn lateral_biases_that_no_phase_shows_are_in_the_uncertainty() {
        let lean = |t| leans(t, 9.0, 0.0);
        let uncertainty = |bias: f64, calibrate_s: f64| {
            let series = trial(|_| [bias, 0.0, 0.02], lean, |_| 25.0);
            let drift = Drift::estimate(&series, 8.0..20.0, 170.0..170.0, calibrate_s).unwrap();
            let measured = series.yaw().at(139.0).unwrap() - series.yaw().at(19.9).unwrap();
            (measured - drift.between(19.9, 139.0), drift.uncertainty(19.9, 139.0))
        };
        let (left, unknown) = uncertainty(1.0, 0.0);
        assert!(left.abs() > 10.0 && unknown.is_none(), "{left} {unknown:?}");
        // A calibration of 5 s of a sensor with an angle random walk of 0.005 °/√s leaves 0.002 °/s.
        let (left, known) = uncertainty(0.002, 5.0);
        assert!(left.abs() < known.unwrap(), "{left} {known:?}");
        let seen = trial(|_| [1.0, 0.0, 0.02], lean, |_| 25.0);
        let drift = Drift::estimate(&seen, 8.0..20.0, 140.0..170.0, 0.0).unwrap();
        let left = seen.yaw().at(139.0).unwrap() - seen.yaw().at(19.9).unwrap() - drift.between(19.9, 139.0);
        assert!(left.abs() < drift.uncertainty(19.9, 139.0).unwrap(), "the phase after the run shows them: {left}");
    }

    #[test]
    fn short_phases_give_no_estimate() {
        let mut series = Series::default();
        assert_eq!(Drift::estimate(&series, 0.0..20.0, 140.0..170.0, 5.0), None);
        series.push(0.0, &Reading::default());
        series.push(5.0, &Reading::default());
        assert_eq!(Drift::estimate(&series, 0.0..5.0, 5.0..5.0, 5.0), None);
    }
}
