//! Pages that show the content of a log.

use crate::failure::Failure;
use std::path::Path;

/// A notebook of some pages stays small with a tenth of the largest page for each.
const PAGES: usize = 10;

/// Returns the page of a log.
///
/// # Errors
/// A file that is not a log.
pub fn of_log(path: &Path) -> Result<String, Failure> {
    page::report::html(path, PAGES).map_err(|error| Failure::of_file(path, &error))
}

/// Returns the page of a log called `name` that has no file: `write` writes one for the time being.
///
/// # Errors
/// Those of `write`, and a folder for temporary files that cannot be written.
pub fn of_unsaved(name: &str, write: impl FnOnce(&Path) -> Result<(), Failure>) -> Result<String, Failure> {
    let failed = |error: std::io::Error| Failure::parameter("page", error.to_string());
    let folder = tempfile::tempdir().map_err(failed)?;
    let log = folder.path().join(format!("{name}.mcap"));
    write(&log)?;
    of_log(&log)
}
