//! Finds the clock of a table relative to a recording of the same trial, from the yaw that both have measured.
//!
//! The yaws are ψ(t) of the recording and ψ'(t') of the table. With the time t' from the table's middle, the clock is
//! t = d + (1 + r) t', and ψ'(t') = ψ(t) + c + e t': the instruments' zeros differ by c, and the gyroscope drifts by e.
//! A search over d and r finds the smallest residuals; a least-squares fit from there gives all four numbers and their
//! uncertainties.
//!
//! If the table's instrument saw the LED of the board, which is lit while a motor is on, the times at which it went on and off
//! give d and r, and the fit only c and e.

use super::{ImportError, State, States};
use crate::attitude::{Columns, Track};
use crate::text::decimal;
use crate::trial::Judged;
use biflag_log::ImportMeta;
use nalgebra::{Matrix4, Vector4};
use serde::Serialize;
use sim::functions::{hypot, powi};
use std::fmt;

/// Interval of the search, s.
const STEP_S: f64 = 0.1;

/// Largest difference between the rates of two clocks, and the step of the search: 0.1 s over two minutes.
const MOST_RATE: f64 = 0.01;
const RATE_STEP: f64 = 0.001;

/// Shortest time common to both, s, and as a share of the shorter one.
const LEAST_S: f64 = 20.0;
const LEAST_SHARE: f64 = 0.5;

/// Smallest motion of the yaw that determines the time: its standard deviation, degrees.
const LEAST_MOTION_DEG: f64 = 1.0;

/// Largest residuals of the same trial, as a share of the motion.
const MOST_RESIDUAL: f64 = 0.2;

/// Another time is also possible if its residuals exceed the best ones by at most this factor, or by less than this,
/// degrees.
const AMBIGUOUS: f64 = 1.5;
const AMBIGUOUS_DEG: f64 = 0.05;
/// Times closer than this are the same, s.
const SAME_S: f64 = 0.5;

/// The clock of a table relative to a recording's. Uncertainties are standard uncertainties.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct Clock {
    /// Time of the recording at the table's zero, s.
    pub offset_s: f64,
    /// Its uncertainty.
    pub offset_u_s: f64,
    /// The middle of the table by its own clock, s, where the recording's time is best known.
    pub middle_s: f64,
    /// The recording's time there, s.
    pub at_middle_s: f64,
    /// Its uncertainty.
    pub at_middle_u_s: f64,
    /// Relative rate by which the recording's time passes faster than the table's, 10⁻⁶.
    pub rate_ppm: f64,
    /// Its uncertainty.
    pub rate_u_ppm: f64,
    /// Drift of the table's yaw against the recorded one, degrees per second of the table.
    pub drift_dps: f64,
    /// Its uncertainty.
    pub drift_u_dps: f64,
    /// Remaining difference between both yaws, RMS.
    pub rms_deg: f64,
    /// Rows of the table within the recording.
    pub rows: usize,
}

impl Clock {
    /// Converts a time of the table to the recording's.
    fn time_s(&self, table_s: f64) -> f64 {
        self.offset_s + (1.0 + self.rate_ppm * 1e-6) * table_s
    }
}

/// A recording of the trial of a table.
#[derive(Clone, PartialEq, Debug)]
pub struct Beside {
    /// File name of the recording.
    pub trial: String,
    /// The clock of the table.
    pub clock: Clock,
    /// The signal that determined the clock, in words.
    by: &'static str,
}

impl Beside {
    /// Puts the states of a table on the clock of a recording, with the motion of its motors. States before and after the
    /// recording are left out. `table` is the table's name in errors, `sync` the times at which the LED of the board went on and
    /// off in it.
    ///
    /// # Errors
    /// [`ImportError::Table`] if the yaws do not determine the clock, or the LED does not.
    pub fn put(
        states: States,
        recording: &Judged,
        table: &str,
        sync: Option<[f64; 2]>,
    ) -> Result<(States, Self), ImportError> {
        let mut yaw = Columns::<1>::default();
        states.rows.iter().for_each(|state| yaw.push(state.time_s, [state.angles_deg[0]]));
        let (of_table, of_log) = (yaw.track(0), recording.angles.angles_deg.track(0));
        let (clock, by) = match sync {
            Some(seen_s) => (by_light(of_table, of_log, seen_s, recording.data.lit_s, table)?, "LED"),
            None => (find(of_table, of_log, table)?, "yaw"),
        };
        let Judged { data: recording, angles, .. } = recording;
        let span = recording.motors.span();
        let on_clock = |state: &State| {
            let time_s = clock.time_s(state.time_s);
            let turns = [0, 1].map(|k| recording.motor_turns(k).at(time_s).unwrap_or_default());
            State { time_s, turns: Some(turns), speed_rpm: None, ..*state }
        };
        let rows = states.rows.iter().map(on_clock).filter(|state| (span.start..=span.end).contains(&state.time_s));
        let name = recording.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let about = ImportMeta {
            trial: name.clone(),
            trial_yaw_uncertainty_deg: angles.angles().and_then(|angles| angles.yaw_uncertainty_deg),
            trial_sha256: recording.sha256.clone().unwrap_or_default(),
            has_motors: true,
            clock_offset_s: Some(clock.offset_s),
            clock_rate_ppm: Some(clock.rate_ppm),
            clock_rms_deg: Some(clock.rms_deg),
            ..states.about
        };
        Ok((States { rows: rows.collect(), about }, Self { trial: name, clock, by }))
    }
}

impl fmt::Display for Beside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { trial, clock, by } = self;
        let with = |value: f64, u: f64, decimals: usize| {
            format!("{} ± {}", decimal(value, decimals), decimal(2.0 * u, decimals))
        };
        write!(
            f,
            "clock by the {by}: {} s of the table is {} s of {trial}, whose time passes {} ppm faster\n\
             yaw: drifts by {} °/s against the recorded one; without it {} rows differ by {}° RMS",
            decimal(clock.middle_s, 3),
            with(clock.at_middle_s, clock.at_middle_u_s, 3),
            with(clock.rate_ppm, clock.rate_u_ppm, 0),
            with(clock.drift_dps, clock.drift_u_dps, 4),
            clock.rows,
            decimal(clock.rms_deg, 2),
        )
    }
}

/// Finds the clock of a table from its yaw and the recorded yaw.
fn find(table: Track, log: Track, name: &str) -> Result<Clock, ImportError> {
    let fails = |reason: String, help| ImportError::table(name, reason, help);
    let of_other = "name a table with the yaw of this trial, from before the run until after it";
    let (grid, inside) = (Grid::of(log), Grid::of(table));
    // A table may cover part of the recording, with less motion, or the reverse.
    let motion_deg = deviation(&grid.yaw).min(deviation(&inside.yaw));
    if motion_deg < LEAST_MOTION_DEG {
        let reason = "its yaw, or the recorded one, hardly changes: that does not tell its clock".to_owned();
        return Err(fails(reason, "name the speeds and the run with --speeds and --run, without --trial"));
    }
    let shorter = grid.yaw.len().min(inside.yaw.len());
    let least = ((LEAST_S / STEP_S) as usize).max((LEAST_SHARE * shorter as f64) as usize);
    let lags = -(inside.yaw.len() as i64)..grid.yaw.len() as i64;
    let rates = (MOST_RATE / RATE_STEP).round() as i32;
    let mut best_at: Vec<(f64, f64, f64)> = Vec::new();
    for lag in lags {
        let of_rate = |k: i32| {
            let rate = f64::from(k) * RATE_STEP;
            let residual = grid.residual(&inside, lag as f64, rate, least, 0.5 * motion_deg)?;
            Some((residual, lag as f64, rate))
        };
        best_at.extend((-rates..=rates).filter_map(of_rate).min_by(|a, b| a.0.total_cmp(&b.0)));
    }
    let Some(best) = best_at.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0)) else {
        return Err(fails(format!("has less than {LEAST_S} s in common with the recording"), of_other));
    };
    if best.0 > MOST_RESIDUAL * motion_deg {
        let reason = format!("its yaw is at no time that of the recording: {:.1}° RMS are left", best.0);
        return Err(fails(reason, of_other));
    }
    let limit = (AMBIGUOUS * best.0).max(best.0 + AMBIGUOUS_DEG);
    let is_minimum = |i: usize| {
        let around = &best_at[i.saturating_sub(1)..(i + 2).min(best_at.len())];
        around.iter().all(|near| near.0 >= best_at[i].0)
    };
    let other = (0..best_at.len()).find(|i| {
        let (residual, lag, _) = best_at[*i];
        residual < limit && (lag - best.1).abs() * STEP_S > SAME_S && is_minimum(*i)
    });
    if let Some(other) = other {
        let between_s = (best_at[other].1 - best.1).abs() * STEP_S;
        let reason = format!("its yaw is that of the recording at times {between_s:.1} s apart");
        return Err(fails(reason, "name a table that begins before the run: its start tells the time"));
    }
    let middle_s = 0.5 * (table.span().start + table.span().end);
    // The lag of the search refers to the table's first row.
    let start_s = log.span().start + best.1 * STEP_S;
    let shift_s = start_s + (1.0 + best.2) * (middle_s - table.span().start);
    let clock = fit(table, log, middle_s, [shift_s, best.2], false);
    let holds = |clock: &Clock| {
        let rate = clock.rate_ppm * 1e-6;
        rate.abs() <= MOST_RATE + RATE_STEP && (rate - best.2).abs() <= 2.0 * RATE_STEP
    };
    clock.filter(holds).ok_or_else(|| {
        let reason = format!("its yaw does not tell its clock, whose rate may differ by {} %", MOST_RATE * 100.0);
        fails(reason, of_other)
    })
}

/// Returns the clock of a table in which the LED of the board went on and off at `seen_s`, and in the recording at `lit_s`.
fn by_light(
    table: Track,
    log: Track,
    seen_s: [f64; 2],
    lit_s: Option<[f64; 2]>,
    name: &str,
) -> Result<Clock, ImportError> {
    let (seen_for_s, lit_for_s) = (seen_s[1] - seen_s[0], lit_s.map_or(0.0, |[on_s, off_s]| off_s - on_s));
    let rate = lit_for_s / seen_for_s - 1.0;
    let (first_s, last_s) = (table.span().start, table.span().end);
    let middle_s = f64::midpoint(first_s, last_s);
    let at_middle_s =
        lit_s.filter(|_| rate.abs() <= MOST_RATE).map(|[on_s, _]| on_s + (1.0 + rate) * (middle_s - seen_s[0]));
    let clock = at_middle_s.and_then(|at_s| fit(table, log, middle_s, [at_s, rate], true)).ok_or_else(|| {
        let [seen, lit] = [seen_for_s, lit_for_s].map(|s| decimal(s, 2));
        let reason = format!("has the LED lit for {seen} s, the recording for {lit} s; or no row is in its time");
        let help = "give the times, by the table's clock, of the first picture with the LED lit in the run and of the first dark one after it";
        ImportError::table(name, reason, help)
    })?;
    // The LED changes at any time between two rows.
    let u_s = (last_s - first_s) / (table.time_s.len() as f64 - 1.0) / 12.0_f64.sqrt();
    let u_at = |time_s: f64| u_s / seen_for_s * hypot(seen_s[1] - time_s, time_s - seen_s[0]);
    let rate_u_ppm = u_s * 2.0_f64.sqrt() / seen_for_s * 1e6;
    Ok(Clock { offset_u_s: u_at(0.0), at_middle_u_s: u_at(middle_s), rate_u_ppm, ..clock })
}

/// A yaw at even times.
struct Grid {
    yaw: Vec<f64>,
}

impl Grid {
    fn of(track: Track) -> Self {
        let span = track.span();
        let count = ((span.end - span.start) / STEP_S).floor() as usize + 1;
        let yaw = (0..count).filter_map(|i| track.at(span.start + i as f64 * STEP_S)).collect();
        Self { yaw }
    }

    /// Returns the standard deviation of `table` minus this yaw about a straight line, with the table's first value at
    /// the index `lag` and later ones `1 + rate` apart; `None` if they have fewer than `least` values in common, or if
    /// this yaw changes too little there.
    fn residual(&self, table: &Self, lag: f64, rate: f64, least: usize, least_motion_deg: f64) -> Option<f64> {
        let [mut n, mut t, mut tt] = [0.0; 3];
        let [mut e, mut te, mut ee, mut y, mut ty, mut yy] = [0.0; 6];
        // Of a film of an hour, few values are within the recording.
        let first = (-lag / (1.0 + rate)).max(0.0) as usize;
        for (i, value) in table.yaw.iter().enumerate().skip(first) {
            let time = i as f64;
            let at = lag + (1.0 + rate) * time;
            if at < 0.0 {
                continue;
            }
            let (before, share) = (at as usize, at.fract());
            let Some([a, b]) = self.yaw.get(before..before + 2).and_then(|pair| pair.first_chunk()) else { break };
            let yaw = a + share * (b - a);
            let error = value - yaw;
            (n, t, tt) = (n + 1.0, t + time, tt + time * time);
            (e, te, ee) = (e + error, te + time * error, ee + error * error);
            (y, ty, yy) = (y + yaw, ty + time * yaw, yy + yaw * yaw);
        }
        if n < least.max(3) as f64 {
            return None;
        }
        let spread = tt - t * t / n;
        let about_line =
            |s: f64, ts: f64, ss: f64| ((ss - s * s / n - powi(ts - t * s / n, 2) / spread).max(0.0) / n).sqrt();
        (about_line(y, ty, yy) >= least_motion_deg).then(|| about_line(e, te, ee))
    }
}

/// Returns the standard deviation of values about their straight line.
fn deviation(values: &[f64]) -> f64 {
    let grid = Grid { yaw: vec![0.0; values.len() + 1] };
    grid.residual(&Grid { yaw: values.to_vec() }, 0.0, 0.0, 3, 0.0).unwrap_or(0.0)
}

/// Fits the time of the table's middle and the rate from initial values, unless they are known, together with zero and drift.
fn fit(table: Track, log: Track, middle_s: f64, [mut shift_s, mut rate]: [f64; 2], is_known: bool) -> Option<Clock> {
    /// Half the interval of a difference quotient, s.
    const H_S: f64 = 0.05;
    const MOST_STEPS: usize = 50;
    let span = log.span();
    let [mut zero_deg, mut drift_dps] = [0.0; 2];
    let mut residuals = Vec::new();
    let mut normal = Matrix4::zeros();
    for _ in 0..MOST_STEPS {
        residuals.clear();
        normal = Matrix4::zeros();
        if is_known {
            (normal[(0, 0)], normal[(1, 1)]) = (1.0, 1.0);
        }
        let mut right = Vector4::zeros();
        for (time, value) in table.time_s.iter().zip(table.value) {
            let passed_s = time - middle_s;
            let at = shift_s + (1.0 + rate) * passed_s;
            if at < span.start + H_S || at > span.end - H_S {
                continue;
            }
            let slope = (log.at(at + H_S)? - log.at(at - H_S)?) / (2.0 * H_S);
            let residual = value - log.at(at)? - zero_deg - drift_dps * passed_s;
            let slope = if is_known { 0.0 } else { slope };
            let row = Vector4::new(slope, slope * passed_s, 1.0, passed_s);
            normal += row * row.transpose();
            right += row * residual;
            residuals.push(residual);
        }
        let step = normal.cholesky()?.solve(&right);
        shift_s += step[0];
        rate += step[1];
        zero_deg += step[2];
        drift_dps += step[3];
        if step[0].abs() < 1e-7 && step[1].abs() < 1e-10 && !(is_known && step[2].abs() > 1e-7) {
            break;
        }
    }
    let count = residuals.len() as f64;
    let square: f64 = residuals.iter().map(|residual| residual * residual).sum();
    let variance = square / (count - 4.0).max(1.0) * rows_for_one(&residuals);
    let covariance = normal.try_inverse()? * variance;
    // The offset refers to the table's time zero, not to its middle.
    let to_zero = Vector4::new(1.0, -middle_s, 0.0, 0.0);
    Some(Clock {
        offset_s: shift_s - (1.0 + rate) * middle_s,
        offset_u_s: to_zero.dot(&(covariance * to_zero)).sqrt(),
        middle_s,
        at_middle_s: shift_s,
        at_middle_u_s: covariance[(0, 0)].sqrt(),
        rate_ppm: rate * 1e6,
        rate_u_ppm: covariance[(1, 1)].sqrt() * 1e6,
        drift_dps,
        drift_u_dps: covariance[(3, 3)].sqrt(),
        rms_deg: (square / count).sqrt(),
        rows: residuals.len(),
    })
}

/// Returns the number of rows per independent error: the sum of the residuals' autocorrelations, up to the first that
/// is not positive.
fn rows_for_one(residuals: &[f64]) -> f64 {
    let product = |lag: usize| residuals.iter().zip(&residuals[lag..]).map(|(a, b)| a * b).sum::<f64>();
    let square = product(0).max(f64::MIN_POSITIVE);
    let correlations = (1..residuals.len() / 4).map(|lag| product(lag) / square);
    1.0 + 2.0 * correlations.take_while(|correlation| *correlation > 0.0).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The yaw of a robot that starts at 20 s, turns to -67 degrees within some 11 s, wobbles at 41.7 rpm, and returns from 80 s
    /// on.
    fn yaw(time_s: f64) -> f64 {
        let towards = |since_s: f64| if since_s > 0.0 { 1.0 - (-since_s / 11.0).exp() } else { 0.0 };
        let run = if (20.0..80.0).contains(&time_s) { 1.0 } else { 0.0 };
        let wobble = 0.9 * run * (std::f64::consts::TAU * 41.7 / 60.0 * (time_s - 20.0)).sin();
        -67.3 * towards(time_s - 20.0) + 67.0 * towards(time_s - 80.0) + wobble
    }

    fn track(from_s: f64, to_s: f64, step_s: f64, of: impl Fn(f64, usize) -> f64) -> Columns<1> {
        let mut columns = Columns::default();
        for i in 0..((to_s - from_s) / step_s) as usize {
            let time_s = from_s + i as f64 * step_s;
            columns.push(time_s, [of(time_s, i)]);
        }
        columns
    }

    /// Returns pseudo-random numbers from -0.5 to 0.5, from the golden ratio.
    fn noise(i: usize) -> f64 {
        (i as f64 * 0.618_033_988_75).fract() - 0.5
    }

    #[test]
    fn offset_rate_and_drift_are_found_within_their_uncertainties() {
        let log = track(0.0, 110.0, 0.005, |time, _| yaw(time));
        for (offset_s, rate_ppm, drift_dps, from_s, to_s, step_s) in [
            (-1234.56, 180.0, 0.02, 1237.3, 1331.1, 1.0 / 23.7),
            (3.217, -4321.0, -0.004, 0.0, 104.0, 0.05),
            (0.0, 8000.0, 0.0, 11.0, 99.0, 0.11),
            (7.77, 0.0, 0.001, -30.0, 150.0, 0.031),
            // From a second before the run to its end, and its first 21 s.
            (0.0, 40.0, 0.003, 19.0, 80.3, 0.04),
            (-7.5, -300.0, 0.0, 26.5, 48.5, 0.04),
        ] {
            let of = |time: f64, i: usize| {
                yaw(offset_s + (1.0 + rate_ppm * 1e-6) * time) + 33.0 + drift_dps * time + 0.4 * noise(i)
            };
            let table = track(from_s, to_s, step_s, of);
            let clock = find(table.track(0), log.track(0), "table").unwrap();
            let off = [
                (clock.offset_s - offset_s) / clock.offset_u_s,
                (clock.rate_ppm - rate_ppm) / clock.rate_u_ppm,
                (clock.drift_dps - drift_dps) / clock.drift_u_dps,
            ];
            assert!(off.iter().all(|off| off.abs() < 3.0), "{off:?}: {clock:?}");
            let at_start = clock.time_s(from_s) - (offset_s + (1.0 + rate_ppm * 1e-6) * from_s);
            assert!(at_start.abs() < 0.01 && (0.1..0.14).contains(&clock.rms_deg), "{at_start} s off: {clock:?}");
        }
    }

    #[test]
    fn the_led_tells_the_clock_of_a_yaw_that_does_not() {
        let (on_s, off_s, offset_s, rate_ppm) = (20.0, 80.0, 3.217, -4321.0);
        let of = |time: f64| 0.1 * (time / 50.0).sin();
        let log = track(0.0, 110.0, 0.005, |time, _| of(time));
        let own_s = |log_s: f64| (log_s - offset_s) / (1.0 + rate_ppm * 1e-6);
        // The first pictures after the LED has changed.
        let seen_s = [on_s, off_s].map(|log_s| (own_s(log_s) / 0.04).ceil() * 0.04);
        let table =
            track(0.0, 104.0, 0.04, |time, i| of(offset_s + (1.0 + rate_ppm * 1e-6) * time) + 33.0 + 0.02 * noise(i));
        let (table, log) = (table.track(0), log.track(0));
        assert!(find(table, log, "camera.csv").is_err());
        let clock = by_light(table, log, seen_s, Some([on_s, off_s]), "camera.csv").unwrap();
        let off = [
            (clock.offset_s - offset_s) / clock.offset_u_s,
            (clock.rate_ppm - rate_ppm) / clock.rate_u_ppm,
            clock.drift_dps / clock.drift_u_dps,
        ];
        assert!(off.iter().all(|off| off.abs() < 4.0) && clock.offset_u_s < 0.03, "{off:?}: {clock:?}");
        assert!((clock.rms_deg - 0.02 / 12.0_f64.sqrt()).abs() < 1e-3, "{clock:?}");
        let refused = |seen_s, lit_s| by_light(table, log, seen_s, lit_s, "camera.csv").unwrap_err().to_string();
        assert!(refused(seen_s, None).contains("the recording for 0.00 s"));
        assert!(refused([10.0, 50.0], Some([on_s, off_s])).contains("lit for 40.00 s, the recording for 60.00 s"));
        assert!(refused([1010.0, 1070.0], Some([on_s, off_s])).contains("no row is in its time"));
    }

    /// Errors correlated over seconds leave fewer independent rows: the uncertainties grow by a factor of three.
    #[test]
    fn errors_that_last_make_the_uncertainties_larger() {
        let log = track(0.0, 110.0, 0.005, |time, _| yaw(time));
        let of_steps = |rows: usize| {
            let table = track(2.0, 108.0, 0.04, |time, i| yaw(time) + 0.7 * noise(i / rows));
            find(table.track(0), log.track(0), "table").unwrap()
        };
        let [single, lasting] = [1, 50].map(of_steps);
        let larger = [lasting.at_middle_u_s / single.at_middle_u_s, lasting.drift_u_dps / single.drift_u_dps];
        assert!(larger.iter().all(|larger| *larger > 3.0), "{larger:?}: {lasting:?}");
        assert!(
            lasting.at_middle_s.abs() - 55.0 < 0.05 && lasting.drift_dps.abs() < 3.0 * lasting.drift_u_dps,
            "{lasting:?}"
        );
    }

    #[test]
    fn a_yaw_that_does_not_tell_the_time_is_refused() {
        let log = track(0.0, 110.0, 0.005, |time, _| yaw(time));
        let refused = |of: &dyn Fn(f64) -> f64, to_s: f64| {
            let table = track(0.0, to_s, 0.05, |time, i| of(time) + 0.1 * noise(i));
            find(table.track(0), log.track(0), "camera.csv").unwrap_err().to_string()
        };
        assert!(refused(&|_| 3.0, 100.0).contains("hardly changes"));
        assert!(refused(&|time| yaw(time + 21.0), 9.0).contains("less than 20 s in common"));
        // The opposite sign, and another trial.
        assert!(refused(&|time| -yaw(time), 100.0).contains("at no time"));
        assert!(refused(&|time| 2.0 * yaw(0.5 * time), 100.0).contains("at no time"));
        // A recording that only wobbles.
        let wobble = |time: f64| 5.0 * (std::f64::consts::TAU * 0.7 * time).sin();
        let (long, short) = (
            track(0.0, 110.0, 0.005, |time, _| wobble(time)),
            track(0.0, 60.0, 0.05, |time, i| wobble(time + 9.3) + 0.1 * noise(i)),
        );
        let error = find(short.track(0), long.track(0), "camera.csv").unwrap_err().to_string();
        assert!(error.contains("s apart"), "{error}");
    }
}
