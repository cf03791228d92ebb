//! Files that commands write: each is written whole or not at all.

use crate::text::listed;
use biflag_log::atomic_file::{self, Draft, folder_of};
use miette::Diagnostic;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind};
use std::path::{Path, PathBuf, is_separator};
use thiserror::Error;

/// Why a file is not written.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum OutputError {
    /// The file exists and is not to be replaced.
    #[error("{}: already exists", path.display())]
    #[diagnostic(code(wrong_use), help("name another file, or move this one away"))]
    Exists { path: PathBuf },
    /// The path does not name a file, or its folder does not exist or is not writable.
    #[error("{}: cannot be written: {reason}", path.display())]
    #[diagnostic(
        code(wrong_use),
        help("name a file in a folder that exists and is writable, and that no other program has open")
    )]
    Folder { path: PathBuf, reason: String },
    /// The ending of the name does not fit the content of the file.
    #[error("{}: the name must end with {endings}", path.display())]
    #[diagnostic(code(wrong_use))]
    Ending { path: PathBuf, endings: String },
    /// The file could not be written.
    #[error("{}: cannot be written", path.display())]
    #[diagnostic(help("check that the folder exists and is writable, and that the disk has space"))]
    Write { path: PathBuf, source: io::Error },
}

impl OutputError {
    /// Returns the reason why the file at `path` was not written.
    pub fn new(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            ErrorKind::AlreadyExists => Self::Exists { path },
            ErrorKind::NotFound | ErrorKind::NotADirectory if !folder_of(&path).is_dir() => {
                Self::Folder { path, reason: "there is no such folder".to_owned() }
            }
            ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
                Self::Folder { path, reason: source.to_string() }
            }
            _ => Self::Write { path, source },
        }
    }
}

/// Returns the index of the ending that the name of a file has. Case does not matter.
///
/// # Errors
/// [`OutputError::Ending`].
pub fn ending(path: &Path, endings: &[impl AsRef<str>]) -> Result<usize, OutputError> {
    let found = path.extension().unwrap_or_default();
    endings.iter().position(|ending| found.eq_ignore_ascii_case(ending.as_ref())).ok_or_else(|| {
        let endings: Vec<_> = endings.iter().map(|ending| format!(".{}", ending.as_ref())).collect();
        OutputError::Ending { path: path.to_owned(), endings: listed(&endings).replace(" and ", " or ") }
    })
}

/// Returns whether a name has an ending; digits, as in `run1.5`, are not an ending.
pub fn has_ending(path: &Path) -> bool {
    path.extension().is_some_and(|ending| !ending.as_encoded_bytes().iter().all(u8::is_ascii_digit))
}

/// Refuses a path that cannot become a file.
fn check_name(path: &Path) -> Result<(), OutputError> {
    let ends_as_folder = path.as_os_str().as_encoded_bytes().last().is_some_and(|byte| is_separator(char::from(*byte)));
    let is_folder = ends_as_folder || path.file_name().is_none() || path.is_dir();
    let refused = || OutputError::Folder { path: path.to_owned(), reason: "it is not the name of a file".to_owned() };
    if is_folder { Err(refused()) } else { Ok(()) }
}

/// Checks that a new file can be written, before work that may take an hour.
///
/// # Errors
/// [`OutputError`].
pub fn check_new(path: &Path) -> Result<(), OutputError> {
    check_name(path)?;
    // A dangling link also occupies the name.
    if path.symlink_metadata().is_ok() {
        return Err(OutputError::Exists { path: path.to_owned() });
    }
    Draft::create(path).map(drop).map_err(|source| OutputError::new(path, source))
}

/// Writes a text to a file that must not exist.
///
/// # Errors
/// [`OutputError`].
pub fn write_new(path: &Path, text: &str) -> Result<(), OutputError> {
    check_name(path)?;
    atomic_file::create(path, text).map_err(|source| OutputError::new(path, source))
}

/// Writes a file through a draft beside it, in place of an older one.
///
/// # Errors
/// [`OutputError`]; an older file is unchanged then.
pub fn replace(path: &Path, content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<(), OutputError> {
    check_name(path)?;
    atomic_file::replace(path, content).map_err(|source| OutputError::new(path, source))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_written_is_refused_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("old"), "").unwrap();
        std::os::unix::fs::symlink(at("nothing"), at("link")).unwrap();
        std::fs::create_dir(at("folder")).unwrap();
        for name in ["old", "link"] {
            assert!(matches!(check_new(&at(name)), Err(OutputError::Exists { .. })), "{name}");
        }
        for path in [PathBuf::new(), at("new/"), at("folder"), at("folder/.."), at("missing/new")] {
            for result in [check_new(&path), write_new(&path, ""), replace(&path, |_| Ok(()))] {
                assert!(matches!(result, Err(OutputError::Folder { .. })), "{path:?}: {result:?}");
            }
        }
        check_new(&at("new")).unwrap();
        assert!(!at("new").exists());
    }
}
