//! What can be wrong with a plan. All of it is wrong use; every message names the place.

use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why a plan was not accepted.
#[derive(Error, Diagnostic, Debug)]
pub enum PlanError {
    /// The file cannot be read.
    #[error("{}: the plan cannot be read", path.display())]
    #[diagnostic(
        code(wrong_use),
        help("check the path, and that it is text in UTF-8; `biflag record --help` shows a plan")
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The robot's file that it names cannot be read.
    #[error("{}: the robot's file cannot be read", path.display())]
    #[diagnostic(code(wrong_use), help("correct `robot` in the plan; the path counts from the plan's folder"))]
    ReadRobot {
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
