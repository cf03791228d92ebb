//! `biflag doctor SESSION`: checks that every trial of a session has a whole log.

use super::{Check, Finding, check};
use crate::session::{Session, TrialState};
use crate::trial::{Want, Zeroed, findings};
use biflag_log::End;
use std::path::Path;

/// Checks each trial.
pub(super) fn checks(folder: &Path) -> miette::Result<Vec<Check>> {
    let states = Session::open(folder)?.checked_states()?;
    states.iter().map(|state| Ok(check(format!("trial {}", state.trial.name), checked(state)?))).collect()
}

/// Checks the log of a trial, and what it says against its own trial.
fn checked(state: &TrialState) -> miette::Result<Finding> {
    let log = match trial(state) {
        Ok(log) => log,
        broken => return Ok(broken),
    };
    let Some(attempt) = state.complete() else { return Ok(Ok(log)) };
    let data = attempt.read(Want::default())?;
    let found = findings(&data, &Zeroed::new(&data));
    let left_out = state.left_out.iter().map(|of_log| &of_log.finding);
    let grave: Vec<_> = found.iter().chain(left_out).filter(|finding| finding.grave).collect();
    if grave.is_empty() {
        return Ok(Ok(log));
    }
    let join = |parts: Vec<&str>| parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ");
    let texts = join(grave.iter().map(|finding| finding.text.as_str()).collect());
    let mut cures: Vec<&str> = grave.iter().map(|finding| finding.cure.as_str()).collect();
    cures.dedup();
    Ok(Err((format!("{log}; {texts}"), join(cures))))
}

fn trial(state: &TrialState) -> Finding {
    let repeat = "`biflag record PLAN --resume` repeats the trial".to_owned();
    if let Some(attempt) = state.complete() {
        let samples = attempt.summary.as_ref().map_or(0, |summary| summary.link.samples);
        return Ok(format!("{} is whole, {samples} samples", attempt.path.display()));
    }
    let Some(last) = state.attempts.last() else {
        let left_out: Vec<_> = state.left_out.iter().map(|of_log| format!("; {}", of_log.finding.text)).collect();
        return Err((format!("not recorded yet{}", left_out.concat()), repeat));
    };
    let path = last.path.display();
    let recover = format!("`biflag recover {path}` keeps what can be read; {repeat}");
    match &last.summary {
        _ if !last.losses.is_empty() => Err((format!("{path}: {}", last.losses.join("; ")), recover)),
        None => Err((format!("{path} is cut off"), recover)),
        Some(summary) if summary.end == End::Complete => Err((format!("{path} is damaged"), recover)),
        Some(summary) => Err((format!("{path} is not complete: {}", summary.reason), repeat)),
    }
}
