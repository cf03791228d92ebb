//! Failures, found while the interpreter's lock is released, and the Python exceptions that they become.

use host::plan::PlanError;
use miette::Diagnostic;
use pyo3::prelude::*;
use sim::params::ParamError;
use sim::profile::ProfileError;
use sim::step::StepError;
use std::path::Path;

/// Why a function failed.
#[derive(Debug)]
pub struct Failure {
    /// Name of the exception's class in `biflag`.
    class: &'static str,
    text: String,
    key: String,
    reason: String,
    help: String,
}

/// `biflag.ParameterError`, a `ValueError`.
const PARAMETER: &str = "ParameterError";

/// `biflag.Error`.
const ERROR: &str = "Error";

impl Failure {
    /// Returns a wrong argument or parameter: `key` is its name, `reason` what is possible instead.
    pub fn parameter(key: &str, reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self { class: PARAMETER, text: format!("{key}: {reason}"), key: key.to_owned(), reason, help: String::new() }
    }

    /// Returns the failure of an operation on a file.
    pub fn of_file(path: &Path, error: &dyn Diagnostic) -> Self {
        let key = path.display().to_string();
        let mut failure = Self::of(error);
        if !failure.text.contains(&key) {
            failure.text = format!("{key}: {}", failure.text);
        }
        failure.key = key;
        failure
    }

    /// Returns a failure with its causes and its help. One that the command line calls wrong use is a wrong argument.
    pub fn of(error: &dyn Diagnostic) -> Self {
        let mut text = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            let message = cause.to_string();
            if !text.contains(&message) {
                text += &format!(": {message}");
            }
            source = cause.source();
        }
        let is_wrong_use = error.code().is_some_and(|code| code.to_string() == host::commands::WRONG_USE);
        let class = if is_wrong_use { PARAMETER } else { ERROR };
        let help = error.help().map(|help| help.to_string()).unwrap_or_default();
        Self { class, key: String::new(), reason: text.clone(), text, help }
    }
}

impl From<ParamError> for Failure {
    fn from(error: ParamError) -> Self {
        let (key, reason) = (error.key.to_owned(), error.reason.clone());
        Self { class: PARAMETER, text: error.to_string(), key, reason, help: String::new() }
    }
}

impl From<ProfileError> for Failure {
    fn from(error: ProfileError) -> Self {
        Self::parameter("speeds", error.to_string())
    }
}

impl From<StepError> for Failure {
    fn from(error: StepError) -> Self {
        let text = error.to_string();
        Self { class: ERROR, reason: text.clone(), text, key: "solver".to_owned(), help: String::new() }
    }
}

impl From<PlanError> for Failure {
    fn from(error: PlanError) -> Self {
        let mut failure = Self::of(&error);
        if let PlanError::Invalid { place, what, .. } = error {
            (failure.key, failure.reason) = (place, what);
        }
        failure
    }
}

impl From<Failure> for PyErr {
    fn from(Failure { class, text, key, reason, help }: Failure) -> Self {
        Python::attach(|py| {
            let raised = || py.import("biflag._errors")?.getattr(class)?.call1((text, key, reason, help));
            raised().map_or_else(|error| error, PyErr::from_value)
        })
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}
