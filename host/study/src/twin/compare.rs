//! Compares measured and modelled attitude, over a trial and over a session.
//!
//! Both are put on a common clock, which is zero when the motors start, and referred to the still phase before the run
//! ([`Zeroed`]). Errors are modelled minus measured values.

use super::compatibility::difference;
use super::shift::RATE_HZ;
use super::{TwinError, shift};
use crate::text;
use crate::trial::{self, Data, LogFinding, Steady, Unusable, Zeroed};
use serde::Serialize;
use sim::accuracy::ModelError;
use std::borrow::Cow;
use std::path::PathBuf;

/// Shortest common time of two runs that can be compared, s.
const SHORTEST_S: f64 = 1.0;

/// Largest difference of two runs' lengths without a warning, s.
const SAME_LENGTH_S: f64 = 0.5;

/// A trial compared with its model, or with another trial at the same speeds.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct Comparison {
    /// Name of the measured trial.
    pub name: String,
    /// Speed of flagellum 1.
    pub w1_rpm: f64,
    /// Speed of flagellum 2.
    pub w2_rpm: f64,
    /// The measured log.
    #[serde(serialize_with = "crate::text::path")]
    pub measured: PathBuf,
    /// The modelled log.
    #[serde(serialize_with = "crate::text::path")]
    pub modelled: PathBuf,
    /// Root mean square of the yaw error over the run.
    pub yaw_rmse_deg: f64,
    /// See [`Comparison::yaw_rmse_deg`].
    pub pitch_rmse_deg: f64,
    /// See [`Comparison::yaw_rmse_deg`].
    pub roll_rmse_deg: f64,
    /// Error of the steady yaw, a mean over the end of the run ([`sim::steady`]).
    pub steady_yaw_error_deg: f64,
    /// See [`Comparison::steady_yaw_error_deg`].
    pub steady_pitch_error_deg: f64,
    /// See [`Comparison::steady_yaw_error_deg`].
    pub steady_roll_error_deg: f64,
    /// Measured steady yaw, pitch and roll, relative to the zero before the run.
    pub steady_measured_deg: [f64; 3],
    /// The same for the model.
    pub steady_modelled_deg: [f64; 3],
    /// Ratio of the modelled to the measured settling time; `None` if one of them did not settle, or settled at once.
    pub settle_ratio: Option<f64>,
    /// 95 % uncertainty of the steady yaw error from drift and noise of the gyroscopes; 0 between models, `None`
    /// without a still phase.
    pub yaw_uncertainty_deg: Option<f64>,
    /// 95 % uncertainty of the steady pitch and roll errors.
    pub tilt_uncertainty_deg: [Option<f64>; 2],
    /// Error of the model's own steady yaw, pitch and roll, from what it leaves out ([`sim::accuracy`]); `None` where the
    /// measured trial is a model's or a simulated robot's, or the other one is measured.
    pub model_error_deg: Option<[f64; 3]>,
    /// Drift that was removed from the measured steady yaw.
    pub yaw_drift_deg: f64,
    /// Yaw, pitch and roll in the still phase before the run, which were subtracted as the zero.
    pub measured_zero_deg: [f64; 3],
    /// The same for the model.
    pub modelled_zero_deg: [f64; 3],
    /// Time by which the model was shifted to match the measurement, in addition to aligning the start of the motors.
    pub time_shift_s: f64,
    /// Start of both runs, each on the clock of its log.
    pub run_start_s: [f64; 2],
    /// Errors that exceed the noise.
    pub differences: Vec<Difference>,
    /// Findings about both logs.
    pub findings: Vec<LogFinding>,
    /// What the two trials are.
    pub sides: Sides,
    /// The differences as text.
    pub verdict: String,
    /// Warnings about the comparison itself.
    pub warnings: Vec<String>,
}

/// What two compared trials are. Neither two recordings nor two models are ever called a measurement and its model.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "snake_case")]
pub enum Sides {
    /// A recording, and then a model.
    #[default]
    MeasurementAndModel,
    /// A model, and then a recording.
    ModelAndMeasurement,
    /// Two recordings, of a rig or of an emulated board.
    Recordings,
    /// Two models; one may be the replay of the other.
    Models,
}

impl Sides {
    fn of(a: &Data, b: &Data) -> Self {
        match (a.is_model(), b.is_model()) {
            (true, true) => Self::Models,
            (false, false) => Self::Recordings,
            (true, false) => Self::ModelAndMeasurement,
            (false, true) => Self::MeasurementAndModel,
        }
    }

    /// Returns the subject of a sentence about both.
    pub fn text(self) -> &'static str {
        match self {
            Self::MeasurementAndModel | Self::ModelAndMeasurement => "model and measurement",
            Self::Recordings => "the two recordings",
            Self::Models => "the two models",
        }
    }

    /// Returns what both are called in legends and tables.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            Self::MeasurementAndModel => ["measured", "model"],
            Self::ModelAndMeasurement => ["model", "measured"],
            Self::Recordings => ["first recording", "second recording"],
            Self::Models => ["first model", "second model"],
        }
    }
}

/// A steady error that exceeds the noise.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct Difference {
    /// `yaw`, `pitch` or `roll`.
    pub angle: &'static str,
    /// The error.
    pub error_deg: f64,
    /// Its 95 % uncertainty from noise.
    pub allowed_deg: f64,
    /// The model's own error, see [`Comparison::model_error_deg`].
    pub model_error_deg: Option<f64>,
}

/// Both attitudes at one time.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Point {
    /// Time from the start of the run.
    pub time_s: f64,
    /// Measured yaw (unwrapped), pitch and roll relative to their zero, with drift removed.
    pub measured_deg: [f64; 3],
    /// The same for the model.
    pub modelled_deg: [f64; 3],
    /// 95 % uncertainty of the measured yaw since the start of the run; NaN if it is unknown.
    pub yaw_uncertainty_deg: f64,
}

/// A session compared with its model, or with another session.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct SessionComparison {
    /// Folder of the measured session, or the measured log.
    #[serde(serialize_with = "crate::text::path")]
    pub measured: PathBuf,
    /// The same for the model.
    #[serde(serialize_with = "crate::text::path")]
    pub modelled: PathBuf,
    /// The compared trials, in the order of the measured session.
    pub trials: Vec<Comparison>,
    /// Measured trials that were not compared, with reasons.
    pub skipped: Vec<Skipped>,
    /// Root mean square of all trials' [`Comparison::yaw_rmse_deg`]; `None` without trials.
    pub yaw_rmse_deg: Option<f64>,
    /// The same for pitch.
    pub pitch_rmse_deg: Option<f64>,
    /// The same for roll.
    pub roll_rmse_deg: Option<f64>,
    /// The same for the steady errors of yaw, pitch and roll.
    pub steady_rms_error_deg: Option<[f64; 3]>,
    /// The differences of all trials as text.
    pub verdict: String,
    /// Findings about all logs, also those that belong to no trial.
    pub findings: Vec<LogFinding>,
}

impl SessionComparison {
    /// Returns whether every trial was compared, and nothing is to be said against any.
    pub fn is_sound(&self) -> bool {
        let warned = self.trials.iter().any(|trial| !trial.warnings.is_empty());
        self.skipped.is_empty() && !warned && !self.findings.iter().any(|of_log| of_log.finding.grave)
    }
}

/// A trial that could not be compared.
#[derive(Serialize, Clone, PartialEq, Eq, Debug, Default)]
pub struct Skipped {
    /// The trial.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// How to handle trials of different robots or closures.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum OnMismatch {
    /// Refuse to compare them.
    #[default]
    Reject,
    /// Compare them with a warning.
    Warn,
    /// Compare them without a warning: the user named the other robot or closure.
    Accept,
}

/// A comparison with the data that the page shows.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The results.
    pub comparison: Comparison,
    /// The measured attitude.
    pub measured: Zeroed,
    /// Both attitudes over time, 20 points per second, from the still phase to the end of their common time.
    pub points: Vec<Point>,
}

impl Compared {
    /// Returns the attitude of a trial: the measured one of its comparison, if there is one.
    pub fn measured_or_own<'a>(compared: Option<&'a Self>, data: &Data) -> Cow<'a, Zeroed> {
        compared.map_or_else(|| Cow::Owned(Zeroed::new(data)), |compared| Cow::Borrowed(&compared.measured))
    }
}

/// Compares a trial with another one, which is modelled or measured.
///
/// # Errors
/// [`TwinError::Incomparable`] if the trials do not match or overlap, [`TwinError::Unusable`] if one of them has no
/// run.
pub fn compare(a: &Data, b: &Data, on_mismatch: OnMismatch) -> Result<Compared, TwinError> {
    let check = |data: &Data| data.check().map_err(|error| TwinError::unusable(data, error));
    check(a)?;
    check(b)?;
    let mut warnings = Vec::new();
    if let Some(reason) = difference(a, b)? {
        match on_mismatch {
            OnMismatch::Reject => return Err(incomparable(a, b, reason, "compare them anyway with --anyway")),
            OnMismatch::Warn => warnings.push(reason),
            OnMismatch::Accept => {}
        }
    }
    let zeroed = |data: &Data| {
        let zeroed = Zeroed::new(data);
        let no_attitude = || Unusable {
            reason: "contains no attitude in its run".to_owned(),
            help: "check the IMU with `biflag doctor`, and repeat the trial",
        };
        let steady = zeroed.steady.clone().ok_or_else(|| TwinError::unusable(data, no_attitude()))?;
        Ok::<_, TwinError>((zeroed, steady))
    };
    let sides = [zeroed(a)?, zeroed(b)?];
    compare_zeroed(a, b, sides, warnings)
}

/// Returns whether one log is the replay of another, whose hash was read.
pub fn is_replay_of(replay: &Data, recording: &Data) -> bool {
    match (&replay.records.replay, &recording.sha256) {
        (Some(replay), Some(sha256)) => replay.source_sha256 == *sha256,
        _ => false,
    }
}

fn incomparable(a: &Data, b: &Data, reason: String, help: &'static str) -> TwinError {
    TwinError::Incomparable { measured: a.path.clone(), modelled: b.path.clone(), reason, help }
}

fn compare_zeroed(
    a: &Data,
    b: &Data,
    [(measured, measured_steady), (modelled, modelled_steady)]: [(Zeroed, Steady); 2],
    mut warnings: Vec<String>,
) -> Result<Compared, TwinError> {
    let both_zeroed = [&measured, &modelled];
    // Times are counted from the start of each run.
    let from = |zeroed: &Zeroed| zeroed.span().start - zeroed.run.start;
    let to = |zeroed: &Zeroed| zeroed.span().end - zeroed.run.start;
    let run_s = both_zeroed.map(|zeroed| zeroed.seen_run().end - zeroed.run.start);
    let common_s = run_s[0].min(run_s[1]);
    let start = from(&measured).max(from(&modelled));
    let end = to(&measured).min(to(&modelled));
    let apart = || incomparable(a, b, "their runs do not overlap".to_owned(), "name logs whose runs overlap");
    if common_s < SHORTEST_S || end - start < SHORTEST_S || start >= common_s {
        return Err(apart());
    }
    let same_length = (run_s[0] - run_s[1]).abs() <= SAME_LENGTH_S;
    if !same_length {
        let [one, other] = run_s;
        warnings.push(format!("the runs last {one:.1} s and {other:.1} s; the first {common_s:.1} s are compared"));
    }
    let times: Vec<f64> =
        ((start * RATE_HZ).ceil() as i64..=(end * RATE_HZ).floor() as i64).map(|i| i as f64 / RATE_HZ).collect();
    let angles = |zeroed: &Zeroed, shift: f64| -> Vec<[f64; 3]> {
        times.iter().map(|t| zeroed.at(t - shift + zeroed.run.start)).collect()
    };
    let in_run = times.partition_point(|t| *t < 0.0)..times.partition_point(|t| *t <= common_s);
    if in_run.is_empty() {
        return Err(apart());
    }
    let measured_deg = angles(&measured, 0.0);
    let mut modelled_deg = angles(&modelled, 0.0);
    let shift_s = if is_replay_of(b, a) { 0.0 } else { shift::of(&measured_deg, &modelled_deg) };
    if shift_s != 0.0 {
        modelled_deg = angles(&modelled, shift_s);
    }

    // Steady values of each trial; for runs of different lengths, means over the same time.
    let window = measured_steady.window.start - measured.run.start..measured_steady.window.end - measured.run.start;
    let window = if same_length { window } else { common_s - (window.end - window.start).min(common_s)..common_s };
    let mean = |zeroed: &Zeroed, steady: &Steady, shift: f64| {
        if same_length {
            return steady.angles_deg;
        }
        let moved = window.start - shift + zeroed.run.start..window.end - shift + zeroed.run.start;
        zeroed.angles_deg.tracks().map(|track| track.mean(moved.clone()).unwrap_or_default())
    };
    let steady_measured_deg = mean(&measured, &measured_steady, 0.0);
    let mut steady_modelled_deg = mean(&modelled, &modelled_steady, shift_s);
    let mut error = [0, 1, 2].map(|k| steady_modelled_deg[k] - steady_measured_deg[k]);
    // The yaw may have made full turns in a long gap of the telemetry.
    let turns = (error[0] / 360.0).round();
    if turns != 0.0 && (a.has_long_gap() || b.has_long_gap()) {
        warnings.push(format!("the yaw is assumed to have made {turns} full turns while telemetry was missing"));
        error[0] -= 360.0 * turns;
        steady_modelled_deg[0] -= 360.0 * turns;
        modelled_deg.iter_mut().for_each(|deg| deg[0] -= 360.0 * turns);
    }
    let rmse = |k: usize| {
        let square = in_run.clone().map(|i| (modelled_deg[i][k] - measured_deg[i][k]).powi(2)).sum::<f64>();
        (square / in_run.len() as f64).sqrt()
    };
    let middle_s = 0.5 * (window.start + window.end);
    let of_yaw = |zeroed: &Zeroed| Some(zeroed.yaw_budget(zeroed.run.start + middle_s)?.uncertainty_deg());
    let yaw_uncertainty_deg = both(both_zeroed.map(of_yaw));
    let over = |zeroed: &Zeroed| zeroed.run.start + window.start..zeroed.run.start + window.end;
    let tilts = both_zeroed.map(|zeroed| zeroed.tilt_uncertainty(&over(zeroed)));
    let tilt_uncertainty_deg = [0, 1].map(|k| both(tilts.map(|tilt| tilt.map(|tilt| tilt[k]))));
    let settle_ratio = match [measured_steady.settle_s, modelled_steady.settle_s] {
        [Some(measured), Some(modelled)] if same_length && measured > 0.0 && modelled > 0.0 => {
            Some(modelled / measured)
        }
        _ => None,
    };
    let allowed = [yaw_uncertainty_deg, tilt_uncertainty_deg[0], tilt_uncertainty_deg[1]];
    let model_error_deg = (a.is_real() && b.is_model())
        .then(|| b.robot().ok())
        .flatten()
        .map(|robot| ModelError::of(&robot).of_angles_deg(steady_modelled_deg));
    let differences = differences(error, allowed, model_error_deg);
    let of_log = |data: &Data, zeroed: &Zeroed| LogFinding::all_of(&data.path, trial::findings(data, zeroed));
    let findings = [of_log(a, &measured), of_log(b, &modelled)].concat();
    let points = (0..times.len())
        .map(|i| Point {
            time_s: times[i],
            measured_deg: measured_deg[i],
            modelled_deg: modelled_deg[i],
            yaw_uncertainty_deg: measured.yaw_uncertainty(measured.run.start + times[i]).unwrap_or(f64::NAN),
        })
        .collect();
    let trial = a.trial();
    let comparison = Comparison {
        name: trial.name,
        w1_rpm: trial.w1_rpm,
        w2_rpm: trial.w2_rpm,
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
        model_error_deg,
        yaw_drift_deg: measured.yaw_drift(measured.run.start + middle_s),
        measured_zero_deg: measured.zero_deg,
        modelled_zero_deg: modelled.zero_deg,
        time_shift_s: shift_s,
        run_start_s: [measured.run.start, modelled.run.start],
        verdict: verdict(Sides::of(a, b), &differences, allowed),
        sides: Sides::of(a, b),
        differences,
        findings,
        warnings,
    };
    Ok(Compared { comparison, measured, points })
}

/// Returns the uncertainty of a difference.
fn both([one, other]: [Option<f64>; 2]) -> Option<f64> {
    Some(one?.hypot(other?))
}

/// Rounding error of the difference of two models, degrees.
const ROUNDING_DEG: f64 = 0.01;

fn differences(error: [f64; 3], allowed: [Option<f64>; 3], model: Option<[f64; 3]>) -> Vec<Difference> {
    let one = |k: usize, angle: &'static str| {
        let (error_deg, allowed_deg) = (error[k], allowed[k]?.max(ROUNDING_DEG));
        let model_error_deg = model.map(|model| model[k]);
        (error_deg.abs() > allowed_deg).then_some(Difference { angle, error_deg, allowed_deg, model_error_deg })
    };
    ["yaw", "pitch", "roll"].into_iter().enumerate().filter_map(|(k, angle)| one(k, angle)).collect()
}

fn verdict(sides: Sides, differences: &[Difference], allowed: [Option<f64>; 3]) -> String {
    let unknown = ["yaw", "pitch", "roll"].into_iter().zip(allowed).filter(|(_, allowed)| allowed.is_none());
    let unknown: Vec<_> = unknown.map(|(angle, _)| angle).collect();
    let found: Vec<_> = differences
        .iter()
        .map(|finding| {
            let Difference { angle, error_deg, allowed_deg, model_error_deg } = finding;
            let mut text = format!("{angle} differs by {error_deg:+.2}°");
            if *allowed_deg > ROUNDING_DEG {
                text += &format!(", {:.1} times the noise", error_deg.abs() / allowed_deg);
            }
            match model_error_deg {
                Some(model) if error_deg.abs() <= *model => {
                    text += &format!(", within the model's error of {model:.1}°")
                }
                Some(model) => text += &format!(", beyond the model's error of {model:.1}°"),
                None => {}
            }
            text
        })
        .collect();
    let mut text = if !found.is_empty() {
        found.join("; ")
    } else if unknown.len() == 3 {
        String::new()
    } else {
        text::capitalised(&format!("{} agree within noise", sides.text()))
    };
    if !unknown.is_empty() {
        if !text.is_empty() {
            text += "; ";
        }
        text += &format!("the noise of {} is unknown", unknown.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdict_lists_errors_beyond_noise_and_unknown_noise() {
        let allowed = [Some(1.0), Some(0.2), None];
        let found = differences([0.9, -0.8, 5.0], allowed, None);
        assert_eq!(found.len(), 1);
        assert_eq!(
            verdict(Sides::default(), &found, allowed),
            "pitch differs by -0.80°, 4.0 times the noise; the noise of roll is unknown"
        );
        let agreement = |sides| verdict(sides, &[], [Some(1.0); 3]);
        assert_eq!(agreement(Sides::MeasurementAndModel), "Model and measurement agree within noise");
        assert_eq!(agreement(Sides::Recordings), "The two recordings agree within noise");
        assert_eq!(agreement(Sides::Models), "The two models agree within noise");
        assert_eq!(verdict(Sides::default(), &[], [None; 3]), "the noise of yaw, pitch, roll is unknown");
        assert_eq!(
            verdict(Sides::Models, &differences([0.5, 0.0, 0.0], [Some(0.0); 3], None), [Some(0.0); 3]),
            "yaw differs by +0.50°"
        );
        let found = differences([3.0, 0.9, 0.0], [Some(1.0), Some(0.1), Some(0.1)], Some([5.0, 0.5, 0.5]));
        let beside = verdict(Sides::default(), &found, allowed);
        assert!(
            beside.starts_with("yaw differs by +3.00°, 3.0 times the noise, within the model's error of 5.0°; "),
            "{beside}"
        );
        assert!(
            beside.contains("pitch differs by +0.90°, 9.0 times the noise, beyond the model's error of 0.5°"),
            "{beside}"
        );
    }
}
