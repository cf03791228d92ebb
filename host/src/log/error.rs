//! What can go wrong with a log.

use miette::Diagnostic;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a log could not be written or read.
#[derive(Error, Diagnostic, Debug)]
pub enum LogError {
    /// The file is there already; logs are never overwritten.
    #[error("{}: exists already", path.display())]
    #[diagnostic(help("a log is never overwritten: give another name, or move the file away"))]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// It could not be created.
    #[error("{}: cannot be created", path.display())]
    #[diagnostic(help("check that the folder exists and may be written to"))]
    Create {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Writing failed. The log is as good as one of a killed program: what was written stays.
    #[error("{}: cannot be written; {kept} bytes are kept", path.display())]
    #[diagnostic(help(
        "make room or reconnect the disk; `biflag recover` makes a clean log of what was kept, and `--resume` repeats \
         the trial"
    ))]
    Write {
        /// The file.
        path: PathBuf,
        /// Bytes that are in the file.
        kept: u64,
        /// Why.
        source: std::io::Error,
    },
    /// It is not there.
    #[error("{}: there is no such log", path.display())]
    #[diagnostic(code(wrong_use), help("check the path"))]
    Missing {
        /// The path.
        path: PathBuf,
    },
    /// It could not be read.
    #[error("{}: cannot be read", path.display())]
    #[diagnostic(help("check that the file may be read"))]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A folder, or a device.
    #[error("{}: is not a file", path.display())]
    #[diagnostic(help("name a log, a file that ends in .mcap"))]
    NotAFile {
        /// What it is not.
        path: PathBuf,
    },
    /// There is nothing in it.
    #[error("{}: is empty", path.display())]
    #[diagnostic(help("nothing was recorded; repeat the trial with `biflag record PLAN --resume`"))]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// It ends within its first record.
    #[error("{}: is cut off before its first record", path.display())]
    #[diagnostic(help("nothing is left to recover; repeat the trial with `biflag record PLAN --resume`"))]
    NothingLeft {
        /// The file.
        path: PathBuf,
    },
    /// Some other kind of file.
    #[error("{}: is not an MCAP file", path.display())]
    #[diagnostic(help("logs are the .mcap files in a session's folder"))]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// Somebody else's log.
    #[error("{}: is an MCAP file, but not a log of biflag", path.display())]
    #[diagnostic(help("read it with the program that wrote it"))]
    NotOurs {
        /// The file.
        path: PathBuf,
    },
    /// A log that is newer than this program.
    #[error("{}: is a log of format {found}, and this program reads up to {}", path.display(), super::FORMAT)]
    #[diagnostic(help("use biflag {program} or newer"))]
    Version {
        /// The file.
        path: PathBuf,
        /// Its format.
        found: u32,
        /// The version of the program that wrote it.
        program: String,
    },
}

impl LogError {
    /// Why a log at this path could not be read.
    pub(super) fn reading(path: &Path, source: std::io::Error) -> Self {
        match source.kind() {
            std::io::ErrorKind::NotFound => Self::Missing { path: path.to_owned() },
            _ => Self::Read { path: path.to_owned(), source },
        }
    }
}
