//! `biflag doctor SESSION`: checks that every trial of a session has a whole log.

use super::{Check, Finding, check};
use crate::session::{Session, TrialState};
use biflag_log::End;
use std::path::Path;

/// Checks each trial.
pub(super) fn checks(folder: &Path) -> miette::Result<Vec<Check>> {
    let states = Session::open(folder)?.checked_states()?;
    Ok(states.iter().map(|state| check(format!("trial {}", state.trial.name), trial(state))).collect())
}

fn trial(state: &TrialState) -> Finding {
    let repeat = "`biflag record PLAN --resume` repeats the trial".to_owned();
    if let Some(attempt) = state.complete() {
        let samples = attempt.summary.as_ref().map_or(0, |summary| summary.link.samples);
        return Ok(format!("{} is whole, {samples} samples", attempt.path.display()));
    }
    let Some(last) = state.attempts.last() else { return Err(("not recorded yet".to_owned(), repeat)) };
    let path = last.path.display();
    let recover = format!("`biflag recover {path}` keeps what can be read; {repeat}");
    match &last.summary {
        _ if !last.losses.is_empty() => Err((format!("{path}: {}", last.losses.join("; ")), recover)),
        None => Err((format!("{path} is cut off"), recover)),
        Some(summary) if summary.end == End::Complete => Err((format!("{path} is damaged"), recover)),
        Some(summary) => Err((format!("{path} is not complete: {}", summary.reason), repeat)),
    }
}
