//! `biflag doctor SESSION`: checks that every trial of a session has a whole log, and prints its findings.

use super::super::answer::finding_line;
use super::check::{Check, Finding, check};
use crate::session::{Session, TrialState, recorded};
use crate::trial::{LogFinding, Want};
use biflag_log::End;
use rayon::prelude::*;
use std::path::Path;

/// Checks each trial; returns also the findings about all logs.
pub(super) fn checks(folder: &Path) -> miette::Result<(Vec<Check>, Vec<LogFinding>)> {
    let states = Session::open(folder)?.checked_states()?;
    let recorded = recorded(folder, states.iter());
    let one = |state: &TrialState| {
        let is_open = recorded.is_some() && state.best().map(|attempt| &attempt.path) == recorded.as_ref();
        // A log that is being recorded has no end yet.
        let found = if is_open { state.left_out.clone() } else { found(state) };
        (check(format!("trial {}", state.trial.name), judged(trial(state, is_open), &found)), found)
    };
    let (checks, found): (Vec<_>, Vec<_>) = states.par_iter().map(one).collect();
    Ok((checks, found.concat()))
}

/// Returns the findings about the logs of a trial. [`trial`] reports logs that cannot be read at all.
fn found(state: &TrialState) -> Vec<LogFinding> {
    let trial = state.best().and_then(|attempt| attempt.read(Want::default()).ok());
    let of_log = trial.map(|trial| trial.log_findings());
    of_log.into_iter().flatten().chain(state.left_out.iter().cloned()).collect()
}

/// Adds the findings to the result of a check: a trial with a grave one is not sound.
fn judged(result: Finding, found: &[LogFinding]) -> Finding {
    let lines = |detail: String| found.iter().fold(detail, |text, one| text + "\n" + &finding_line(None, &one.finding));
    match result {
        Ok(detail) => match found.iter().find(|one| one.finding.grave) {
            Some(LogFinding { finding, .. }) => Err((lines(detail), finding.cure.clone())),
            None => Ok(lines(detail)),
        },
        Err((detail, cure)) => Err((lines(detail), cure)),
    }
}

/// Returns the condition of a trial's log. `is_open`: whether it is being recorded.
fn trial(state: &TrialState, is_open: bool) -> Finding {
    let repeat = "`biflag record PLAN --resume` repeats the trial".to_owned();
    if let Some(attempt) = state.complete() {
        let samples = attempt.summary.as_ref().map_or(0, |summary| summary.link.samples);
        return Ok(format!("{} is whole, {samples} samples", attempt.path.display()));
    }
    let Some(last) = state.attempts.last() else { return Err(("not recorded yet".to_owned(), repeat)) };
    let path = last.path.display();
    let recover = format!("`biflag recover {path}` keeps what can be read; {repeat}");
    match &last.summary {
        _ if is_open => {
            Err((format!("{path} is being recorded"), "ask again when `biflag record` has ended".to_owned()))
        }
        _ if !last.losses.is_empty() => Err((format!("{path}: {}", last.losses.join("; ")), recover)),
        None => Err((format!("{path} is cut off"), recover)),
        Some(summary) if summary.end == End::Complete => Err((format!("{path} is damaged"), recover)),
        Some(summary) => Err((format!("{path} is not complete: {}", summary.reason), repeat)),
    }
}
