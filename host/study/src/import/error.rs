//! Why a table cannot be imported.

use crate::output::OutputError;
use crate::plan::PlanError;
use biflag_log::LogError;
use biflag_log::similar::did_you_mean;
use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why a table cannot be imported.
#[derive(Error, Diagnostic, Debug)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum ImportError {
    /// The list of columns is wrong.
    #[error("--columns: {reason}")]
    #[diagnostic(code(wrong_use))]
    Columns {
        reason: String,
        #[help]
        help: String,
    },
    /// The file cannot be read.
    #[error("{}: cannot be read", path.display())]
    #[diagnostic(code(wrong_use), help("{}", did_you_mean(path, "name a table in the format CSV")))]
    Read { path: PathBuf, source: std::io::Error },
    /// The content of the table is wrong.
    #[error("{table}: {reason}")]
    #[diagnostic(code(wrong_use))]
    Table {
        table: String,
        reason: String,
        #[help]
        help: &'static str,
    },
    /// No trial can have these conditions.
    #[error("the table is of no trial")]
    #[diagnostic(code(wrong_use))]
    Conditions(#[from] PlanError),
    /// The log cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Output(#[from] OutputError),
    /// The log cannot be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
}

impl ImportError {
    pub(super) fn columns(reason: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Columns { reason: reason.into(), help: help.into() }
    }

    pub(super) fn table(table: &str, reason: impl Into<String>, help: &'static str) -> Self {
        Self::Table { table: table.to_owned(), reason: reason.into(), help }
    }

    /// Returns whether the error is wrong use, as are all except errors of the disk.
    #[cfg(test)]
    pub(super) fn is_wrong_use(&self) -> bool {
        self.code().is_some_and(|code| code.to_string() == crate::WRONG_USE)
    }
}
