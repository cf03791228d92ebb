//! A session: a folder with one log for each attempt at each trial of a plan, and the plan.
//!
//! What was done is read from the logs themselves; the folder keeps no second account of it.

use crate::log::{End, LogError};
use crate::plan::{Plan, PlanError, Trial};
use miette::Diagnostic;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A session's folder.
#[derive(Debug)]
pub struct Session {
    folder: PathBuf,
    plan: Plan,
}

/// Why a folder cannot be used as a session.
#[derive(Error, Diagnostic, Debug)]
pub enum SessionError {
    /// It could not be created, read or listed.
    #[error("{}", path.display())]
    #[diagnostic(help("check that the path exists and may be read and written"))]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Its plan does not read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
    /// A log in it does not read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
}

/// How far a trial is.
#[derive(Clone, PartialEq, Debug)]
pub struct TrialState {
    /// Its logs, in the order of the attempts, with how each ended; `None`: cut off, or not readable.
    pub attempts: Vec<(PathBuf, Option<End>)>,
}

impl TrialState {
    /// The log that holds the whole trial.
    pub fn complete(&self) -> Option<&Path> {
        self.attempts.iter().rev().find(|(_, end)| *end == Some(End::Complete)).map(|(path, _)| path.as_path())
    }
}

impl Session {
    /// Starts a session of `plan` in `folder`, which must not hold one.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn create(folder: &Path, plan: &Plan) -> Result<Self, SessionError> {
        todo!("{folder:?} {plan:?}")
    }

    /// Goes on with the session of `plan` in `folder`, or starts it.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn resume(folder: &Path, plan: &Plan) -> Result<Self, SessionError> {
        todo!("{folder:?} {plan:?}")
    }

    /// Reads the session in `folder`.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        todo!("{folder:?}")
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// How far a trial is.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn state(&self, trial: &Trial) -> Result<TrialState, SessionError> {
        todo!("{trial:?}")
    }

    /// The number and the log of the next attempt at a trial.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn next_attempt(&self, trial: &Trial) -> Result<(u32, PathBuf), SessionError> {
        todo!("{trial:?}")
    }
}

/// The folder that a plan's session takes when the user names none: the plan's name, made fit for a file's name.
pub fn default_folder(plan: &Plan) -> PathBuf {
    todo!("{plan:?}")
}
