//! Checks whether gyroscope and accelerometer have the same axes.
//!
//! The board's filter adds the gyroscope's rates, and turns the attitude towards the vertical of the accelerometer. If
//! both have the same axes, these corrections are small: they only remove a bias. Otherwise the corrections undo every
//! tilt that the gyroscope reports. Their sum is the gyroscope's rotation about the body's x and y, minus the
//! attitude's.

use crate::attitude::rotation;
use crate::trial::data::Data;
use sim::body::attitude::rotation_between;
use sim::functions::hypot;
use std::ops::Range;

/// Checked part of the run, s, in which the robot tilts.
const SEEN_S: f64 = 10.0;

/// Part of the rest that shows the bias of the rates, s.
const REST_S: f64 = 5.0;

/// Correction that noise, a bias of 0.1 °/s and an offset of the accelerometer may cause, degrees.
const ALLOWED_DEG: f64 = 2.0;

/// Correction that a scale error and a wobble may cause, as a share of the gyroscope's path.
const ALLOWED_SHARE: f64 = 0.15;

/// The sums over a time.
#[derive(Clone, Copy, Default, Debug)]
struct Sums {
    /// Corrections of the filter about x and y, degrees.
    correction_deg: [f64; 2],
    /// Path of the gyroscope's rates about x and y, degrees.
    path_deg: f64,
    /// Turn about the body's z, degrees.
    turn_deg: f64,
    passed_s: f64,
}

/// Returns the largest correction of the tilt in the first seconds of the run and its limit, degrees, if it is
/// exceeded. Trials without rates, or without a rest that shows the bias, are not judged.
pub(super) fn contradiction(data: &Data) -> Option<[f64; 2]> {
    let run = &data.times.run;
    let rest = sums(data, run.start - REST_S..run.start)?.last().copied()?;
    if rest.passed_s < 0.5 * REST_S {
        return None;
    }
    let bias_dps = rest.correction_deg.map(|deg| deg / rest.passed_s);
    let tilt_deg = data.records.level.as_ref().map_or(0.0, |level| level.tilt_deg.min(90.0));
    let seen = sums(data, run.start..run.end.min(run.start + SEEN_S))?;
    let found = seen.iter().map(|sums| {
        let [x, y] = [0, 1].map(|k| sums.correction_deg[k] - bias_dps[k] * sums.passed_s);
        // The accelerometer's offset turns with the body.
        let of_offset = tilt_deg * sums.turn_deg.to_radians().abs();
        [hypot(x, y), ALLOWED_DEG + ALLOWED_SHARE * sums.path_deg + of_offset]
    });
    found.filter(|[found, allowed]| found > allowed).max_by(|a, b| (a[0] - a[1]).total_cmp(&(b[0] - b[1])))
}

/// Returns the sums from the start of a time to each of its readings; `None` without rates.
fn sums(data: &Data, time: Range<f64>) -> Option<Vec<Sums>> {
    let readings = &data.readings[data.calibrated.min(data.readings.len())..];
    let from = readings.partition_point(|(time_s, _)| *time_s < time.start);
    let to = readings.partition_point(|(time_s, _)| *time_s < time.end);
    let mut sums = Sums::default();
    let mut all = Vec::with_capacity(to - from);
    for pair in readings[from..to].windows(2) {
        let [(before_s, before), (now_s, now)] = [pair[0], pair[1]];
        let passed_s = now_s - before_s;
        let turned = rotation_between(&rotation(before.attitude), &rotation(now.attitude)).map(f64::to_degrees);
        let rates = now.rates_dps?;
        for k in 0..2 {
            sums.correction_deg[k] += rates[k] * passed_s - turned[k];
        }
        sums.path_deg += hypot(rates[0], rates[1]) * passed_s;
        sums.turn_deg += turned[2];
        sums.passed_s += passed_s;
        all.push(sums);
    }
    Some(all)
}
