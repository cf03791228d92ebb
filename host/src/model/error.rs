//! What can go wrong with a modelled trial.

use crate::log::LogError;
use crate::session::SessionError;
use miette::Diagnostic;
use sim::params::ParamError;
use sim::profile::ProfileError;
use sim::step::StepError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a trial is not there.
#[derive(Error, Diagnostic, Debug)]
pub enum ModelError {
    /// The user ended it.
    #[error("interrupted")]
    #[diagnostic(help("go on with --resume"))]
    Interrupted,
    /// The solver could not go on.
    #[error("trial {trial}: {error}")]
    #[diagnostic(help("the log ends there; change the robot's file as said and give it with --robot"))]
    Step {
        /// The trial.
        trial: String,
        /// Where and why, and what to change.
        error: StepError,
    },
    /// A parameter cannot be.
    #[error(transparent)]
    #[diagnostic(code(wrong_use), help("correct it in the robot's file"))]
    Parameter(#[from] ParamError),
    /// The phases of the trial make no profile of speeds.
    #[error("trial {trial}: {error}")]
    #[diagnostic(code(wrong_use), help("correct the durations and speeds in the plan"))]
    Profile {
        /// The trial.
        trial: String,
        /// Why.
        error: ProfileError,
    },
    /// The log could not be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// The finished log could not be put in its place.
    #[error("{}: cannot be put in its place", path.display())]
    #[diagnostic(help("check that the folder may be written to, then go on with --resume"))]
    Place {
        /// The log.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// No threads to compute on.
    #[error("no threads to compute on: {0}")]
    #[diagnostic(help("ask for fewer with --jobs"))]
    Threads(rayon::ThreadPoolBuildError),
    /// The session's folder failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
}
