//! Errors of sweeps.

use super::RESULTS;
use crate::plan::PlanError;
use biflag_log::similar::did_you_mean;
use miette::Diagnostic;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The kind of a session's folder, in messages.
pub(super) const SESSION: &str = "a session folder";

const REUSE: &str = "; --reuse DIR takes over the points that both sweeps have";

/// Why a sweep could not go on.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum SweepError {
    /// The folder, or a file in it, cannot be used.
    #[error("{}: cannot be used", path.display())]
    #[diagnostic(help(
        "check that the folder is readable and writable, and that the disk has space; then go on with --resume"
    ))]
    Io { path: PathBuf, source: std::io::Error },
    /// Another version of biflag computed a part of the folder.
    #[error("{}: another version of biflag computed it", path.display())]
    #[diagnostic(
        code(wrong_use),
        help("move this file away, or name another folder with --out, and compute its points again")
    )]
    Version { path: PathBuf },
    /// The folder has points already.
    #[error("{}: already has points of this sweep", folder.display())]
    #[diagnostic(code(wrong_use), help("go on with --resume, or name another folder with --out"))]
    Exists { folder: PathBuf },
    /// The folder has the sweep of another plan, or a session.
    #[error("{}: is {what}", folder.display())]
    #[diagnostic(
        code(wrong_use),
        help("name another folder with --out{}", if *what == SESSION { "" } else { REUSE })
    )]
    Other { folder: PathBuf, what: &'static str },
    /// The folder has no sweep.
    #[error("{}: is not the folder of a sweep", folder.display())]
    #[diagnostic(code(wrong_use), help("{}", did_you_mean(folder, "name a folder that `biflag sweep PLAN` has made")))]
    NotASweep { folder: PathBuf },
    /// Points have no result.
    #[error("{}: {missing} of {points} points are missing{}, no table is written", folder.display(), of_damaged(damaged))]
    #[diagnostic(help(
        "compute them with --resume; `biflag sweep status --shards N` shows whose they are, `biflag sweep merge --partial` \
         writes a table without them"
    ))]
    Missing { folder: PathBuf, missing: u64, points: u64, damaged: Vec<PathBuf> },
    /// The results to reuse have another version.
    #[error(
        "{}: has results of version {results} of the model, and this program computes version {RESULTS}", folder.display()
    )]
    #[diagnostic(code(wrong_use), help("leave --reuse out, or use the program of that time"))]
    Results { folder: PathBuf, results: u32 },
    /// The manifest cannot be read.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help("copy the file from another shard's folder, or begin again in another folder with --out"))]
    Manifest { path: PathBuf, reason: String },
    /// The table cannot be read.
    #[error("{}: the table cannot be read: {reason}", path.display())]
    #[diagnostic(code(wrong_use), help("name the table of a sweep: table.parquet or table.csv in its folder"))]
    Table { path: PathBuf, reason: String },
    /// The plan is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
    /// The threads could not be started.
    #[error("cannot start the threads: {0}")]
    #[diagnostic(help("use fewer threads with --jobs"))]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

fn of_damaged(parts: &[PathBuf]) -> String {
    let names: Vec<_> = parts.iter().filter_map(|part| part.file_name()).map(|name| name.to_string_lossy()).collect();
    if names.is_empty() { String::new() } else { format!(" (cut off or damaged: {})", names.join(", ")) }
}

impl SweepError {
    /// Returns a function from an error of the system to the error of a path.
    pub fn at(path: &Path) -> impl FnOnce(std::io::Error) -> Self + use<> {
        let path = path.to_owned();
        |source| Self::Io { path, source }
    }

    /// Like [`Self::at`], for a part, which another version may have written.
    pub fn of_part(path: &Path) -> impl FnOnce(std::io::Error) -> Self + use<> {
        let path = path.to_owned();
        |source| match source.kind() {
            ErrorKind::InvalidData => Self::Version { path },
            _ => Self::Io { path, source },
        }
    }
}
