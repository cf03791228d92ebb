//! What can go wrong when experiment and model are held against each other.

use crate::log::LogError;
use crate::model::ModelError;
use crate::plan::PlanError;
use crate::session::SessionError;
use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why there is no replay, no comparison or no calibration.
#[derive(Error, Diagnostic, Debug)]
pub enum TwinError {
    /// A log holds no trial that a model could go through.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help("{help}"))]
    Unusable {
        /// The log.
        path: PathBuf,
        /// What is missing.
        reason: String,
        /// What to do about it.
        help: &'static str,
    },
    /// Two trials that say nothing about each other.
    #[error("{} and {}: {reason}", measured.display(), modelled.display())]
    #[diagnostic(code(wrong_use), help("{help}"))]
    Incomparable {
        /// One of them.
        measured: PathBuf,
        /// The other.
        modelled: PathBuf,
        /// What keeps them apart.
        reason: String,
        /// What to do about it.
        help: &'static str,
    },
    /// A robot's parameters in a log do not read.
    #[error("{}: the robot's parameters in it do not read", path.display())]
    #[diagnostic(help("name the robot's file with --robot"))]
    Robot {
        /// The log.
        path: PathBuf,
        /// Why.
        source: Box<PlanError>,
    },
    /// A fit that came to nothing.
    #[error("the fit did not end: {reason}")]
    #[diagnostic(help("{help}"))]
    Fit {
        /// Why.
        reason: String,
        /// What to do about it.
        help: &'static str,
    },
    /// A file could not be read or written.
    #[error("{}: {what}", path.display())]
    #[diagnostic(help("check the path, and that it may be read and written"))]
    File {
        /// The file.
        path: PathBuf,
        /// What failed.
        what: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// A log does not read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// The plan in a log does not read.
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
