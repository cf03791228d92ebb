//! Errors of packing.

use crate::export::ExportError;
use crate::plan::PlanError;
use crate::session::SessionError;
use miette::Diagnostic;
use page::PageError;
use std::io;
use std::path::{Path, PathBuf};
use study::output::OutputError;
use thiserror::Error;

/// Why a session was not packed.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum PackError {
    /// A file of the session cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read { path: PathBuf, source: io::Error },
    /// A file of the session has changed meanwhile.
    #[error("{}: has changed while it was packed", path.display())]
    #[diagnostic(help("pack the session again once no program writes into it"))]
    Changed { path: PathBuf },
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
    /// A page or a figure cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Page(#[from] PageError),
    /// A table cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Export(#[from] ExportError),
}

impl PackError {
    pub(super) fn reading(path: &Path) -> impl Fn(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Read { path: path.clone(), source }
    }
}
