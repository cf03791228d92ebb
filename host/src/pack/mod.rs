//! A session as one archive for a repository of research data: logs, page, figures and tables, with a readme, SHA-256 sums
//! and [RO-Crate](https://www.researchobject.org/ro-crate/) 1.1 metadata.
//!
//! ```text
//! README.md                the trials and their results, the folders, how to check and read the files
//! ro-crate-metadata.json   the same for programs
//! manifest-sha256.txt      for `sha256sum --check`
//! plan.toml, robot.toml, sensor.toml
//! session/                 the session's folder as it is
//! tables/                  `biflag export`
//! figures/                 `biflag figure trial` of each trial, `biflag figure map`
//! report.html              `biflag report`
//! ```

mod archive;
mod content;
mod metadata;
mod readme;

pub use readme::About;

use crate::progress::Progress;
use crate::session::{Session, SessionError, is_in_use};
use crate::trial::LogFinding;
use content::Content;
use miette::Report;
use serde::Serialize;
use std::io;
use std::path::Path;
use study::output;

/// A written archive.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Packed {
    /// Names of the files in the archive.
    pub entries: Vec<String>,
    /// Its size.
    pub bytes: u64,
    /// Findings about the trials.
    pub findings: Vec<LogFinding>,
    /// Notes on what is missing in the archive, or should be added.
    pub notes: Vec<String>,
    /// Whether there are no warnings about its content.
    #[serde(skip)]
    pub is_sound: bool,
}

/// Returns a function that describes an error of reading a file or a folder.
fn reading(path: &Path) -> impl Fn(io::Error) -> Report {
    let path = path.to_owned();
    move |error| Report::from_err(error).wrap_err(format!("{}: cannot be read", path.display()))
}

/// Packs the session in `folder` into the new file `out`.
///
/// # Errors
/// A file cannot be read or written; nothing is left of an unfinished archive.
pub fn pack(folder: &Path, out: &Path, about: &About, progress: &Progress) -> miette::Result<Packed> {
    let session = Session::open(folder)?;
    if is_in_use(folder) {
        return Err(SessionError::InUse { folder: folder.to_owned() }.into());
    }
    output::check_new(out)?;
    let made = tempfile::tempdir().map_err(reading(Path::new("a temporary folder")))?;
    let mut content = Content::of(&session, made.path(), about, progress)?;
    progress.phase("pack", "checksums");
    let sums = archive::sums(&content.entries)?;
    metadata::add(&mut content, &session, about, &sums)?;
    progress.phase("pack", "archive");
    let bytes = archive::write(&content.entries, &sums, out)?;
    let entries = content.entries.into_iter().map(|entry| entry.name).collect();
    Ok(Packed { entries, bytes, findings: content.findings, notes: content.notes, is_sound: content.is_sound })
}
