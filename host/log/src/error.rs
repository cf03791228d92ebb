//! Errors of reading and writing logs.

use crate::similar::did_you_mean;
use miette::Diagnostic;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a log could not be written or read.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum LogError {
    /// The file already exists; logs are never overwritten.
    #[error("{}: already exists", path.display())]
    #[diagnostic(code(wrong_use), help("a log is never overwritten: give another name, or move the file away"))]
    Exists { path: PathBuf },
    /// The folder of the file does not exist.
    #[error("{}: cannot be created: there is no such folder", path.display())]
    #[diagnostic(code(wrong_use), help("name a file in a folder that exists"))]
    NoFolder { path: PathBuf },
    /// The file could not be created.
    #[error("{}: cannot be created", path.display())]
    #[diagnostic(help("check that the folder exists and is writable, and that the disk has space"))]
    Create { path: PathBuf, source: std::io::Error },
    /// Writing failed. The bytes written so far stay in the file, as after a crash; of a computed trial, none.
    #[error("{}: cannot be written; {kept} bytes were kept", path.display())]
    #[diagnostic(help("make room or reconnect the disk; {}", match kept {
        0 => "then repeat the command, in a session with --resume",
        _ => "`biflag recover` makes an intact log from the bytes that were kept, and --resume repeats the trial of a session",
    }))]
    Write { path: PathBuf, kept: u64, source: std::io::Error },
    /// Another program removed or changed the file while it was written.
    #[error("{}: the log was {how} while it was written", path.display())]
    #[diagnostic(help("keep other programs away from the session folder; `--resume` repeats the trial"))]
    Changed { path: PathBuf, how: &'static str },
    /// The file does not exist.
    #[error("{}: no such log", path.display())]
    #[diagnostic(code(wrong_use), help("{}", did_you_mean(path, "check the path")))]
    Missing { path: PathBuf },
    /// The file could not be read.
    #[error("{}: cannot be read", path.display())]
    #[diagnostic(help("check the permissions of the file and the disk"))]
    Read { path: PathBuf, source: std::io::Error },
    /// The path names a folder or a device.
    #[error("{}: is not a file", path.display())]
    #[diagnostic(code(wrong_use), help("name a log, a file that ends in .mcap"))]
    NotAFile { path: PathBuf },
    /// The file is empty.
    #[error("{}: is empty", path.display())]
    #[diagnostic(help("nothing was recorded; repeat the trial with `biflag record PLAN --resume`"))]
    Empty { path: PathBuf },
    /// The file ends within its first record.
    #[error("{}: is cut off before its first record", path.display())]
    #[diagnostic(help("nothing is left to recover; repeat the trial with `biflag record PLAN --resume`"))]
    NothingLeft { path: PathBuf },
    /// The file is of another kind.
    #[error("{}: is not an MCAP file", path.display())]
    #[diagnostic(code(wrong_use), help("name a log, a .mcap file in a session folder; `biflag import` makes one"))]
    NotMcap { path: PathBuf },
    /// The file is an MCAP file of another program.
    #[error("{}: is an MCAP file, but not a biflag log", path.display())]
    #[diagnostic(code(wrong_use), help("read it with the program that wrote it"))]
    NotOurs { path: PathBuf },
    /// The log is newer than this program.
    #[error("{}: has log format {found}, but this program reads formats up to {}", path.display(), super::meta::FORMAT)]
    #[diagnostic(help("use biflag {program} or newer"))]
    Version { path: PathBuf, found: u32, program: String },
}

impl LogError {
    /// Returns whether the file could not be read. Its content is then unknown: it may be an intact log once its permissions or
    /// its disk are in order.
    pub fn is_of_reading(&self) -> bool {
        matches!(self, Self::Read { .. } | Self::Missing { .. })
    }

    /// Converts an error of creating a log.
    pub(super) fn creating(path: &Path, source: std::io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            std::io::ErrorKind::AlreadyExists => Self::Exists { path },
            std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory => Self::NoFolder { path },
            _ => Self::Create { path, source },
        }
    }

    /// Converts an error of opening or reading a log.
    pub(super) fn reading(path: &Path, source: std::io::Error) -> Self {
        match source.kind() {
            std::io::ErrorKind::NotFound => Self::Missing { path: path.to_owned() },
            _ => Self::Read { path: path.to_owned(), source },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Error, ErrorKind};

    #[test]
    fn file_that_cannot_be_read_is_told_from_a_damaged_one() {
        let path = || PathBuf::from("a.mcap");
        for kind in
            [ErrorKind::PermissionDenied, ErrorKind::NotFound, ErrorKind::Other, ErrorKind::StaleNetworkFileHandle]
        {
            assert!(LogError::reading(&path(), Error::from(kind)).is_of_reading(), "{kind}");
        }
        let of_content = [
            LogError::Empty { path: path() },
            LogError::NothingLeft { path: path() },
            LogError::NotMcap { path: path() },
            LogError::NotOurs { path: path() },
            LogError::NotAFile { path: path() },
            LogError::Version { path: path(), found: 9, program: "9.0.0".to_owned() },
        ];
        assert!(!of_content.iter().any(LogError::is_of_reading));
    }
}
