//! What can be wrong with a session's folder.

use crate::log::LogError;
use crate::plan::PlanError;
use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why a folder cannot be used as a session.
#[derive(Error, Diagnostic, Debug)]
pub enum SessionError {
    /// It could not be created, read or listed.
    #[error("{}: cannot be used", path.display())]
    #[diagnostic(help("check that the folder exists and may be read and written"))]
    Io {
        /// The folder or file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It holds a session already.
    #[error("{}: holds a session already", folder.display())]
    #[diagnostic(code(wrong_use), help("go on with it by --resume, or name another folder with --out"))]
    Exists {
        /// The folder.
        folder: PathBuf,
    },
    /// It holds logs that belong to no session.
    #[error("{}: holds logs already, such as {log}, but no session", folder.display())]
    #[diagnostic(code(wrong_use), help("name another folder with --out"))]
    StrayLog {
        /// The folder.
        folder: PathBuf,
        /// One of them.
        log: String,
    },
    /// It holds a session of other trials.
    #[error("{}: holds the session of another plan: {difference} differ", folder.display())]
    #[diagnostic(
        code(wrong_use),
        help("name another folder with --out, or go on with the plan that began the session")
    )]
    OtherPlan {
        /// The folder.
        folder: PathBuf,
        /// In what the plans differ.
        difference: &'static str,
    },
    /// Another program writes into it.
    #[error("{}: another biflag writes into this session", folder.display())]
    #[diagnostic(help("wait until it has ended, or name another folder with --out"))]
    InUse {
        /// The folder.
        folder: PathBuf,
    },
    /// Its trials ran on something else.
    #[error("{}: its trials ran {was}, such as {}; the next ones would run {is}", folder.display(), log.display())]
    #[diagnostic(
        code(wrong_use),
        help("go on as the session began, or name another folder with --out: trials of one session are comparable")
    )]
    OtherRig {
        /// The folder.
        folder: PathBuf,
        /// The last of its complete logs.
        log: PathBuf,
        /// Where or with what they ran.
        was: String,
        /// Where or with what the next ones would.
        is: String,
    },
    /// It is no session.
    #[error("{}: is not a session's folder: it has no session.toml", folder.display())]
    #[diagnostic(code(wrong_use), help("name the folder that `biflag record` or `biflag simulate` wrote"))]
    NotASession {
        /// The folder.
        folder: PathBuf,
    },
    /// Its manifest does not read.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help("the logs beside it are good without it; begin a new session in another folder"))]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
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
