//! What can be wrong with a plan, a robot file, or a file of board settings. All of it is wrong use.

use biflag_log::similar::did_you_mean;
use miette::Diagnostic;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file was not accepted.
#[derive(Error, Diagnostic, Debug)]
pub enum PlanError {
    /// The file cannot be read.
    #[error("{}: the {noun} cannot be read", path.display())]
    #[diagnostic(code(wrong_use), help("{}", cure(path, noun)))]
    Read {
        /// The file.
        path: PathBuf,
        /// What it was read as, such as `plan`.
        noun: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// Something in it is wrong.
    #[error("{place}: {what}")]
    #[diagnostic(code(wrong_use), help("{cure}"))]
    Invalid {
        /// File, line and column; the file alone where no line is to blame.
        place: String,
        /// What is wrong.
        what: String,
        /// How to correct it.
        cure: String,
    },
}

/// Says what to do about a file that cannot be read.
fn cure(path: &Path, noun: &str) -> String {
    if path.is_dir() {
        let folder = path.display();
        return match noun {
            "plan" => format!(
                "{folder} is a folder: name the plan itself; `biflag record PLAN --out {folder} --resume` goes on with a session, \
                 and `biflag simulate --from {folder}` repeats its trials in the model"
            ),
            _ => format!("{folder} is a folder: name a file in it"),
        };
    }
    did_you_mean(
        path,
        "check the path; a path in a plan is relative to the plan's folder; `biflag plans` lists those inside biflag",
    )
}
