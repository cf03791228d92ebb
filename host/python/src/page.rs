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
