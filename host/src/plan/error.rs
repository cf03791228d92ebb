//! What can be wrong with a plan. All of it is wrong use; every message names the place.

use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why a plan was not accepted.
#[derive(Error, Diagnostic, Debug)]
pub enum PlanError {
    /// The file, or the robot's file that it names, cannot be read.
    #[error("{}: cannot be read", path.display())]
    #[diagnostic(code(wrong_use), help("check the path; a plan names the robot's file relative to itself"))]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Something in it is wrong.
    #[error("{place}: {what}")]
    #[diagnostic(code(wrong_use), help("{cure}"))]
    Invalid {
        /// File, line and column.
        place: String,
        /// What is wrong.
        what: String,
        /// What to do about it.
        cure: String,
    },
}
