//! Finds the zero of a trial.
//!
//! A measured attitude is levelled by the accelerometer's vertical at rest ([`crate::attitude::Level`]), expressed
//! relative to the mean attitude of the still phase, and corrected for the gyroscope's drift ([`Drift`]). The sensor's
//! filter delays the attitude, so its times are moved back by that delay. A modelled attitude is exact: the robot
//! starts upright with a yaw of zero, and there is no gyroscope to drift. An imported attitude is also relative to its
//! rest; the import states its errors.

use super::data::Data;
use super::errors::{self, Errors};
use super::imported::Stated;
use super::rest::{AtRest, START_S};
use super::rest_fit::end_of;
use super::righting::{left_deg, righting_s, time_constants};
use super::sensitivity::Sensitivities;
use super::tilt_zero::TiltZero;
use super::zero::{Known, Zeroed};
use super::{back_at_zero, import_rest};
use crate::attitude::{Columns, Drift, Level, Leveller, Reading, Rest, Series, Track, euler_deg, rotation};
use biflag_log::Origin;
use nalgebra::{UnitQuaternion, Vector3};
use protocol::units::LOW_PASS;
use sim::body::attitude::of_euler_zyx;
use sim::functions::hypot;
use std::ops::Range;

/// Smallest gain of the board's filter distinguished from zero, 1/s.
const MIN_GAIN: f64 = 0.01;

/// Longest gap in the readings at the start of the run that hides no motion, s.
const MAX_GAP_S: f64 = 0.05;

impl Zeroed {
    /// Computes the attitude of a trial. `after` is the time range in which the robot may be still again.
    pub(super) fn with_end(data: &Data, after: Range<f64>) -> Self {
        let mut zeroed = match data.origin() {
            Origin::Model => Self::modelled(data),
            Origin::Imported => Self::imported(data),
            Origin::Rig | Origin::VirtualRig => Self::measured(data, after),
        };
        zeroed.steady = zeroed.steady(data);
        zeroed
    }

    fn modelled(data: &Data) -> Self {
        let mut series = Series::default();
        data.readings.iter().for_each(|(time, reading)| series.push(*time, reading));
        Self {
            angles_deg: Columns {
                time_s: data.truth.time_s.clone(),
                values: [0, 1, 2].map(|k| data.truth.values[k].clone()),
            },
            run: data.times.run.clone(),
            from_s: data.times.run.start,
            turned_deg: series.turned_deg(),
            ..Self::default()
        }
    }

    fn measured(data: &Data, after: Range<f64>) -> Self {
        let run = data.times.run.clone();
        let readings = levelled(data);
        let first = readings.first().map_or(0.0, |(time, _)| *time);
        // If readings are lost around the start of the run, the still phase ends with the last one before the gap: the
        // robot moves during the gap, and the zero must not include this motion.
        let started = gap_at(&readings, run.start).filter(|gap| gap.end - gap.start > MAX_GAP_S);
        let rest_end = started.as_ref().map_or(run.start, |gap| gap.start);
        let still = data.times.preroll.start.max(first).min(rest_end)..rest_end;
        let has_still = still.end - still.start >= START_S;
        let settled = end_of(&still);
        let (mean_over, tilt_over) = if has_still {
            (still.clone(), settled.start.max(0.5 * (still.start + still.end))..still.end)
        } else {
            (run.start..run.start, run.start - 0.1..run.start + 0.1)
        };
        let tilt = if data.times.has_run() { mean(&readings, &tilt_over) } else { None };
        let [_, pitch_deg, roll_deg] = euler_deg(&tilt.unwrap_or_default());
        // The sensor is mounted askew in the body: measured = true * askew. The zero of the yaw is not part of `askew`.
        let askew = of_euler_zyx([0.0, pitch_deg.to_radians(), roll_deg.to_radians()]);
        let mut series = Series::new(data.settings().is_some_and(|settings| settings.attitude_ki != 0.0));
        for (time, reading) in &readings {
            let q = (rotation(reading.attitude) * askew.inverse()).into_inner();
            series.push(*time, &Reading { attitude: [q.w, q.i, q.j, q.k], ..*reading });
        }
        // A calibration during which the board moved is not used.
        let is_calibrated = data.records.calibration.as_ref().is_none_or(|calibration| calibration.still);
        let calibrate_s = if is_calibrated { data.trial().calibrate_s } else { 0.0 };
        let start = (mean_over.end - START_S).max(mean_over.start)..mean_over.end;
        let from_s = 0.5 * (start.start + start.end);
        let filter_s = data.settings().map_or(1.0, |settings| 1.0 / f64::from(settings.attitude_kp).max(MIN_GAIN));
        let sensor = data.sensor();
        let constants = time_constants(data);
        let phases = Rest {
            before: still,
            after,
            calibrate_s,
            filter_s,
            bias_noise: sensor.bias_noise,
            angle_walk: sensor.angle_walk(),
            time_constant_s: constants.map(|constants| constants.yaw_s).filter(|yaw_s| yaw_s.is_finite()),
        };
        let drift = if data.times.has_run() { Drift::estimate(&series, &phases, from_s) } else { None };
        let yaw_zero = if data.times.has_run() { series.yaw().mean(start).unwrap_or(0.0) } else { 0.0 };
        let tilts = [series.pitch(), series.roll()];
        let righting_s = righting_s(constants);
        let waited_deg = left_deg(data.records.rest.as_ref(), righting_s, &tilt_over);
        let tilt_zero = || TiltZero::of(tilts, &phases.before, &tilt_over, [filter_s, righting_s], waited_deg);
        let tilt_zero = if has_still { tilt_zero() } else { None };
        let mut rest = AtRest::new(data, &series, &phases, has_still, drift.as_ref());
        rest.lost = started.filter(|_| data.times.has_run());
        let levelled_away = level_of(data).map_or([0.0; 2], |level| level.angles_deg());
        let turned_deg = series.turned_deg();
        let mut sensitivities = Sensitivities::new(filter_s, sensor.mounting());
        let zero_c = errors::zero_c(series.temperature(), from_s);
        for (time, reading) in &readings {
            let attitude = rotation(reading.attitude) * askew.inverse();
            sensitivities.push(*time, attitude, reading.temperature_c - zero_c);
        }
        let errors = Errors::new(data, sensitivities, series.temperature(), from_s, filter_s, drift, tilt_zero);
        let mut angles_deg = series.angles_deg;
        errors.correct(&mut angles_deg, yaw_zero);
        if let Some(budget) = errors.yaw(angles_deg.span().end) {
            let yaw_s = constants.map_or(f64::INFINITY, |constants| constants.yaw_s);
            let yaw = ("yaw", [angles_deg.track(0); 2], budget.uncertainty_deg(), yaw_s);
            rest.not_back = back_at_zero::not_back(data, [yaw]);
        }
        Self {
            angles_deg,
            zero_deg: [yaw_zero, pitch_deg + levelled_away[0], roll_deg + levelled_away[1]],
            run,
            from_s,
            turned_deg,
            rest,
            known: Known::Sensor(Box::new(errors)),
            ..Self::default()
        }
    }

    /// The zero is the mean attitude of the last second before the run. Without it, the yaw is zero at the start of the
    /// run, and pitch and roll are the table's.
    fn imported(data: &Data) -> Self {
        let run = data.times.run.clone();
        let still = data.times.preroll.start.max(run.start - START_S)..run.start;
        let has_still = still.end - still.start > 0.5 * START_S;
        let zero = mean(&data.readings, &still).filter(|_| has_still && data.times.has_run());
        let [yaw_deg, pitch_deg, roll_deg] = euler_deg(&zero.unwrap_or_default());
        let askew = of_euler_zyx([0.0, pitch_deg.to_radians(), roll_deg.to_radians()]);
        let mut series = Series::default();
        for (time, reading) in &data.readings {
            let q = (rotation(reading.attitude) * askew.inverse()).into_inner();
            series.push(*time, &Reading { attitude: [q.w, q.i, q.j, q.k], ..*reading });
        }
        let from_s = if zero.is_some() { 0.5 * (still.start + still.end) } else { run.start };
        let yaw_zero = if zero.is_some() { series.yaw().mean(still.clone()) } else { series.yaw().at(run.start) };
        let yaw_zero = yaw_zero.unwrap_or(yaw_deg);
        let turned_deg = series.turned_deg();
        let mut angles_deg = series.angles_deg;
        let motion = import_rest::moved(angles_deg.tracks(), &data.times.preroll);
        angles_deg.values[0].iter_mut().for_each(|yaw| *yaw -= yaw_zero);
        // Without a rest before the run, the error of the zero is unknown, and the stated errors do not contain it.
        let stated = Stated::of(data.records.import.as_ref(), &angles_deg, &still).filter(|_| zero.is_some());
        let not_back = |_| {
            let constants = time_constants(data);
            let [_, pitch, roll] = angles_deg.tracks();
            let tilt: Vec<f64> = (0..angles_deg.len()).map(|i| hypot(pitch.value[i], roll.value[i])).collect();
            let angles = [0, 1, 2].map(|k| {
                let whole = if k == 0 { angles_deg.track(0) } else { Track { value: &tilt, ..pitch } };
                let stated_deg = stated.and_then(|of| of.budget(k)).map_or(0.0, |budget| budget.uncertainty_deg());
                let constant_s = constants.map_or(f64::INFINITY, |of| if k == 0 { of.yaw_s } else { of.tilt_s });
                (["yaw", "pitch", "roll"][k], [angles_deg.track(k), whole], stated_deg, constant_s)
            });
            back_at_zero::not_back(data, angles)
        };
        let (is_missing, not_back) = (zero.is_none() && data.times.has_run(), zero.and_then(not_back));
        let rest = AtRest { is_missing, not_back, motion, ..AtRest::default() };
        Self {
            angles_deg,
            zero_deg: [yaw_zero, pitch_deg, roll_deg],
            run,
            from_s,
            turned_deg,
            rest,
            known: Known::Stated(stated),
            ..Self::default()
        }
    }
}

/// Returns the readings since the calibration, levelled, with the delay of the sensor's filter removed from their
/// times.
fn levelled(data: &Data) -> Vec<(f64, Reading)> {
    let settings = data.settings();
    let delay_s = settings.map_or(0.0, |settings| LOW_PASS[usize::from(settings.low_pass).min(LOW_PASS.len() - 1)].1);
    let mut readings = data.readings[data.calibrated..].to_vec();
    // The known mounting turns with the body; the filter does not follow it.
    let mounting = data.sensor().mounting();
    let level = level_of(data).map(|level| level.turned(mounting));
    let begun = data.phases.iter().find(|(name, _)| name == "run").map(|(_, start)| *start);
    let run_s = begun.or(data.times.has_run().then_some(data.times.run.start)).unwrap_or(f64::INFINITY);
    let mut leveller = level.map(|level| Leveller::new(&level, settings.unwrap_or_default().attitude_kp.into()));
    for (time, reading) in &mut readings {
        let attitude = rotation(reading.attitude) * mounting.inverse();
        // At rest the filter has settled on the bias.
        let is_moving = *time > run_s - 1e-6;
        let q = match (&mut leveller, &level) {
            (Some(leveller), _) if is_moving => leveller.levelled(attitude, *time),
            (_, Some(level)) => level.levelled(attitude),
            _ => attitude,
        };
        reading.attitude = [q.w, q.i, q.j, q.k];
    }
    // The sensor's filter delays the attitude; the encoders have no delay.
    readings.iter_mut().for_each(|(time, _)| *time -= delay_s);
    readings
}

/// Returns the level removed from the attitude, if there is one.
fn level_of(data: &Data) -> Option<Level> {
    let level = data.records.level.as_ref().filter(|level| level.used)?;
    Some(Level { up: Vector3::from(level.up), force_g: level.force_g })
}

/// Returns the interval between the readings around a time, or from the last reading to that time.
fn gap_at(readings: &[(f64, Reading)], time_s: f64) -> Option<Range<f64>> {
    let after = readings.partition_point(|(time, _)| *time <= time_s);
    let last = readings[..after].last()?.0;
    Some(last..readings.get(after).map_or(time_s, |(time, _)| *time))
}

/// Returns the mean attitude over a range of time. The attitudes must be within a few degrees of each other.
pub(super) fn mean(readings: &[(f64, Reading)], range: &Range<f64>) -> Option<UnitQuaternion<f64>> {
    let mut inside = readings.iter().filter(|(time, _)| range.contains(time)).map(|(_, r)| rotation(r.attitude));
    let first = inside.next()?;
    let signed = |q: UnitQuaternion<f64>| if q.dot(&first) < 0.0 { -q.into_inner() } else { q.into_inner() };
    Some(UnitQuaternion::from_quaternion(inside.fold(*first.quaternion(), |sum, q| sum + signed(q))))
}
