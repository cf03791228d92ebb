//! Errors of packing.

use crate::export::ExportError;
use crate::figure::FigureError;
use crate::plan::PlanError;
use crate::report::ReportError;
use crate::session::SessionError;
use miette::Diagnostic;
use std::io;
use std::path::{Path, PathBuf};
use study::output::OutputError;
use thiserror::Error;

/// Why a session was not packed.
#[derive(Error, Diagnostic, Debug)]
pub enum PackError {
    /// A file of the session cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file of the session has changed meanwhile.
    #[error("{}: has changed while it was packed", path.display())]
    #[diagnostic(help("pack the session again once no program writes into it"))]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// The archive cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Output(#[from] OutputError),
    /// The session cannot be read, or is being recorded.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Session(#[from] SessionError),
    /// Its robot is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plan(#[from] PlanError),
    /// The page cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Report(#[from] ReportError),
    /// A table cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Export(#[from] ExportError),
    /// A figure cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Figure(#[from] FigureError),
}

impl PackError {
    pub(super) fn reading(path: &Path) -> impl Fn(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Read { path: path.clone(), source }
    }
}
