//! Text files that must not exist yet.

use crate::failure::Failure;
use biflag_log::atomic_file;
use std::path::Path;

/// Checks that there is no such file.
///
/// # Errors
/// One that exists.
pub fn check(path: &Path) -> Result<(), Failure> {
    if path.exists() { Err(Failure::new(&path.display().to_string(), "already exists")) } else { Ok(()) }
}

/// Writes the file.
///
/// # Errors
/// A file that exists, or cannot be written.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    check(path)?;
    atomic_file::create(path, text)
        .map_err(|error| Failure::new(&path.display().to_string(), format!("cannot be written: {error}")))
}
