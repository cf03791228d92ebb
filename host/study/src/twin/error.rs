//! Errors of replay, comparison and calibration.

use crate::plan::PlanError;
use crate::run::model::ModelError;
use crate::session::SessionError;
use crate::trial::{Data, Unusable};
use biflag_log::LogError;
use miette::Diagnostic;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a replay, a comparison or a calibration failed.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum TwinError {
    /// A log does not contain a usable trial.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help("{help}"))]
    Unusable { path: PathBuf, reason: String, help: &'static str },
    /// Two trials cannot be compared.
    #[error("{} and {}: {reason}", measured.display(), modelled.display())]
    #[diagnostic(code(wrong_use), help("{help}"))]
    Incomparable { measured: PathBuf, modelled: PathBuf, reason: String, help: &'static str },
    /// The robot's parameters in a log are invalid.
    #[error("{}: its robot parameters are invalid", path.display())]
    #[diagnostic(help("name the robot's file with --robot"))]
    Robot { path: PathBuf, source: Box<PlanError> },
    /// The fit did not converge.
    #[error("the fit failed: {reason}")]
    #[diagnostic(help("{help}"))]
    Fit { reason: String, help: &'static str },
    /// A log cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// The plan in a log cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
    /// A session's folder cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
    /// The model failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Model(#[from] ModelError),
}

impl TwinError {
    /// Returns the error for a trial that cannot be used.
    pub(super) fn unusable(data: &Data, Unusable { reason, help }: Unusable) -> Self {
        Self::Unusable { path: data.path.clone(), reason, help }
    }

    /// Returns the error for two trials that must not be compared.
    pub(super) fn incomparable([a, b]: [&Path; 2], reason: String, help: &'static str) -> Self {
        Self::Incomparable { measured: a.to_owned(), modelled: b.to_owned(), reason, help }
    }

    /// Returns the error for a trial with invalid robot parameters.
    pub(super) fn robot(data: &Data, source: PlanError) -> Self {
        Self::Robot { path: data.path.clone(), source: Box::new(source) }
    }
}
