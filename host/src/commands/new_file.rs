//! The text file that a command writes, which must not exist.

use super::WRONG_USE;
use biflag_log::atomic_file::{self, Draft};
use miette::{Context, IntoDiagnostic};
use std::path::Path;

/// Checks that the file can be written, before work that may take an hour.
///
/// # Errors
/// A file that exists, and a folder that does not or cannot be written.
pub fn check(path: &Path) -> miette::Result<()> {
    if path.exists() {
        let help = "name another file with -o, or move this one away";
        return Err(miette::miette!(code = WRONG_USE, help = help, "{}: already exists", path.display()));
    }
    Draft::create(path).map(drop).map_err(|error| {
        let help = "name a file in a folder that exists and is writable";
        miette::miette!(code = WRONG_USE, help = help, "{}: cannot be written: {error}", path.display())
    })
}

/// Writes the file.
///
/// # Errors
/// A file that cannot be written.
pub fn write(path: &Path, text: &str) -> miette::Result<()> {
    let written = atomic_file::create(path, text);
    written.into_diagnostic().wrap_err_with(|| format!("{}: cannot be written", path.display()))
}
