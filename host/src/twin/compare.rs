//! Measured against modelled attitude, over a trial and over a session.
//!
//! Both sides are put on one clock, zero where the motors start, and to one zero, the attitude of the still phase before
//! the run. Errors are modelled less measured.

use serde::Serialize;
use std::path::PathBuf;

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
