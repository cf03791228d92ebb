//! Failures, found while the interpreter's lock is released, and the Python exceptions that they become.

use miette::Diagnostic;
use pyo3::prelude::*;
use sim::params::ParamError;
use sim::steady::SolveError;
use sim::step::StepError;
use sim::trial::profile::ProfileError;
use std::path::Path;
use study::aim::AimError;
use study::output::OutputError;
use study::plan::PlanError;
use study::sweep::SweepError;
use study::text::{with_causes, word};
use study::twin::TwinError;

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
    /// Returns the failure of a wrong argument or parameter: `key` is its name, `reason` states what is possible instead.
    pub fn parameter(key: &str, reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self { class: PARAMETER, text: format!("{key}: {reason}"), key: key.to_owned(), reason, help: String::new() }
    }

    /// Returns another failure: `key` names the part that failed.
    pub fn new(key: &str, reason: impl Into<String>) -> Self {
        Self { class: ERROR, ..Self::parameter(key, reason) }
    }

    /// Returns the failure of stopped work; the exception of the signal takes its place.
    pub fn interrupted() -> Self {
        Self::new("work", "interrupted")
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

    /// Returns a failure with its causes and its help. An error that counts as wrong use on the command line is a wrong argument.
    pub fn of(error: &dyn Diagnostic) -> Self {
        let text = with_causes(error).join(": ");
        let is_wrong_use = error.code().is_some_and(|code| code.to_string() == study::WRONG_USE);
        let class = if is_wrong_use { PARAMETER } else { ERROR };
        let help = error.help().map(|help| help.to_string()).unwrap_or_default();
        Self { class, key: String::new(), reason: text.clone(), text, help }
    }
}

impl From<ParamError> for Failure {
    fn from(error: ParamError) -> Self {
        Self { text: error.to_string(), ..Self::parameter(error.key, error.reason) }
    }
}

impl From<ProfileError> for Failure {
    fn from(error: ProfileError) -> Self {
        Self::parameter("speeds", error.to_string())
    }
}

impl From<StepError> for Failure {
    fn from(error: StepError) -> Self {
        Self { text: error.to_string(), ..Self::new("solver", error.to_string()) }
    }
}

impl From<SolveError> for Failure {
    fn from(error: SolveError) -> Self {
        match error {
            SolveError::Parameter(error) => error.into(),
            SolveError::Profile(error) => error.into(),
            SolveError::Step(error) => error.into(),
            SolveError::Interrupted => Self::interrupted(),
        }
    }
}

impl From<AimError> for Failure {
    fn from(error: AimError) -> Self {
        match &error {
            AimError::TooFew { .. } => Self {
                help: "give two of yaw, pitch, roll, tilt and thrust, or more that agree".to_owned(),
                ..Self::of(&error)
            },
            AimError::OutOfRange { quantity, value, range } => {
                let reason = format!("cannot be {value}; give {} to {}", range.start(), range.end());
                Self::parameter(&word(quantity), reason)
            }
            AimError::Table { .. } | AimError::TooSmall { .. } => Self { key: "table".to_owned(), ..Self::of(&error) },
            AimError::Model { .. } | AimError::Overturned(_) | AimError::TimeOver => {
                Self { key: "solver".to_owned(), ..Self::of(&error) }
            }
            AimError::Interrupted => Self::interrupted(),
        }
    }
}

impl From<SweepError> for Failure {
    fn from(error: SweepError) -> Self {
        let help = |help: &str, failure: Self| Self { help: help.to_owned(), ..failure };
        match error {
            SweepError::Plan(error) => error.into(),
            SweepError::Other { .. } | SweepError::Exists { .. } | SweepError::Version { .. } => {
                help("name another folder", Self { key: "out".to_owned(), ..Self::of(&error) })
            }
            SweepError::Manifest { ref path, .. } => help("begin again in another folder", Self::of_file(path, &error)),
            SweepError::Io { ref path, .. } => help(
                "check that the folder is readable and writable, and that the disk has space; then go on",
                Self::of_file(path, &error),
            ),
            SweepError::Missing { ref folder, .. } => help("go on with the same plan", Self::of_file(folder, &error)),
            SweepError::NotASweep { ref folder } | SweepError::Results { ref folder, .. } => {
                Self::of_file(folder, &error)
            }
            SweepError::Table { ref path, .. } => Self::of_file(path, &error),
            SweepError::Threads(_) => Self { key: "threads".to_owned(), ..Self::of(&error) },
        }
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        let (OutputError::Exists { path }
        | OutputError::Folder { path, .. }
        | OutputError::Ending { path, .. }
        | OutputError::Write { path, .. }) = &error;
        Self::of_file(path, &error)
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

impl From<TwinError> for Failure {
    fn from(error: TwinError) -> Self {
        Self::of(&error)
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
