//! The result of a session's comparison.

use crate::trial::LogFinding;
use crate::twin::Comparison;
use crate::twin::headline::headline;
use serde::Serialize;
use std::path::PathBuf;

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
    /// Root mean square of all trials' yaw errors over their runs; `None` without trials.
    pub yaw_rmse_deg: Option<f64>,
    /// The same for pitch.
    pub pitch_rmse_deg: Option<f64>,
    /// The same for roll.
    pub roll_rmse_deg: Option<f64>,
    /// The same for the steady errors of yaw, pitch and roll.
    pub steady_rms_error_deg: Option<[f64; 3]>,
    /// The steady errors of all trials together, without angles whose uncertainty is unknown.
    pub angles: Vec<SessionAngle>,
    /// Expected and found differences; `None` if no test involves chance.
    pub chance: Option<Chance>,
    /// The differences of all trials as text.
    pub verdict: String,
    /// Findings about all logs, including those that belong to no trial.
    pub findings: Vec<LogFinding>,
}

impl SessionComparison {
    /// Returns whether every trial was compared, without warnings or grave findings.
    pub fn is_sound(&self) -> bool {
        let warned = self.trials.iter().any(|trial| !trial.warnings.is_empty());
        self.skipped.is_empty() && !warned && !self.findings.iter().any(|of_log| of_log.finding.grave)
    }

    /// Returns the result in one plain sentence; the verdict has the numbers of the test.
    pub fn headline(&self) -> String {
        headline(&self.trials, &self.angles, self.chance.as_ref())
    }

    /// Returns whether no trial differs, and neither do all trials together.
    pub fn agrees(&self) -> bool {
        self.trials.iter().all(Comparison::agrees) && !self.angles.iter().any(SessionAngle::differs)
    }
}

/// The steady errors of an angle in all trials. Errors of the sensor are common to its trials, so they do not average
/// out.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct SessionAngle {
    /// `yaw`, `pitch` or `roll`.
    pub angle: &'static str,
    /// Number of trials with known uncertainty.
    pub trials: usize,
    /// Mean error.
    pub mean_error_deg: f64,
    /// Its 95 % uncertainty.
    pub mean_uncertainty_deg: f64,
    /// Root mean square of the errors.
    pub rms_error_deg: f64,
    /// Bound that 95 of 100 sessions without a difference do not exceed.
    pub rms_allowed_deg: f64,
    /// Number of independent trials with the same scatter of the mean square.
    pub independent_trials: f64,
}

impl SessionAngle {
    /// Returns whether mean or scatter is larger than its uncertainty.
    pub fn differs(&self) -> bool {
        self.mean_error_deg.abs() > self.mean_uncertainty_deg || self.rms_error_deg > self.rms_allowed_deg
    }
}

/// The number of differences of steady angles, compared with chance.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
pub struct Chance {
    /// Number of tests: angles with known uncertainty.
    pub tests: usize,
    /// Number of differences found.
    pub alarms: usize,
    /// Number expected if there are no real differences: one in twenty tests.
    pub expected_alarms: f64,
    /// Trials with a difference that chance does not explain, given the number of tests
    /// ([`crate::statistics::beyond_chance`]).
    pub beyond: Vec<String>,
}

/// A trial that could not be compared.
#[derive(Serialize, Clone, PartialEq, Eq, Debug, Default)]
pub struct Skipped {
    /// The trial.
    pub name: String,
    /// Why.
    pub reason: String,
}
