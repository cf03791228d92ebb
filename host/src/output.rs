//! A file that a command writes. It is complete or not there at all, and what prevents it is one error in all commands.

use biflag_log::atomic_file::{self, Draft};
use miette::Diagnostic;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file is not written.
#[derive(Error, Diagnostic, Debug)]
pub enum OutputError {
    /// The file exists and is not to be replaced.
    #[error("{}: already exists", path.display())]
    #[diagnostic(code(wrong_use), help("name another file, or move this one away"))]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The folder of the file does not exist or takes no files.
    #[error("{}: cannot be written: {reason}", path.display())]
    #[diagnostic(code(wrong_use), help("name a file in a folder that exists and is writable"))]
    Folder {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The file could not be written.
    #[error("{}: cannot be written", path.display())]
    #[diagnostic(help("check that the folder exists and is writable, and that the disk has space"))]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl OutputError {
    fn new(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            ErrorKind::AlreadyExists => Self::Exists { path },
            ErrorKind::NotFound | ErrorKind::NotADirectory => {
                Self::Folder { path, reason: "there is no such folder".to_owned() }
            }
            _ => Self::Write { path, source },
        }
    }
}

/// Checks that a new file can be written, before work that may take an hour.
///
/// # Errors
/// [`OutputError::Exists`], [`OutputError::Folder`].
pub fn check_new(path: &Path) -> Result<(), OutputError> {
    if path.exists() {
        return Err(OutputError::Exists { path: path.to_owned() });
    }
    Draft::create(path).map(drop).map_err(|source| match OutputError::new(path, source) {
        OutputError::Write { path, source } => OutputError::Folder { path, reason: source.to_string() },
        other => other,
    })
}

/// Writes a text to a file that must not exist.
///
/// # Errors
/// [`OutputError`].
pub fn write_new(path: &Path, text: &str) -> Result<(), OutputError> {
    atomic_file::create(path, text).map_err(|source| OutputError::new(path, source))
}

/// Writes a file through a draft beside it, in place of an older one.
///
/// # Errors
/// [`OutputError`]; an older file is unchanged then.
pub fn replace(path: &Path, content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<(), OutputError> {
    atomic_file::replace(path, content).map_err(|source| OutputError::new(path, source))
}
