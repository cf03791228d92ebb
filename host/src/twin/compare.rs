//! Measured against modelled attitude, over a trial and over a session.
//!
//! Both sides are put on one clock, zero where the motors start, and to one zero, the attitude of the still phase before
//! the run. Errors are modelled less measured.

use super::alike::difference;
use super::curve::Curve;
use super::shift::RATE_HZ;
use super::{Recording, TwinError, hash, shift};
use crate::attitude::steady_window;
use protocol::units::CentiRpm;
use serde::Serialize;
use sim::steady::{CHANNELS, SteadyCollector};
use std::path::{Path, PathBuf};

/// Runs that overlap by less say nothing about each other, s.
const SHORTEST_S: f64 = 1.0;

/// A trial held against its model, or against another trial at the same speeds.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct Comparison {
    /// Name of the measured trial.
    pub name: String,
    /// Speed of flagellum 1.
    pub w1_rpm: f64,
    /// Speed of flagellum 2.
    pub w2_rpm: f64,
    /// The measured log.
    pub measured: PathBuf,
    /// The modelled log.
    pub modelled: PathBuf,
    /// Root of the mean square of the errors over the run.
    pub yaw_rmse_deg: f64,
    /// See [`Comparison::yaw_rmse_deg`].
    pub pitch_rmse_deg: f64,
    /// See [`Comparison::yaw_rmse_deg`].
    pub roll_rmse_deg: f64,
    /// Error of the means over the last 12 s of the run, rounded to whole turns.
    pub steady_yaw_error_deg: f64,
    /// See [`Comparison::steady_yaw_error_deg`].
    pub steady_pitch_error_deg: f64,
    /// See [`Comparison::steady_yaw_error_deg`].
    pub steady_roll_error_deg: f64,
    /// Measured means of yaw, pitch, roll at the end of the run, from the zero before it.
    pub steady_measured_deg: [f64; 3],
    /// The same of the model.
    pub steady_modelled_deg: [f64; 3],
    /// Settling time of the model over the measured one; `None` where one of them has not settled, or at once.
    pub settle_ratio: Option<f64>,
    /// 95 % uncertainty of the steady yaw error from drift and noise of the gyroscopes; 0 between models, `None` where no
    /// still phase tells it.
    pub yaw_uncertainty_deg: Option<f64>,
    /// The same of pitch and roll.
    pub tilt_uncertainty_deg: [Option<f64>; 2],
    /// Drift of the measured yaw that was taken off, from the start of the run to its steady end.
    pub yaw_drift_deg: f64,
    /// Measured yaw, pitch, roll in the still phase before the run, which were taken off.
    pub measured_zero_deg: [f64; 3],
    /// The same of the model.
    pub modelled_zero_deg: [f64; 3],
    /// By how much the model's clock was moved forward to lie on the measured one, beyond the start of the motors; 0 where
    /// nothing called for it.
    pub time_shift_s: f64,
    /// When the runs began, each by the clock of its log.
    pub run_start_s: [f64; 2],
    /// What of it noise does not explain.
    pub findings: Vec<Finding>,
    /// The findings in a sentence.
    pub verdict: String,
    /// What whoever uses it should know.
    pub warnings: Vec<String>,
    /// Both attitudes over time, 20 points a second: from the still phase to the end of what both have.
    #[serde(skip)]
    pub series: Vec<Point>,
}

/// A steady error that is larger than noise allows.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct Finding {
    /// `yaw`, `pitch` or `roll`.
    pub angle: &'static str,
    /// The error.
    pub error_deg: f64,
    /// What noise allows, 95 %.
    pub allowed_deg: f64,
}

/// Both attitudes at a time.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Point {
    /// From the start of the run.
    pub time_s: f64,
    /// Measured yaw, pitch, roll from their zero, the drift taken off; the yaw is unwrapped.
    pub measured_deg: [f64; 3],
    /// The same of the model.
    pub modelled_deg: [f64; 3],
    /// 95 % uncertainty of the measured yaw since the start of the run; 0 where it is not known.
    pub yaw_uncertainty_deg: f64,
}

/// A session held against its model, or against another session.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct SessionComparison {
    /// Folder of the measured session, or the measured log.
    pub measured: PathBuf,
    /// The same of the model.
    pub modelled: PathBuf,
    /// The trials, in the order of the measured session.
    pub trials: Vec<Comparison>,
    /// Measured trials that have nothing to be compared with, and why.
    pub skipped: Vec<Skipped>,
    /// Roots of the mean squares of all trials' [`Comparison::yaw_rmse_deg`]; `None` without trials.
    pub yaw_rmse_deg: Option<f64>,
    /// The same of the pitch.
    pub pitch_rmse_deg: Option<f64>,
    /// The same of the roll.
    pub roll_rmse_deg: Option<f64>,
    /// The same of the steady errors of yaw, pitch, roll.
    pub steady_rms_error_deg: Option<[f64; 3]>,
    /// What stands out over all trials, in a sentence.
    pub verdict: String,
}

/// A trial that could not be compared.
#[derive(Serialize, Clone, PartialEq, Eq, Debug, Default)]
pub struct Skipped {
    /// The trial.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// Whether trials of other robots, closures and speeds are compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Allow {
    /// They are refused.
    #[default]
    Alike,
    /// They are, with a warning.
    Anyway,
    /// They are, without one: the user named the other robot or closure.
    AsNamed,
}

/// Holds a trial's log against another one, which is a model's or that of another trial.
///
/// # Errors
/// [`TwinError::Incomparable`] where they say nothing about each other, and what keeps a log from being read.
pub fn compare_logs(measured: &Path, modelled: &Path, allow: Allow) -> Result<Comparison, TwinError> {
    let (a, b) = (Recording::read(measured)?, Recording::read(modelled)?);
    let mut warnings = Vec::new();
    if let Some(reason) = difference(&a, &b)? {
        match allow {
            Allow::Alike => {
                return Err(incomparable(measured, modelled, reason, "compare them all the same with --anyway"));
            }
            Allow::Anyway => warnings.push(reason),
            Allow::AsNamed => {}
        }
    }
    let curve = |recording: &Recording| {
        Curve::new(recording).ok_or_else(|| TwinError::Unusable {
            path: recording.path.clone(),
            reason: "holds no attitude in its run".to_owned(),
            help: "check the IMU with `biflag doctor`, and repeat the trial",
        })
    };
    let is_replay = match &b.replay {
        Some(replay) => replay.source_sha256 == hash::of_file(measured)?,
        None => false,
    };
    compare(&a, &b, [curve(&a)?, curve(&b)?], is_replay, warnings)
}

fn incomparable(measured: &Path, modelled: &Path, reason: String, help: &'static str) -> TwinError {
    TwinError::Incomparable { measured: measured.to_owned(), modelled: modelled.to_owned(), reason, help }
}

/// Compares two curves; `is_replay`: the second lies on the clock of the first.
fn compare(
    a: &Recording,
    b: &Recording,
    curves: [Curve; 2],
    is_replay: bool,
    mut warnings: Vec<String>,
) -> Result<Comparison, TwinError> {
    let [measured, modelled] = &curves;
    warnings.extend(measured.warnings.iter().cloned());
    warnings.extend(modelled.warnings.iter().map(|text| format!("{}: {text}", b.path.display())));
    // Of both, from the start of their runs.
    let from = |curve: &Curve| curve.span().start - curve.run.start;
    let to = |curve: &Curve| curve.span().end - curve.run.start;
    let run_s = [measured, modelled].map(|curve| curve.run.end.min(curve.span().end) - curve.run.start);
    let common_s = run_s[0].min(run_s[1]);
    let start = from(measured).max(from(modelled));
    let end = to(measured).min(to(modelled));
    let apart =
        || incomparable(&a.path, &b.path, "they have no time in common".to_owned(), "name logs whose runs overlap");
    if common_s < SHORTEST_S || end - start < SHORTEST_S || start >= common_s {
        return Err(apart());
    }
    if (run_s[0] - run_s[1]).abs() > 0.5 {
        let [one, other] = run_s;
        warnings.push(format!("the runs last {one:.1} s and {other:.1} s; {common_s:.1} s are compared"));
    }
    let times: Vec<f64> =
        ((start * RATE_HZ).ceil() as i64..=(end * RATE_HZ).floor() as i64).map(|i| i as f64 / RATE_HZ).collect();
    let angles = |curve: &Curve, shift: f64| -> Vec<[f64; 3]> {
        let tracks = curve.angles.each_ref();
        times.iter().map(|t| tracks.map(|track| track.at(t - shift + curve.run.start).unwrap_or_default())).collect()
    };
    let in_run = times.partition_point(|t| *t < 0.0)..times.partition_point(|t| *t <= common_s);
    let speeds = a.speeds();
    let window = steady_window(0.0..common_s, speeds);
    let in_window = times.partition_point(|t| *t < window.start)..in_run.end;
    if in_run.is_empty() || in_window.is_empty() {
        return Err(apart());
    }
    let measured_deg = angles(measured, 0.0);
    let mut modelled_deg = angles(modelled, 0.0);
    let shift_s = if is_replay { 0.0 } else { shift::of(&measured_deg, &modelled_deg) };
    if shift_s != 0.0 {
        modelled_deg = angles(modelled, shift_s);
    }

    let mean = |of: &[[f64; 3]]| {
        let sum = of[in_window.clone()].iter().fold([0.0; 3], |sum, deg| [0, 1, 2].map(|k| sum[k] + deg[k]));
        sum.map(|sum| sum / in_window.len() as f64)
    };
    let steady_measured_deg = mean(&measured_deg);
    let mut steady_modelled_deg = mean(&modelled_deg);
    let mut error = [0, 1, 2].map(|k| steady_modelled_deg[k] - steady_measured_deg[k]);
    // Where frames are missing for long the yaw may have gone round unseen.
    let turns = (error[0] / 360.0).round();
    if turns != 0.0 && a.has_long_gap() {
        warnings.push(format!("the yaw is taken to have gone round {turns} times while telemetry was missing"));
        error[0] -= 360.0 * turns;
        steady_modelled_deg[0] -= 360.0 * turns;
        modelled_deg.iter_mut().for_each(|deg| deg[0] -= 360.0 * turns);
    }
    let rmse = |k: usize| {
        let square = in_run.clone().map(|i| (modelled_deg[i][k] - measured_deg[i][k]).powi(2)).sum::<f64>();
        (square / in_run.len() as f64).sqrt()
    };
    let steady_s = 0.5 * (window.start + window.end);
    let yaw_uncertainty_deg = both(curves.each_ref().map(|curve| curve.yaw_uncertainty(curve.run.start + steady_s)));
    let window_s = window.end - window.start;
    let tilts = curves.each_ref().map(|curve| curve.tilt_uncertainty(window_s));
    let tilt_uncertainty_deg = [0, 1].map(|k| both(tilts.map(|tilt| tilt.map(|tilt| tilt[k]))));
    let settle = [&measured_deg, &modelled_deg].map(|deg| settle(&times, deg, in_run.clone(), speeds));
    let settle_ratio = match settle {
        [Some(measured), Some(modelled)] if measured > 0.0 && modelled > 0.0 => Some(modelled / measured),
        _ => None,
    };
    let allowed = [yaw_uncertainty_deg, tilt_uncertainty_deg[0], tilt_uncertainty_deg[1]];
    let findings = findings(error, allowed);
    let series = (0..times.len())
        .map(|i| Point {
            time_s: times[i],
            measured_deg: measured_deg[i],
            modelled_deg: modelled_deg[i],
            yaw_uncertainty_deg: measured.yaw_uncertainty(measured.run.start + times[i]).unwrap_or(0.0),
        })
        .collect();
    Ok(Comparison {
        name: a.trial.name.clone(),
        w1_rpm: a.trial.w1_rpm,
        w2_rpm: a.trial.w2_rpm,
        measured: a.path.clone(),
        modelled: b.path.clone(),
        yaw_rmse_deg: rmse(0),
        pitch_rmse_deg: rmse(1),
        roll_rmse_deg: rmse(2),
        steady_yaw_error_deg: error[0],
        steady_pitch_error_deg: error[1],
        steady_roll_error_deg: error[2],
        steady_measured_deg,
        steady_modelled_deg,
        settle_ratio,
        yaw_uncertainty_deg,
        tilt_uncertainty_deg,
        yaw_drift_deg: measured.yaw_drift(measured.run.start + steady_s),
        measured_zero_deg: measured.zero_deg,
        modelled_zero_deg: modelled.zero_deg,
        time_shift_s: shift_s,
        run_start_s: [measured.run.start, modelled.run.start],
        verdict: verdict(&findings, allowed),
        findings,
        warnings,
        series,
    })
}

/// Uncertainty of a difference.
fn both([one, other]: [Option<f64>; 2]) -> Option<f64> {
    Some(one?.hypot(other?))
}

/// When yaw and pitch had settled, s from the start of the run; `None`: they had not.
fn settle(times: &[f64], deg: &[[f64; 3]], run: std::ops::Range<usize>, speeds: [CentiRpm; 2]) -> Option<f64> {
    let (first, last) = (times[run.start], times[run.end - 1]);
    let mut collector =
        SteadyCollector::new(first, last, speeds.map(|speed| speed.rpm() * std::f64::consts::PI / 30.0));
    for i in run {
        let mut values = [0.0; CHANNELS];
        values[..3].copy_from_slice(&deg[i].map(f64::to_radians));
        collector.push(times[i], values);
    }
    let steady = collector.steady();
    steady.settled.then_some(steady.settle_s)
}

/// Two models have no noise, but rounding.
const ROUNDING_DEG: f64 = 0.01;

fn findings(error: [f64; 3], allowed: [Option<f64>; 3]) -> Vec<Finding> {
    ["yaw", "pitch", "roll"]
        .into_iter()
        .zip(error.into_iter().zip(allowed))
        .filter_map(|(angle, (error_deg, allowed))| {
            let allowed_deg = allowed?.max(ROUNDING_DEG);
            (error_deg.abs() > allowed_deg).then_some(Finding { angle, error_deg, allowed_deg })
        })
        .collect()
}

fn verdict(findings: &[Finding], allowed: [Option<f64>; 3]) -> String {
    let unknown = ["yaw", "pitch", "roll"].into_iter().zip(allowed).filter(|(_, allowed)| allowed.is_none());
    let unknown: Vec<_> = unknown.map(|(angle, _)| angle).collect();
    let told: Vec<_> = findings
        .iter()
        .map(|Finding { angle, error_deg, allowed_deg }| match error_deg.abs() / allowed_deg {
            _ if *allowed_deg <= ROUNDING_DEG => format!("{angle} differs by {error_deg:+.2} deg"),
            times => format!("{angle} differs by {error_deg:+.2} deg, {times:.1} x what noise allows"),
        })
        .collect();
    let mut text = if !told.is_empty() {
        told.join("; ")
    } else if unknown.len() == 3 {
        String::new()
    } else {
        "nothing differs by more than noise allows".to_owned()
    };
    if !unknown.is_empty() {
        if !text.is_empty() {
            text += "; ";
        }
        text += &format!("what noise allows is not known of {}", unknown.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_says_what_noise_does_not_explain_and_what_is_not_known() {
        let allowed = [Some(1.0), Some(0.2), None];
        let found = findings([0.9, -0.8, 5.0], allowed);
        assert_eq!(found.len(), 1);
        assert_eq!(
            verdict(&found, allowed),
            "pitch differs by -0.80 deg, 4.0 x what noise allows; what noise allows is not known of roll"
        );
        assert_eq!(verdict(&[], [Some(1.0); 3]), "nothing differs by more than noise allows");
        assert_eq!(verdict(&[], [None; 3]), "what noise allows is not known of yaw, pitch, roll");
        assert_eq!(verdict(&findings([0.5, 0.0, 0.0], [Some(0.0); 3]), [Some(0.0); 3]), "yaw differs by +0.50 deg");
    }
}
