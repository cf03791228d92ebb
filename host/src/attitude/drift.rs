//! The gyroscope's drift in yaw, seen while the robot is still before and after a run, and how well it is known.
//!
//! Gravity says nothing of yaw, so a bias of the gyroscope that the calibration left over, or that came since, turns the
//! yaw away. While the robot is still the yaw's rate is that bias about z, plus noise. Of the bias about y, gravity tells:
//! the attitude follows it, and the gyroscope's rate less the pitch's own is the bias. A robot that leans turns it into yaw:
//! yaw' = (q sin roll + r cos roll) / cos pitch. Model of the measured yaw's error:
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
//! With one still phase alone the bias is that phase's, and may walk by [`BIAS_WALK`] from then on.
//!
//! The uncertainty is that of 95 %, by Student's distribution, because N comes from a few blocks.

use super::rest::{Phase, after_run, noise};
use super::series::{Series, Track};
use std::ops::Range;

/// Random walk of the bias where nothing was seen of it, °/s/√s. A lying MPU6050 (655 s) shows about a third of this.
pub(crate) const BIAS_WALK: f64 = 3e-4;

/// Part of a bias' change that may not have followed the temperature.
const UNLIKE: f64 = 0.25;

/// A temperature that changed by less says nothing, °C: readings scatter by 0.08.
const LEAST_WARMING_C: f64 = 0.2;

/// Time between the points of the drift's course, s.
const STEP_S: f64 = 1.0;

/// The rate about y at rest knows the tilt's noise, too: its variance over that of the rate about z.
const TILT_NOISE: f64 = 4.0;

/// The bias at rest.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Seen {
    /// When, s.
    middle_s: f64,
    /// About z and y, °/s.
    rates: [f64; 2],
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
    /// Integral of the part that the bias about y has in the yaw, s.
    leaned: Track,
}

impl Drift {
    /// The drift from the still phase before a run, and from whatever part of the phase after it is still. `None` where
    /// neither says anything.
    pub fn seen(series: &Series, before: Range<f64>, after: Range<f64>) -> Option<Self> {
        let before = Phase::still(&series.yaw, before);
        let after = match &before {
            Some(before) => after_run(&series.yaw, after, before),
            // Without a phase before, nothing tells the robot that swings back from a gyroscope that drifts.
            None => None,
        };
        let phases: Vec<_> = before.into_iter().chain(after).collect();
        let (angle_walk, freedom) = noise(&phases)?;
        let look = |phase: &Phase| Seen {
            middle_s: phase.middle(),
            rates: [phase.rate, series.slip.slope(phase.range.clone()).unwrap_or_default()],
            unknown: phase.unknown,
            temperature_c: series.temperature.mean(phase.range.clone()).unwrap_or_default(),
        };
        let mut drift = Self {
            seen: phases.iter().map(look).collect(),
            still: phases.into_iter().map(|phase| phase.range).collect(),
            angle_walk,
            freedom,
            warms: false,
            drifted: Track::default(),
            come: Track::default(),
            leaned: Track::default(),
        };
        drift.follow(series);
        Some(drift)
    }

    /// Integrates the drift over a trial.
    fn follow(&mut self, series: &Series) {
        let span = series.yaw.span();
        let count = ((span.end - span.start) / STEP_S).ceil() as usize;
        let times: Vec<f64> = (0..=count).map(|i| (span.start + i as f64 * STEP_S).min(span.end)).collect();
        let around = |time: &f64| (time - STEP_S).max(span.start)..(time + STEP_S).min(span.end);
        let temperatures = series.temperature.means(times.iter().map(around));
        let share: Box<dyn Fn(f64, f64) -> f64> = match self.seen.as_slice() {
            [first, second] => {
                let (first, second) = (*first, *second);
                let within = |time: &&(&f64, &f64)| (first.middle_s..second.middle_s).contains(time.0);
                let between = times.iter().zip(&temperatures);
                let (low, high) = between
                    .filter(|pair| within(&pair))
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, t)| (low.min(*t), high.max(*t)));
                let warming = second.temperature_c - first.temperature_c;
                self.warms = warming.abs() > LEAST_WARMING_C.max(0.5 * (high - low));
                if self.warms {
                    Box::new(move |_, temperature| (temperature - first.temperature_c) / warming)
                } else {
                    Box::new(move |time, _| (time - first.middle_s) / (second.middle_s - first.middle_s))
                }
            }
            _ => Box::new(|_, _| 0.0),
        };
        let mut sums = [0.0; 3];
        let mut last: Option<(f64, [f64; 3])> = None;
        for (time, temperature) in times.into_iter().zip(temperatures) {
            let share = share(time, temperature);
            let [z, y] = [0, 1].map(|axis| match self.seen.as_slice() {
                [first, second] => first.rates[axis] + share * (second.rates[axis] - first.rates[axis]),
                [first] => first.rates[axis],
                _ => 0.0,
            });
            let lean = |track: &Track| track.at(time).unwrap_or_default().to_radians().sin_cos();
            let ((_, upright), (leant, hangs)) = (lean(&series.pitch), lean(&series.roll));
            let lateral = leant / upright.max(0.1);
            let rates = [y * lateral + z * hangs / upright.max(0.1), share, lateral];
            if let Some((before, old)) = last {
                for i in 0..3 {
                    sums[i] += 0.5 * (old[i] + rates[i]) * (time - before);
                }
            }
            last = Some((time, rates));
            for (track, sum) in [&mut self.drifted, &mut self.come, &mut self.leaned].into_iter().zip(sums) {
                track.push(time, sum);
            }
        }
    }

    /// Drift from one time to another, degrees.
    pub fn between(&self, from_s: f64, to_s: f64) -> f64 {
        change(&self.drifted, from_s, to_s)
    }

    /// 95 % uncertainty of a turn measured from one time to another, degrees.
    pub fn uncertainty(&self, from_s: f64, to_s: f64) -> f64 {
        let length = to_s - from_s;
        let walk = self.angle_walk.powi(2);
        let variance = match self.seen.as_slice() {
            [first, last] => {
                let apart = last.middle_s - first.middle_s;
                let second = if length > 0.0 { change(&self.come, from_s, to_s) / length } else { 0.0 };
                let unknown = (1.0 - second).powi(2) * first.unknown + second.powi(2) * last.unknown;
                let strays = |axis: usize| {
                    let changed = (last.rates[axis] - first.rates[axis]).powi(2);
                    let walked =
                        if self.warms { UNLIKE.powi(2) * changed + BIAS_WALK.powi(2) * apart } else { changed };
                    walked * apart.powi(2) / 12.0
                };
                let lean = if length > 0.0 { change(&self.leaned, from_s, to_s) / length } else { 0.0 };
                let lateral = TILT_NOISE * walk * length.powi(2) * unknown + strays(1);
                walk * (length + length.powi(2) * unknown) + strays(0) + lean.powi(2) * lateral
            }
            [first] => {
                let reach = (to_s - first.middle_s).abs().max((from_s - first.middle_s).abs());
                walk * (length + length.powi(2) * first.unknown) + BIAS_WALK.powi(2) * reach.powi(3) / 3.0
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
    use nalgebra::UnitQuaternion;

    #[test]
    fn students_quantile_is_that_of_the_tables() {
        for (freedom, expected) in [(4.0, 2.776), (8.0, 2.306), (23.0, 2.069), (1000.0, 1.962)] {
            assert!((student_95(freedom) / expected - 1.0).abs() < 0.01, "{freedom}");
        }
    }

    /// A trial of 170 s at 200 Hz, with a run from 20 s to 140 s: time to rates of the bias about z and y (°/s), roll
    /// (degrees) and temperature (°C).
    fn trial(at: impl Fn(f64) -> (f64, f64, f64, f64)) -> Series {
        let mut series = Series::default();
        let mut yaw = 0.0;
        for i in 0..=34_000 {
            let (z, y, roll, temperature_c) = at(f64::from(i) * 0.005);
            let (sine, cosine) = roll.to_radians().sin_cos();
            let attitude = UnitQuaternion::from_euler_angles(roll.to_radians(), 0.0, f64::to_radians(yaw));
            let q = attitude.into_inner();
            series
                .push(f64::from(i) * 0.005, &Reading { attitude: [q.w, q.i, q.j, q.k], rate_y_dps: y, temperature_c });
            yaw += (z * cosine + y * sine) * 0.005;
        }
        series
    }

    /// Drift over the run that is seen, and that there was.
    fn drifts(series: &Series) -> (Drift, f64) {
        let drift = Drift::seen(series, 0.0..20.0, 140.0..170.0).unwrap();
        assert_eq!(drift.still.len(), 2);
        let measured = series.yaw.at(140.0).unwrap() - series.yaw.at(20.0).unwrap();
        (drift, measured)
    }

    #[test]
    fn a_steady_change_of_the_bias_is_taken_out_whole() {
        let (drift, measured) = drifts(&trial(|t| (0.02 + 1e-4 * t, 0.0, 0.0, 25.0)));
        // But for what the second phase is weighed down by: its noise is never taken for none.
        assert!((measured - drift.between(20.0, 140.0)).abs() < 1e-3);
    }

    #[test]
    fn a_bias_follows_the_temperature_and_turns_a_leaning_robot() {
        let warm = |t: f64| 1.0 - (-t / 60.0).exp();
        let lean = |t: f64| if (20.0..140.0).contains(&t) { 18.0 } else { 0.0 };
        let series = trial(|t| (0.02 + 0.05 * warm(t), -0.03 + 0.04 * warm(t), lean(t), 25.0 + 1.5 * warm(t)));
        let (drift, measured) = drifts(&series);
        let left = measured - drift.between(20.0, 140.0);
        // Along straight lines it would be 0.7, and 1.1 without the lean.
        assert!(left.abs() < 0.05, "{left} of {measured}");
        assert!(drift.uncertainty(20.0, 140.0) < 1.0, "{}", drift.uncertainty(20.0, 140.0));
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
