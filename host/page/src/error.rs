//! Why a page, a figure or a film was not written.

use biflag_log::LogError;
use miette::Diagnostic;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use study::output::OutputError;
use study::plan::PlanError;
use study::session::SessionError;
use study::twin::TwinError;
use system::shell::INSTALL;
use thiserror::Error;

/// Why a page, a figure or a film was not written.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum PageError {
    /// The request cannot be drawn, filmed or shown.
    #[error("{what}")]
    #[diagnostic(code(wrong_use), help("{help}"))]
    WrongUse { what: String, help: String },
    /// The trial has no data in the time range.
    #[error("{}: nothing to draw in this time", path.display())]
    #[diagnostic(code(wrong_use), help("name a time within the trial, counted from the start of its run"))]
    Nothing { path: PathBuf },
    /// A map needs points at different speeds.
    #[error("{}: no map: fewer than two speeds of a flagellum have steady angles{found}", path.display())]
    #[diagnostic(code(wrong_use), help("name a session whose trials differ in the speeds of both flagella"))]
    NoMap { path: PathBuf, found: String },
    /// A film of this kind needs FFmpeg.
    #[error("{}: the program {program} is not installed, which encodes WebM", path.display())]
    #[diagnostic(help("install it (`{INSTALL} ffmpeg`), or end the file's name with .gif"))]
    NoEncoder { path: PathBuf, program: &'static str },
    /// A robot file cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
    /// The figure could not be converted.
    #[error("the figure cannot be converted: {reason}")]
    #[diagnostic(help("write it as .svg, or narrower"))]
    Convert { reason: String },
    /// A file cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Output(#[from] OutputError),
    /// A log cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// A session cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
    /// The trials cannot be compared.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Twin(#[from] TwinError),
}

impl PageError {
    /// Returns the error of a file or folder that cannot be used, with the remedy.
    pub(crate) fn wrong_use(path: &Path, reason: impl Display, help: impl Into<String>) -> Self {
        Self::WrongUse { what: format!("{}: {reason}", path.display()), help: help.into() }
    }
}
