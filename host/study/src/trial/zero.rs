//! The attitude of a trial relative to its zero: levelled, relative to the still phase before the run, with the drift
//! of the yaw removed; and its uncertainty.
//!
//! A measured attitude is levelled by the accelerometer's vertical at rest ([`crate::attitude::Level`]), referred to
//! the mean attitude of the still phase, and corrected for the gyroscope's drift ([`Drift`]). The sensor's filter
//! delays the attitude, so its times are moved back by that delay. A modelled attitude is exact: the robot starts
//! upright with a yaw of zero, and there is no gyroscope to drift.

use super::data::Data;
use super::finding::{Finding, FindingKind};
use crate::attitude::{Columns, Drift, Euler, Level, Leveller, Reading, Series, Track, rotation};
use biflag_log::{SteadyMeta, Summary};
use nalgebra::{UnitQuaternion, Vector3};
use protocol::units::{CentiRpm, LOW_PASS};
use serde::Serialize;
use sim::steady::{CHANNELS, SteadyCollector};
use std::f64::consts::PI;
use std::ops::Range;

/// The zero of the yaw is its mean over this duration at the end of the still phase, s.
const START_S: f64 = 1.0;

/// The zero of the tilt is its mean over this duration at the end of the still phase, but at most over its second half,
/// s: earlier the robot may still swing, and the filter settles after the gyroscope's calibration. The noise of the tilt
/// is its scatter over the whole duration.
const TILT_ZERO_S: f64 = 10.0;

/// Longest gap between the last reading of the still phase and the start of the run, s.
const MAX_GAP_S: f64 = 0.25;

/// Length of the blocks whose scatter is the noise of a tilt, s.
const BLOCK_S: f64 = 2.0;

/// Smallest 95 % uncertainty of a mean tilt of a rig, degrees.
///
/// The zero removes the accelerometer's offsets, but not the errors that change with the tilt: its axes differ in
/// sensitivity and are not exactly orthogonal (cross-axis sensitivity 2 %, MPU-6000A data sheet, section 6.2), which is
/// 0.1 degrees for a tilt of 5.
const TILT_FLOOR_DEG: f64 = 0.1;

/// Time in which a motor stops and turns the other way, s.
const REVERSAL_S: f64 = 1.0;

/// Largest change of the tilt at the end of a still phase, degrees.
const STILL_DEG: f64 = 0.5;

/// The mean attitude at the end of the run.
#[derive(Clone, PartialEq, Debug)]
pub struct Steady {
    /// Yaw, pitch, roll.
    pub angles_deg: [f64; 3],
    /// 95 % uncertainty of the yaw; `None` without a still phase, 0 for a model.
    pub yaw_uncertainty_deg: Option<f64>,
    /// 95 % uncertainty of pitch and roll; `None` without a still phase, 0 for a model.
    pub tilt_uncertainty_deg: Option<[f64; 2]>,
    /// The drift that was removed from the yaw; `None` for a model.
    pub drift_deg: Option<f64>,
    /// The time over which the angles are averaged: see [`sim::steady`].
    pub window: Range<f64>,
    /// Whether yaw and pitch had settled.
    pub settled: bool,
    /// When they had, s from the start of the run; not known where the model has solved for the steady state.
    pub settle_s: Option<f64>,
}

/// The steady angles of a trial, as stated by every command.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Angles {
    /// Steady yaw relative to the rest before the run, corrected for drift.
    pub yaw_deg: f64,
    /// 95 % uncertainty of the yaw from drift and noise of the gyroscope, and from the levelling; `None` for a model,
    /// and without a still phase.
    pub yaw_uncertainty_deg: Option<f64>,
    /// Steady pitch.
    pub pitch_deg: f64,
    /// Steady roll.
    pub roll_deg: f64,
    /// The drift that was removed from the yaw; `None` for a model.
    pub drift_deg: Option<f64>,
    /// Duration for which the robot was still after the run; `None` for a model.
    pub still_after_s: Option<f64>,
    /// Time over which the angles are averaged.
    pub steady_s: f64,
    /// Whether yaw and pitch had settled before that time.
    pub settled: bool,
    /// Angle turned about each body axis over the whole trial.
    pub turned_deg: [f64; 3],
}

impl Angles {
    /// Copies the angles into a summary.
    pub fn fill(&self, summary: &mut Summary) {
        summary.yaw_deg = Some(self.yaw_deg);
        summary.yaw_uncertainty_deg = self.yaw_uncertainty_deg;
        summary.pitch_deg = Some(self.pitch_deg);
        summary.roll_deg = Some(self.roll_deg);
    }
}

/// The attitude of a trial relative to its zero. Times are those of the log.
#[derive(Clone, Debug)]
pub struct Zeroed {
    /// Yaw (unwrapped), pitch, roll, degrees.
    pub angles_deg: Columns<3>,
    /// The zero that was subtracted: yaw, pitch, roll, degrees. All zero for a model.
    pub zero_deg: [f64; 3],
    /// The run.
    pub run: Range<f64>,
    /// Time at which the yaw is zero, s.
    pub from_s: f64,
    /// Drift of the yaw; `None` without a still phase, and for a model.
    pub drift: Option<Drift>,
    /// Angle turned about each body axis since the gyroscope was calibrated, degrees.
    pub turned_deg: [f64; 3],
    /// The steady end of the run; `None` if there is no attitude in the run.
    pub steady: Option<Steady>,
    /// Findings about the still phases.
    pub rest: Vec<Finding>,
    /// The tilt that levelling removed, degrees.
    levelled_deg: f64,
    is_model: bool,
    /// Whether a finding takes all uncertainties away.
    is_unsure: bool,
    /// Standard deviation of the block means of pitch and roll in the still phase, and the number of blocks.
    tilt_scatter: Option<([f64; 2], usize)>,
}

impl Zeroed {
    /// Computes the attitude of a trial.
    pub fn new(data: &Data) -> Self {
        Self::with_end(data, data.times.decay.clone())
    }

    /// Computes the attitude of a trial with the drift of the still phase before the run alone.
    pub fn from_rest(data: &Data) -> Self {
        Self::with_end(data, data.duration_s..data.duration_s)
    }

    /// `after` is the time in which the robot may be still again.
    fn with_end(data: &Data, after: Range<f64>) -> Self {
        let mut zeroed = if data.is_model() { Self::modelled(data) } else { Self::measured(data, after) };
        zeroed.steady = zeroed.steady(data);
        zeroed.is_unsure = super::findings(data, &zeroed).iter().any(Finding::empties_uncertainty);
        if let Some(steady) = zeroed.steady.as_mut().filter(|_| zeroed.is_unsure) {
            (steady.yaw_uncertainty_deg, steady.tilt_uncertainty_deg) = (None, None);
        }
        zeroed
    }

    fn modelled(data: &Data) -> Self {
        let [yaw, pitch, roll, ..] = data.truth.values.clone();
        let mut series = Series::default();
        data.readings.iter().for_each(|(time, reading)| series.push(*time, reading));
        Self {
            angles_deg: Columns { time_s: data.truth.time_s.clone(), values: [yaw, pitch, roll] },
            zero_deg: [0.0; 3],
            run: data.times.run.clone(),
            from_s: data.times.run.start,
            drift: None,
            turned_deg: series.turned_deg(),
            steady: None,
            rest: Vec::new(),
            levelled_deg: 0.0,
            is_model: true,
            is_unsure: false,
            tilt_scatter: None,
        }
    }

    fn measured(data: &Data, after: Range<f64>) -> Self {
        let run = data.times.run.clone();
        let readings = levelled(data);
        let mut rest = Vec::new();
        let first = readings.first().map_or(0.0, |(time, _)| *time);
        // If readings are lost before the run, the still phase ends with the last one.
        let last = readings.iter().rev().find(|(time, _)| *time <= run.start).map_or(run.start, |(time, _)| *time);
        let rest_end = if run.start - last > MAX_GAP_S { last } else { run.start };
        let still = data.times.preroll.start.max(first).min(rest_end)..rest_end;
        let has_still = still.end - still.start >= START_S;
        let settled = (still.end - TILT_ZERO_S).max(still.start)..still.end;
        let (mean_over, tilt_over) = if has_still {
            (still.clone(), settled.start.max(0.5 * (still.start + still.end))..still.end)
        } else {
            if data.times.has_run() && data.speeds() != [CentiRpm(0); 2] {
                let text = "there is no still phase before the run: the zero is the attitude at its start, and the \
                            uncertainty of the yaw is unknown";
                rest.push(Finding::slight(FindingKind::Rest, text, "give the plan a pre-roll of 20 s"));
            }
            (run.start..run.start, run.start - 0.1..run.start + 0.1)
        };
        let tilt = if data.times.has_run() { mean(&readings, &tilt_over) } else { None };
        let zero = Euler::of(&tilt.unwrap_or_default());
        // The sensor is mounted askew in the body: measured = true * askew. The zero of the yaw is not part of it.
        let askew = UnitQuaternion::from_euler_angles(zero.roll_deg.to_radians(), zero.pitch_deg.to_radians(), 0.0);
        let mut series = Series::new(data.settings().is_some_and(|settings| settings.attitude_ki != 0.0));
        for (time, reading) in &readings {
            let q = (rotation(reading.attitude) * askew.inverse()).into_inner();
            series.push(*time, &Reading { attitude: [q.w, q.i, q.j, q.k], ..*reading });
        }
        // A calibration in which the board moved is not used.
        let is_calibrated = data.records.calibration.as_ref().is_none_or(|calibration| calibration.still);
        let calibrate_s = if is_calibrated { data.trial().calibrate_s } else { 0.0 };
        let drift = if data.times.has_run() { Drift::estimate(&series, still, after, calibrate_s) } else { None };
        if drift.as_ref().is_some_and(|drift| drift.lateral(run.start, run.end).is_none()) {
            let text = "the gyroscope was not calibrated, and the still phases are too short to show its bias about the \
                        body's x and y: the uncertainty of the yaw is unknown";
            rest.push(Finding::slight(FindingKind::Rest, text, "give the plan a calibration of 5 s"));
        }
        let start = (mean_over.end - START_S).max(mean_over.start)..mean_over.end;
        let from_s = 0.5 * (start.start + start.end);
        let yaw_zero = if data.times.has_run() { series.yaw().mean(start).unwrap_or(0.0) } else { 0.0 };
        let tilts = [series.pitch(), series.roll()];
        let tilt_scatter = if has_still { scatter(tilts, &settled) } else { None };
        if let Some(strayed) = has_still.then(|| strayed(tilts, &settled)).flatten()
            && strayed > STILL_DEG
        {
            let text = format!("the robot was not still before the run: its tilt changed by {strayed:.1} degrees");
            rest.push(Finding::grave(FindingKind::Rest, text, "let it hang for longer before the trial"));
        }
        let level = level_of(data);
        let levelled_away = level.map_or([0.0; 2], |level| level.angles_deg());
        let turned_deg = series.turned_deg();
        let Columns { time_s, values: [mut yaw, pitch, roll] } = series.angles_deg;
        for (time, yaw) in time_s.iter().zip(&mut yaw) {
            *yaw -= yaw_zero + drift.as_ref().map_or(0.0, |drift| drift.between(from_s, *time));
        }
        Self {
            angles_deg: Columns { time_s, values: [yaw, pitch, roll] },
            zero_deg: [yaw_zero, zero.pitch_deg + levelled_away[0], zero.roll_deg + levelled_away[1]],
            run,
            from_s,
            drift,
            turned_deg,
            steady: None,
            rest,
            levelled_deg: level.map_or(0.0, |level| level.tilt_deg()),
            is_model: false,
            is_unsure: false,
            tilt_scatter,
        }
    }

    /// Returns the time range of the angles.
    pub fn span(&self) -> Range<f64> {
        self.angles_deg.span()
    }

    /// Returns yaw, pitch and roll at a time, degrees.
    pub fn at(&self, time_s: f64) -> [f64; 3] {
        self.angles_deg.at(time_s)
    }

    /// Returns the part of the run in which there are angles.
    pub fn seen_run(&self) -> Range<f64> {
        let span = self.span();
        self.run.start.max(span.start)..self.run.end.min(span.end)
    }

    /// Returns the steady angles; `None` if there is no attitude in the run.
    pub fn angles(&self) -> Option<Angles> {
        let steady = self.steady.as_ref()?;
        let [yaw_deg, pitch_deg, roll_deg] = steady.angles_deg;
        let after = self.drift.iter().flat_map(|drift| &drift.still).find(|still| still.start >= self.run.end);
        Some(Angles {
            yaw_deg,
            yaw_uncertainty_deg: steady.yaw_uncertainty_deg.filter(|_| !self.is_model),
            pitch_deg,
            roll_deg,
            drift_deg: steady.drift_deg,
            still_after_s: (!self.is_model).then(|| after.map_or(0.0, |still| still.end - still.start)),
            steady_s: steady.window.end - steady.window.start,
            settled: steady.settled,
            turned_deg: self.turned_deg,
        })
    }

    /// Returns the steady end of the run. For a model it is computed by the solver, from every step.
    fn steady(&self, data: &Data) -> Option<Steady> {
        let run = self.seen_run();
        if run.end <= run.start {
            return None;
        }
        let speeds = data.speeds().map(|speed| speed.rpm() * PI / 30.0);
        let reversed_s = data.reverse().map_or(run.start, |(_, after_s)| self.run.start + after_s + REVERSAL_S);
        let mut collector = SteadyCollector::after_reversal(run.start, reversed_s, run.end, speeds);
        let times = &self.angles_deg.time_s;
        let inside = times.partition_point(|t| *t <= run.start)..times.partition_point(|t| *t < run.end);
        let ends = [run.start, run.end].map(|time| (time, self.at(time)));
        let rows = inside.map(|i| (times[i], self.angles_deg.row(i)));
        for (time, angles) in std::iter::once(ends[0]).chain(rows).chain(std::iter::once(ends[1])) {
            let mut values = [0.0; CHANNELS];
            values[..3].copy_from_slice(&angles.map(f64::to_radians));
            collector.push(time, values);
        }
        let steady = collector.steady();
        let window = run.end - steady.window_s..run.end;
        let middle = 0.5 * (window.start + window.end);
        let own = data.records.steady.as_ref().filter(|_| self.is_model);
        let (angles_deg, settled, settle_s, window) = match own {
            Some(SteadyMeta { yaw_deg, pitch_deg, roll_deg, settled, settle_s, window_s, kind, .. }) => {
                let window = self.run.end - window_s..self.run.end;
                let settle_s = (*settled && kind.is_none()).then_some(*settle_s);
                ([*yaw_deg, *pitch_deg, *roll_deg], *settled, settle_s, window)
            }
            None => {
                let angles = steady.attitude.map(|level| level.mean.to_degrees());
                (angles, steady.settled, steady.settled.then_some(steady.settle_s), window)
            }
        };
        Some(Steady {
            angles_deg,
            yaw_uncertainty_deg: self.yaw_uncertainty(middle),
            tilt_uncertainty_deg: self.tilt_uncertainty(window.end - window.start),
            drift_deg: (!self.is_model).then(|| self.yaw_drift(middle)),
            window,
            settled,
            settle_s,
        })
    }

    /// Returns the 95 % uncertainty of the yaw at a time, degrees; `None` without a still phase or a known bias, 0 for a
    /// model.
    pub fn yaw_uncertainty(&self, time_s: f64) -> Option<f64> {
        // A zero that is no rest, for one, has no uncertainty that could be stated.
        if self.is_unsure {
            return None;
        }
        if self.is_model {
            return Some(0.0);
        }
        let drift = self.drift.as_ref()?.uncertainty(self.from_s.min(time_s), self.from_s.max(time_s))?;
        Some(drift.hypot(self.levelling_uncertainty(time_s)))
    }

    /// Returns the 95 % uncertainty of the yaw at a time due to the levelling, degrees.
    ///
    /// The tilt at rest is attributed to the accelerometer's bias. The part of it that is due to the sensor's mounting
    /// tilts the gyroscope too, so that the yaw of a leaning robot is wrong by up to the tilt times the sine of the
    /// lean.
    pub fn levelling_uncertainty(&self, time_s: f64) -> f64 {
        let [_, pitch, roll] = self.at(time_s);
        let upright = pitch.to_radians().cos() * roll.to_radians().cos();
        self.levelled_deg * (1.0 - upright * upright).max(0.0).sqrt()
    }

    /// Returns the standard deviation of the effect on the yaw of the sensor's usual warming since the still phase,
    /// degrees.
    pub fn warming(&self, time_s: f64) -> f64 {
        self.drift.as_ref().map_or(0.0, |drift| drift.warming(self.from_s, time_s))
    }

    /// Returns the angle random walk of the yaw (°/√s), the length of the still phase that gives its bias (s), and the
    /// variances of the zeros of pitch and roll (degrees²); `None` without a still phase. A model counts as a quiet
    /// sensor.
    pub fn noise(&self) -> Option<(f64, f64, [f64; 2])> {
        if self.is_model {
            return Some((1e-4, 20.0, [1e-8; 2]));
        }
        let drift = self.drift.as_ref()?;
        let still = drift.still.first()?;
        let (scatter, count) = self.tilt_scatter?;
        // The filter's noise has a correlation time of about a second, so that neighbouring blocks are slightly
        // correlated.
        let independent = 0.5 * (count as f64).min(TILT_ZERO_S / BLOCK_S);
        // The floor is a 95 % bound; it covers a robot that still swings back a little.
        let zero = |deg: f64| deg * deg / independent + (0.5 * TILT_FLOOR_DEG).powi(2);
        Some((drift.angle_walk, still.end - still.start, scatter.map(zero)))
    }

    /// Returns the standard deviations of the effect on the yaw of biases about the body's x and y that no still phase
    /// shows, degrees; `None` if they are unknown.
    pub fn lateral(&self, time_s: f64) -> Option<[f64; 2]> {
        self.drift.as_ref().map_or(Some([0.0; 2]), |drift| drift.lateral(self.from_s, time_s))
    }

    /// Returns the drift that was removed from the yaw at a time, degrees.
    pub fn yaw_drift(&self, time_s: f64) -> f64 {
        self.drift.as_ref().map_or(0.0, |drift| drift.between(self.from_s, time_s))
    }

    /// Returns the 95 % uncertainty of mean pitch and roll over `window_s`, degrees; `None` without a still phase, 0
    /// for a model.
    pub fn tilt_uncertainty(&self, window_s: f64) -> Option<[f64; 2]> {
        if self.is_unsure {
            return None;
        }
        if self.is_model {
            return Some([0.0; 2]);
        }
        let (scatter, count) = self.tilt_scatter?;
        let means = BLOCK_S / window_s.max(BLOCK_S) + 1.0 / (count as f64).min(TILT_ZERO_S / BLOCK_S);
        // Student's two-sided 95 % quantile for the blocks of a short still phase is near 2.5.
        Some(scatter.map(|deg| (2.5 * deg * means.sqrt()).hypot(TILT_FLOOR_DEG)))
    }
}

/// Returns the readings since the calibration, levelled, with the delay of the sensor's filter removed from their
/// times.
fn levelled(data: &Data) -> Vec<(f64, Reading)> {
    let settings = data.settings();
    let delay_s = settings.map_or(0.0, |settings| LOW_PASS[usize::from(settings.low_pass).min(LOW_PASS.len() - 1)].1);
    let mut readings = data.readings[data.calibrated..].to_vec();
    if let Some(level) = level_of(data) {
        let begun = data.phases.iter().find(|(name, _)| name == "run").map(|(_, start)| *start);
        let run_s = begun.or(data.times.has_run().then_some(data.times.run.start)).unwrap_or(f64::INFINITY);
        let mut leveller = Leveller::new(&level, settings.unwrap_or_default().attitude_kp.into());
        for (time, reading) in &mut readings {
            let attitude = rotation(reading.attitude);
            // At rest the bias has passed the filter.
            let is_moving = *time > run_s - 1e-6;
            let q = if is_moving { leveller.levelled(attitude, *time) } else { level.levelled(attitude) };
            reading.attitude = [q.w, q.i, q.j, q.k];
        }
    }
    // The sensor's filter delays the attitude; the encoders have no delay.
    readings.iter_mut().for_each(|(time, _)| *time -= delay_s);
    readings
}

/// Returns the level that is removed from the attitude, if there is one.
fn level_of(data: &Data) -> Option<Level> {
    let level = data.records.level.as_ref().filter(|level| level.used)?;
    Some(Level { up: Vector3::from(level.up), force_g: level.force_g })
}

/// Returns the mean attitude over a range of time. The attitudes must be within a few degrees of each other.
fn mean(readings: &[(f64, Reading)], range: &Range<f64>) -> Option<UnitQuaternion<f64>> {
    let mut inside = readings.iter().filter(|(time, _)| range.contains(time)).map(|(_, r)| rotation(r.attitude));
    let first = inside.next()?;
    let sum =
        inside.fold(
            *first.quaternion(),
            |sum, q| {
                if q.dot(&first) < 0.0 { sum - q.into_inner() } else { sum + q.into_inner() }
            },
        );
    Some(UnitQuaternion::from_quaternion(sum))
}

/// Returns the mean of each block of a range, counted from its end.
fn blocks(track: Track, range: &Range<f64>) -> Vec<f64> {
    let count = ((range.end - range.start) / BLOCK_S + 1e-6).floor() as usize;
    (0..count)
        .filter_map(|i| track.mean(range.end - (i + 1) as f64 * BLOCK_S..range.end - i as f64 * BLOCK_S))
        .collect()
}

fn scatter(tilts: [Track; 2], still: &Range<f64>) -> Option<([f64; 2], usize)> {
    let blocks = tilts.map(|tilt| blocks(tilt, still));
    let count = blocks[0].len();
    let deviation = |means: &Vec<f64>| {
        let mean = means.iter().sum::<f64>() / count as f64;
        (means.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count as f64 - 1.0)).sqrt()
    };
    (count >= 3).then(|| (blocks.each_ref().map(deviation), count))
}

/// Returns the largest difference between two blocks.
fn strayed(tilts: [Track; 2], still: &Range<f64>) -> Option<f64> {
    let range = |values: Vec<f64>| {
        let low = values.iter().copied().reduce(f64::min)?;
        values.into_iter().reduce(f64::max).map(|high| high - low)
    };
    let [pitch, roll] = tilts.map(|tilt| range(blocks(tilt, still)));
    Some(pitch?.max(roll?))
}
