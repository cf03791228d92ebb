//! What can go wrong with a log.

use miette::Diagnostic;
use std::path::PathBuf;
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
}
