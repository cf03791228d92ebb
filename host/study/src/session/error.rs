//! Errors of session folders.

use crate::plan::error::{A_SWEEP, is_sweep};
use crate::plan::{PlanError, Shipped};
use biflag_log::LogError;
use biflag_log::similar::did_you_mean;
use miette::Diagnostic;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use thiserror::Error;

const MADE_BY: &str =
    "name a folder written by `biflag record` or `biflag simulate`; `biflag recover` rebuilds a lost session.toml";

/// Returns what to do with a folder that is not a session.
fn instead(folder: &Path) -> String {
    match Shipped::find(folder).filter(|file| !file.is_robot() && !folder.exists()) {
        Some(plan) => {
            format!("a plan inside biflag has this name: `biflag simulate {}` computes its trials", plan.name)
        }
        None => (if is_sweep(folder) { A_SWEEP } else { MADE_BY }).to_owned(),
    }
}

/// Why a folder cannot be used as a session.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum SessionError {
    /// The folder could not be created, read or listed.
    #[error("{}: cannot be used", path.display())]
    #[diagnostic(help("check that the folder exists, and that it is readable and writable"))]
    Io { path: PathBuf, source: std::io::Error },
    /// The name is taken by a file, or is not valid for a folder.
    #[error("{}: is not a folder and cannot become one", path.display())]
    #[diagnostic(code(wrong_use), help("name another folder with --out"))]
    NotAFolder { path: PathBuf, source: std::io::Error },
    /// The folder has no logs to rebuild a session from.
    #[error("{}: has no session.toml and no logs of biflag to rebuild it from", folder.display())]
    #[diagnostic(code(wrong_use), help("name a session folder, or a log that is cut off or damaged"))]
    NothingToRebuild { folder: PathBuf },
    /// The logs in the folder belong to different plans.
    #[error("{}: has logs of different plans, such as {} and {}: {difference}", folder.display(), one.display(), other.display())]
    #[diagnostic(code(wrong_use), help("move the logs of each plan into a folder of their own"))]
    DifferentPlans { folder: PathBuf, one: PathBuf, other: PathBuf, difference: &'static str },
    /// The folder already contains a session, or a sweep.
    #[error("{}: already contains {what}", folder.display())]
    #[diagnostic(code(wrong_use), help("name another folder with --out, or continue a session with --resume"))]
    Exists { folder: PathBuf, what: &'static str },
    /// The folder contains logs but no session.
    #[error("{}: already contains logs, such as {log}, but no session", folder.display())]
    #[diagnostic(
        code(wrong_use),
        help("rebuild the session with `biflag recover {}`, or name another folder with --out", folder.display())
    )]
    StrayLog { folder: PathBuf, log: String },
    /// The folder contains the session of another plan.
    #[error("{}: contains the session of another plan: {difference}", folder.display())]
    #[diagnostic(code(wrong_use), help("name another folder with --out, or continue with the plan of the session"))]
    OtherPlan { folder: PathBuf, difference: &'static str },
    /// Another program is writing into the session.
    #[error("{}: another biflag is writing into this session", folder.display())]
    #[diagnostic(help("wait until it ends, or name another folder with --out"))]
    InUse { folder: PathBuf },
    /// The log or the session is still being written, so it cannot be recovered.
    #[error("{}: is being recorded: another biflag is writing into the session", path.display())]
    #[diagnostic(help("wait for the end of the recording; a log that is complete then needs no recovery"))]
    BeingRecorded { path: PathBuf },
    /// The session's trials ran on another rig or with other settings.
    #[error("{}: its trials ran {was}, such as {}; the next ones would run {is}", folder.display(), log.display())]
    #[diagnostic(
        code(wrong_use),
        help("continue as the session began, or name another folder with --out: its trials must stay comparable")
    )]
    OtherRig { folder: PathBuf, log: PathBuf, was: String, is: String },
    /// The folder is not a session folder.
    #[error("{}: is not a session folder: it has no session.toml", folder.display())]
    #[diagnostic(code(wrong_use), help("{}", did_you_mean(folder, &instead(folder))))]
    NotASession { folder: PathBuf },
    /// The manifest cannot be read.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help("the logs can still be read; `biflag recover` rebuilds session.toml from them"))]
    Manifest { path: PathBuf, reason: String },
    /// A newer version of the program wrote the manifest.
    #[error("{}: written by biflag {program}, which is newer than this one", path.display())]
    #[diagnostic(help("use that version, or a newer one"))]
    Newer { path: PathBuf, program: String },
    /// The session's plan cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
    /// A log in the session cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
}

impl SessionError {
    /// Converts an error of creating a session folder.
    pub(super) fn creating(folder: &Path, source: std::io::Error) -> Self {
        let path = folder.to_owned();
        match source.kind() {
            ErrorKind::AlreadyExists | ErrorKind::NotADirectory | ErrorKind::InvalidFilename => {
                Self::NotAFolder { path, source }
            }
            _ => Self::Io { path, source },
        }
    }
}
