//! Errors of session folders.

use crate::plan::PlanError;
use biflag_log::LogError;
use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why a folder cannot be used as a session.
#[derive(Error, Diagnostic, Debug)]
pub enum SessionError {
    /// The folder could not be created, read or listed.
    #[error("{}: cannot be used", path.display())]
    #[diagnostic(help("check that the folder exists, and that it is readable and writable"))]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The folder already contains a session.
    #[error("{}: already contains a session", folder.display())]
    #[diagnostic(code(wrong_use), help("continue it with --resume, or name another folder with --out"))]
    Exists {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder contains logs but no session.
    #[error("{}: already contains logs, such as {log}, but no session", folder.display())]
    #[diagnostic(code(wrong_use), help("name another folder with --out"))]
    StrayLog {
        /// The folder.
        folder: PathBuf,
        /// One of the logs.
        log: String,
    },
    /// The folder contains the session of another plan.
    #[error("{}: contains the session of another plan: {difference} differ", folder.display())]
    #[diagnostic(code(wrong_use), help("name another folder with --out, or continue with the plan of the session"))]
    OtherPlan {
        /// The folder.
        folder: PathBuf,
        /// The part in which the plans differ.
        difference: &'static str,
    },
    /// Another program is writing into the session.
    #[error("{}: another biflag is writing into this session", folder.display())]
    #[diagnostic(help("wait until it ends, or name another folder with --out"))]
    InUse {
        /// The folder.
        folder: PathBuf,
    },
    /// The session's trials ran in another place or with other settings.
    #[error("{}: its trials ran {was}, such as {}; the next ones would run {is}", folder.display(), log.display())]
    #[diagnostic(
        code(wrong_use),
        help("continue as the session began, or name another folder with --out: its trials must stay comparable")
    )]
    OtherRig {
        /// The folder.
        folder: PathBuf,
        /// The last complete log.
        log: PathBuf,
        /// Where or with which settings they ran.
        was: String,
        /// Where or with which settings the next ones would run.
        is: String,
    },
    /// The folder is not a session folder.
    #[error("{}: is not a session folder: it has no session.toml", folder.display())]
    #[diagnostic(code(wrong_use), help("name a folder written by `biflag record` or `biflag simulate`"))]
    NotASession {
        /// The folder.
        folder: PathBuf,
    },
    /// The manifest cannot be read.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help("the logs can still be read; start a new session in another folder"))]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What is wrong with the manifest.
        reason: String,
    },
    /// The session's plan cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
    /// A log in the session cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
}
