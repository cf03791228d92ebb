//! Why a measurement of a sensor failed.

use miette::Diagnostic;
use thiserror::Error;

/// Why a measurement failed, and what the operator does next.
#[derive(Error, Diagnostic, Clone, PartialEq, Debug)]
#[error("{what}")]
#[diagnostic(help("{cure}"))]
pub struct NotMeasured {
    what: String,
    cure: String,
}

impl NotMeasured {
    pub(super) fn new(what: impl Into<String>, cure: impl Into<String>) -> Self {
        Self { what: what.into(), cure: cure.into() }
    }
}
