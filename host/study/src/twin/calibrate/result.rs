//! The result of a fit.

use crate::plan::{Fit, FittedParameter, FittedTo, with_fit};
use crate::text;
use crate::trial::LogFinding;
use serde::Serialize;
use sim::body::closure::Closure;
use sim::params::Robot;
use std::fmt::Write;
use std::path::PathBuf;

/// A trial used by the fit.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Fitted {
    /// Its name.
    pub name: String,
    /// Path of its log.
    #[serde(serialize_with = "crate::text::path")]
    pub log: PathBuf,
    /// SHA-256 of the log.
    pub sha256: String,
    /// Where it ran.
    pub origin: &'static str,
    /// Root mean square errors of yaw, pitch and roll with the initial parameters.
    pub rmse_before_deg: [f64; 3],
    /// The same with the fitted parameters.
    pub rmse_after_deg: [f64; 3],
}

/// Mounting of the sensor in the body, from the still phases.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Mounting {
    /// Mean pitch at rest.
    pub pitch_deg: f64,
    /// Mean roll at rest.
    pub roll_deg: f64,
    /// Standard errors of both, from the scatter between trials; `None` for a single trial.
    pub std_error_deg: Option<[f64; 2]>,
}

/// Result of a fit.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Calibration {
    /// The parameters.
    pub parameters: Vec<FittedParameter>,
    /// Covariance of their errors, in the same order. Units: the row's unit times the column's.
    pub covariance: Vec<Vec<f64>>,
    /// The part of the covariance estimated from the scatter of the residuals.
    pub scatter_covariance: Vec<Vec<f64>>,
    /// Degrees of freedom of that part.
    pub degrees_of_freedom: f64,
    /// Correlations of the errors.
    pub correlations: Vec<Vec<f64>>,
    /// Condition number of the correlations; it is large if a combination of parameters is nearly undetermined.
    pub condition_number: f64,
    /// Descriptions of the parameters that the data cannot separate or determine.
    pub cannot_tell: Vec<String>,
    /// Descriptions of residuals that the noise does not explain.
    pub misfits: Vec<String>,
    /// The quantity that the fit minimises, before and after: the root mean square of all errors, each relative to its standard
    /// uncertainty.
    #[serde(skip)]
    pub weighted: [f64; 2],
    /// Root mean square of all errors with the initial parameters.
    pub rmse_before_deg: f64,
    /// The same with the fitted parameters.
    pub rmse_after_deg: f64,
    /// Mounting of the sensor in the body.
    pub mounting: Mounting,
    /// The trials.
    pub trials: Vec<Fitted>,
    /// Mean temperature of the sensor; NaN if an imported trial has no temperature.
    pub temperature_c: f64,
    /// The closure of the fit.
    pub closure: Closure,
    /// Total number of simulated trials.
    pub simulations: usize,
    /// Findings about the logs of all trials, including those left out of the fit.
    pub findings: Vec<LogFinding>,
    /// Warnings about the fit itself.
    pub warnings: Vec<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// Names of the parameters in which the fit has not reached its minimum.
    #[serde(skip)]
    pub short_of_minimum: Vec<&'static str>,
    /// The fitted robot.
    #[serde(skip)]
    pub robot: Robot,
}

impl Calibration {
    /// Returns the fit in the form of the robot's file.
    pub fn fit(&self) -> Fit {
        let is_real = self.parameters.iter().any(|estimate| estimate.model_error.is_some());
        Fit {
            closure: self.closure,
            fitted_to: if is_real { FittedTo::Robot } else { FittedTo::Simulation },
            is_described: self.misfits.is_empty(),
            short_of_minimum: self.short_of_minimum.iter().map(|name| (*name).to_owned()).collect(),
            temperature_c: Some(self.temperature_c).filter(|celsius| celsius.is_finite()),
            degrees_of_freedom: self.degrees_of_freedom,
            covariance: self.covariance.clone(),
            scatter_covariance: self.scatter_covariance.clone(),
            lacks_correlations: false,
            parameters: self.parameters.clone(),
        }
    }

    /// Returns whether the fit has no warnings, no undetermined parameters and no misfits.
    pub fn is_sound(&self) -> bool {
        self.warnings.is_empty() && self.cannot_tell.is_empty() && self.misfits.is_empty()
    }
}

/// Returns the file of a fitted robot: all parameters, and under `[fit]` the fitted ones with their covariance.
/// Comments list the trials; no program reads them.
pub fn to_toml(calibration: &Calibration) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let mut note = |line: String| {
        let _ = writeln!(text, "# {}", line.replace(['\n', '\r'], " "));
    };
    note(format!(
        "Fitted by `biflag calibrate` {}. What is known of the fitted parameters is under [fit].",
        env!("CARGO_PKG_VERSION")
    ));
    let mount = &calibration.mounting;
    note(format!(
        "The sensor at rest: pitch {} deg, roll {} deg.",
        text::decimal(mount.pitch_deg, 3),
        text::decimal(mount.roll_deg, 3)
    ));
    note(format!(
        "RMSE {:.3} deg before and {:.3} deg after.",
        calibration.rmse_before_deg, calibration.rmse_after_deg
    ));
    for line in calibration.cannot_tell.iter().chain(&calibration.misfits) {
        note(line.clone());
    }
    note(String::new());
    note("Fitted to:".to_owned());
    for trial in &calibration.trials {
        let log = trial.log.file_name().unwrap_or_default().to_string_lossy();
        let [before, after] =
            [trial.rmse_before_deg, trial.rmse_after_deg].map(|deg| deg.map(|deg| format!("{deg:.2}")).join(", "));
        note(format!("{log}: RMSE of yaw, pitch, roll {before} deg before and {after} deg after"));
        note(format!("  sha256 {}", trial.sha256));
    }
    format!("{text}\n{}", with_fit(&calibration.robot, Some(&calibration.fit())))
}
