//! Errors of modelled trials.

use crate::session::SessionError;
use biflag_log::LogError;
use miette::Diagnostic;
use sim::params::ParamError;
use sim::steady::SolveError;
use sim::step::StepError;
use sim::trial::profile::ProfileError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a trial could not be computed.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum ModelError {
    /// The user interrupted the trial.
    #[error("interrupted")]
    #[diagnostic(help("continue with --resume"))]
    Interrupted,
    /// The solver failed.
    #[error("trial {trial}: {error}")]
    #[diagnostic(help(
        "the log has what was recorded until then; change the robot's file as suggested and pass it with --robot"
    ))]
    Step { trial: String, error: StepError },
    /// A parameter is invalid.
    #[error(transparent)]
    #[diagnostic(code(wrong_use), help("correct it in the robot's file"))]
    Parameter(#[from] ParamError),
    /// The phases of the trial do not give a valid speed profile.
    #[error("trial {trial}: {error}")]
    #[diagnostic(code(wrong_use), help("correct the durations and speeds in the plan"))]
    Profile { trial: String, error: ProfileError },
    /// The log could not be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// The finished log could not be renamed.
    #[error("{}: the finished log cannot be moved here", path.display())]
    #[diagnostic(help("check that the folder is writable and the log open nowhere else, then continue with --resume"))]
    Place { path: PathBuf, source: std::io::Error },
    /// The threads could not be started.
    #[error("cannot start the threads: {0}")]
    #[diagnostic(help("use fewer threads with --jobs"))]
    Threads(rayon::ThreadPoolBuildError),
    /// The session's folder cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
}

impl ModelError {
    /// Converts an error of the solver in this trial.
    pub(super) fn of(trial: &str, error: SolveError) -> Self {
        let trial = trial.to_owned();
        match error {
            SolveError::Interrupted => Self::Interrupted,
            SolveError::Parameter(error) => Self::Parameter(error),
            SolveError::Profile(error) => Self::Profile { trial, error },
            SolveError::Step(error) => Self::Step { trial, error },
        }
    }
}
