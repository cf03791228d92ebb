//! A session: a folder with the plan and a log for each attempt at each of its trials.
//!
//! ```text
//! glycerin/
//!   session.toml                         the plan, and the program that started the session
//!   001_w1+50_w2+10.mcap                 the first attempt at the first trial
//!   001_w1+50_w2+10.attempt2.mcap        the second
//!   001_w1+50_w2+10.recovered.mcap       the first attempt, recovered by `biflag recover`
//! ```
//!
//! The state of a trial follows from its logs alone, and the trial of a log from the log's content. File names are made
//! from the plan's numbers, so no text in a plan can lead to a path outside the folder.
//!
//! One program at a time writes into a session ([`Session::lock`]), and all of its trials run on the same rig with the
//! same settings ([`Session::expect_same_rig`]).

mod error;
mod identity;
mod lock;
mod manifest;
mod rebuild;
mod rig;

pub use error::SessionError;
pub use lock::{Lock, Sharing, UNFINISHED, is_being_recorded, is_in_use, recorded};
pub use manifest::MANIFEST;
pub use rebuild::{Rebuilt, rebuild};

use crate::plan::error::is_sweep;
use crate::plan::{Plan, Trial};
use crate::text::count;
use crate::trial::{Data, Finding, FindingKind, Judged, LogFinding, Want};
use biflag_log::{End, LogError, RecoveryMeta, Summary};
use manifest::Manifest;
use rayon::prelude::*;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Largest number of trials without a log that are named.
const NAMED: usize = 3;

/// A session folder.
#[derive(Clone, PartialEq, Debug)]
pub struct Session {
    folder: PathBuf,
    plan: Plan,
    /// Start time of the session; empty if the manifest does not state it.
    pub created: String,
}

/// The state of a trial.
#[derive(Clone, PartialEq, Debug)]
pub struct TrialState {
    /// The trial.
    pub trial: Trial,
    /// Its logs, in the order of the attempts.
    pub attempts: Vec<Attempt>,
    /// Findings about logs that have its name but are not attempts at it.
    pub left_out: Vec<LogFinding>,
}

/// A log of a trial.
#[derive(Clone, PartialEq, Debug)]
pub struct Attempt {
    /// Number of the attempt, from 1. A recovered log has the number of its original.
    pub number: u32,
    /// The log.
    pub path: PathBuf,
    /// Its summary; `None` if the log is incomplete.
    pub summary: Option<Summary>,
    /// Descriptions of lost parts: lost before the log was recovered, or found by checking the log.
    pub losses: Vec<String>,
    /// Findings about the log's identity within its session.
    pub identity: Vec<Finding>,
}

impl Attempt {
    /// Returns the log at a path, with the findings that follow from the session in its folder.
    pub fn of_log(path: &Path) -> Self {
        Self { number: 1, path: path.to_owned(), summary: None, losses: Vec::new(), identity: identity::of_log(path) }
    }

    /// Reads the trial, with the findings about the log's identity.
    ///
    /// # Errors
    /// [`LogError`] if the file is not a biflag log or cannot be read.
    pub fn read(&self, want: Want) -> Result<Judged, LogError> {
        Ok(Judged::of(self.data(want)?))
    }

    /// Reads the log, like [`Self::read`].
    pub(crate) fn data(&self, want: Want) -> Result<Data, LogError> {
        Ok(Data { identity: self.identity.clone(), ..Data::read(&self.path, want)? })
    }

    /// Returns whether the log's own summary says that all phases were completed, and it has no known losses.
    fn is_complete(&self) -> bool {
        self.losses.is_empty() && self.summary.as_ref().is_some_and(|summary| summary.end == End::Complete)
    }
}

impl TrialState {
    /// Returns the last complete attempt. An attempt with losses is not complete, even if its log has a summary.
    pub fn complete(&self) -> Option<&Attempt> {
        self.attempts.iter().rev().find(|attempt| attempt.is_complete())
    }

    /// Returns the attempt that represents the trial: the last complete one, or else the last one.
    pub fn best(&self) -> Option<&Attempt> {
        self.complete().or(self.attempts.last())
    }

    /// Checks the log of the last complete attempt, then of earlier ones until one is intact.
    fn check(&mut self) -> Result<(), LogError> {
        while let Some(path) = self.complete().map(|attempt| attempt.path.clone()) {
            let losses = losses(&path)?;
            if losses.is_empty() {
                break;
            }
            self.damaged(&path, &losses);
        }
        Ok(())
    }

    /// Checks every log that looks complete from its end but has a recovered copy with losses. The log may be damaged
    /// in the middle, which its end does not show. Or the copy was made while the log was still being written, and its
    /// losses mean nothing.
    fn check_recovered(&mut self) -> Result<(), LogError> {
        let has_losses: Vec<u32> =
            (self.attempts.iter().filter(|attempt| !attempt.losses.is_empty())).map(|attempt| attempt.number).collect();
        for attempt in &mut self.attempts {
            if attempt.is_complete() && has_losses.contains(&attempt.number) {
                attempt.losses = losses(&attempt.path)?;
            }
        }
        Ok(())
    }

    /// Records the losses of a log.
    pub fn damaged(&mut self, path: &Path, losses: &[String]) {
        for attempt in self.attempts.iter_mut().filter(|attempt| attempt.path == path) {
            attempt.losses = losses.to_vec();
        }
    }

    /// Returns the number of the next attempt.
    pub fn next_number(&self) -> u32 {
        self.attempts.iter().map(|attempt| attempt.number).max().unwrap_or(0).saturating_add(1)
    }
}

impl Session {
    /// Starts a session of `plan` in `folder`, which must not contain one. The folder is created if it does not exist.
    ///
    /// # Errors
    /// [`SessionError::Exists`], [`SessionError::Io`].
    pub fn create(folder: &Path, plan: &Plan) -> Result<Self, SessionError> {
        if is_sweep(folder) {
            return Err(SessionError::Exists { folder: folder.to_owned(), what: "a sweep" });
        }
        std::fs::create_dir_all(folder).map_err(|source| SessionError::creating(folder, source))?;
        // A log without its trial's record is assigned by its name, so a log of another session could be mistaken for
        // one of this.
        if !folder.join(MANIFEST).exists()
            && let Some(log) = log_names(folder)?.into_iter().next()
        {
            return Err(SessionError::StrayLog { folder: folder.to_owned(), log });
        }
        let manifest = Manifest::new(plan);
        manifest.write(folder)?;
        Ok(Self { folder: folder.to_owned(), plan: plan.clone(), created: manifest.created })
    }

    /// Continues the session of `plan` in `folder`, or starts it if there is none.
    ///
    /// # Errors
    /// [`SessionError::OtherPlan`] if the folder contains the session of another plan.
    pub fn resume(folder: &Path, plan: &Plan) -> Result<Self, SessionError> {
        if !folder.join(MANIFEST).exists() {
            return Self::create(folder, plan);
        }
        let session = Self::open(folder)?;
        let Some(difference) = difference(&session.plan, plan) else { return Ok(session) };
        Err(SessionError::OtherPlan { folder: folder.to_owned(), difference })
    }

    /// Reads the session in `folder`.
    ///
    /// # Errors
    /// [`SessionError::NotASession`], [`SessionError::Manifest`], [`SessionError::Plan`].
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        let manifest = Manifest::read(folder)?;
        let created = manifest.created.clone();
        Ok(Self { folder: folder.to_owned(), plan: manifest.plan(folder)?, created })
    }

    /// Returns the folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the state of each trial, in the plan's order.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn states(&self) -> Result<Vec<TrialState>, SessionError> {
        self.states_among(self.plan.trials.iter(), &log_names(&self.folder)?)
    }

    /// Returns the state of each trial. If a trial has several logs, they are checked in full, so an intact log is
    /// preferred to a later damaged one.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn intact_states(&self) -> Result<Vec<TrialState>, SessionError> {
        let mut states = self.states()?;
        states.par_iter_mut().filter(|state| state.attempts.len() > 1).try_for_each(TrialState::check)?;
        Ok(states)
    }

    /// Returns the state of each trial after a full check of the logs of complete trials, because the end of a log does
    /// not show damage in its middle. This takes about 0.1 s per log.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn checked_states(&self) -> Result<Vec<TrialState>, SessionError> {
        let mut states = self.states()?;
        states.par_iter_mut().try_for_each(TrialState::check)?;
        Ok(states)
    }

    /// Returns a finding about the trials without any log, from the states of all; `None` if there are none.
    pub fn missing(&self, states: &[TrialState]) -> Option<LogFinding> {
        let names: Vec<&str> =
            (states.iter().filter(|state| state.attempts.is_empty())).map(|state| state.trial.name.as_str()).collect();
        let (first, more) = names.split_at(names.len().min(NAMED));
        let first = first.join(", ");
        let named = if more.is_empty() { first } else { format!("{first} and {} more", more.len()) };
        let verb = if names.len() == 1 { "has" } else { "have" };
        let text = format!("{} of {} {verb} no log: {named}", names.len(), count(states.len(), "trial"));
        let finding = Finding::grave(FindingKind::Conduct, text, "continue the session with --resume");
        (!names.is_empty()).then(|| LogFinding { log: self.folder.display().to_string(), finding })
    }

    /// Returns the state of one trial, from the logs with its name.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn state(&self, trial: &Trial) -> Result<TrialState, SessionError> {
        let prefix = format!("{}.", trial.name);
        let mut names = log_names(&self.folder)?;
        names.retain(|name| name.starts_with(&prefix));
        let none = || TrialState { trial: trial.clone(), attempts: Vec::new(), left_out: Vec::new() };
        Ok(self.states_among(std::iter::once(trial), &names)?.pop().unwrap_or_else(none))
    }

    /// Returns the number and the path of the next attempt at a trial. The path is free, even if files other than logs
    /// have such names.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn next_attempt(&self, trial: &Trial) -> Result<(u32, PathBuf), SessionError> {
        let first = self.state(trial)?.next_number();
        let free = (first..=first + MAX_ATTEMPTS).find_map(|number| {
            let suffix = if number == 1 { String::new() } else { format!(".attempt{number}") };
            let path = self.folder.join(format!("{}{suffix}.mcap", trial.name));
            path.symlink_metadata().is_err().then_some((number, path))
        });
        let too_many = || std::io::Error::other(format!("too many attempts at {}", trial.name));
        free.ok_or_else(|| SessionError::Io { path: self.folder.clone(), source: too_many() })
    }

    /// Returns the states of trials of the plan, from these logs.
    fn states_among<'a>(
        &self,
        trials: impl Iterator<Item = &'a Trial>,
        names: &[String],
    ) -> Result<Vec<TrialState>, SessionError> {
        let mut sorted = identity::sort(self, names)?;
        let mut states = Vec::new();
        for trial in trials {
            let mut attempts = Vec::new();
            for (number, name) in std::mem::take(&mut sorted.attempts[trial.index]) {
                attempts.push(self.attempt(number, &name, sorted.findings.remove(&name))?);
            }
            let left_out =
                |name: &String| LogFinding::all_of(&self.folder.join(name), sorted.findings.get(name).cloned());
            let left_out = sorted.left_out[trial.index].iter().flat_map(left_out).collect();
            let mut state = TrialState { trial: trial.clone(), attempts, left_out };
            state.check_recovered()?;
            states.push(state);
        }
        Ok(states)
    }

    fn attempt(&self, number: u32, name: &str, identity: Option<Finding>) -> Result<Attempt, LogError> {
        let path = self.folder.join(name);
        let read = || Ok((biflag_log::last_meta::<RecoveryMeta>(&path)?, biflag_log::summary(&path)?));
        let (losses, summary) = match read() {
            Ok((recovery, summary)) => (recovery.into_iter().map(|recovery| recovery.lost).collect(), summary),
            // An unreadable file may be a complete log, so it is neither lost nor repeated.
            Err::<_, LogError>(error) if error.is_of_reading() => return Err(error),
            // A file that is not a log only costs this attempt.
            Err(error) => (vec![described(&error)], None),
        };
        Ok(Attempt { number, path, summary, losses, identity: identity.into_iter().collect() })
    }
}

/// Checks a log in full; returns descriptions of the lost parts.
fn losses(path: &Path) -> Result<Vec<String>, LogError> {
    match biflag_log::check(path) {
        Ok(losses) => Ok(losses.iter().map(ToString::to_string).collect()),
        Err(error) if error.is_of_reading() => Err(error),
        Err(error) => Ok(vec![described(&error)]),
    }
}

/// Returns the names of all logs in a folder, sorted. Links to logs are followed.
fn log_names(folder: &Path) -> Result<Vec<String>, SessionError> {
    let failed = |source| SessionError::Io { path: folder.to_owned(), source };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        // Logs of biflag have ASCII names.
        let Some(name) = entry.file_name().into_string().ok().filter(|name| name.ends_with(".mcap")) else { continue };
        match entry.path().metadata() {
            Ok(target) if target.is_file() => names.push(name),
            Ok(_) => {}
            // A dangling link is not a log.
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {}
            Err(source) => return Err(SessionError::Io { path: entry.path(), source }),
        }
    }
    names.sort_unstable();
    Ok(names)
}

/// Returns an error of a log with its cause.
fn described(error: &LogError) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), |cause| format!("{error}: {cause}"))
}

/// Largest number of attempts at a trial. A larger number in a file name was not written by biflag.
const MAX_ATTEMPTS: u32 = 1_000_000;

/// Returns the number of the attempt from the part of the file name after the trial's name and a dot.
fn attempt_number(suffix: &str) -> u32 {
    suffix
        .split('.')
        .next()
        .and_then(|part| part.strip_prefix("attempt"))
        .and_then(|number| number.parse().ok())
        .filter(|number| *number <= MAX_ATTEMPTS)
        .unwrap_or(1)
}

/// Returns the first difference between two plans that makes their trials differ. Names and notes may differ.
fn difference(old: &Plan, new: &Plan) -> Option<&'static str> {
    let phases = |plan: &Plan| plan.trials.first().map(|trial| trial.phases);
    if phases(old) != phases(new) {
        Some("the durations of [trial] differ")
    } else if old.trials != new.trials {
        Some("the speeds, starting phases, repeats or seed differ")
    } else if old.robot != new.robot {
        Some("the robot differs")
    } else if old.sensor.as_ref().map(|file| &file.text) != new.sensor.as_ref().map(|file| &file.text) {
        Some("the sensor's file differs")
    } else if old.board.of_the_data() != new.board.of_the_data() {
        Some("the settings of [board] differ")
    } else {
        None
    }
}

/// Returns the default folder of a plan with this name. The name may contain any text: characters that do not suit a
/// folder's name are replaced, and so are the names of Windows' devices, with any extension.
pub fn folder_named(name: &str) -> PathBuf {
    let fit = |c: char| if c.is_alphanumeric() || "-_+.".contains(c) { c } else { '-' };
    let name: String = name.chars().map(fit).take(60).collect();
    let name = name.trim_matches(['.', '-']);
    let kind = name.split('.').next().unwrap_or_default().trim_end_matches(char::is_numeric).to_ascii_lowercase();
    match kind.as_str() {
        "" if name.is_empty() => "session".into(),
        "con" | "prn" | "aux" | "nul" | "com" | "lpt" => format!("session-{name}").into(),
        _ => name.into(),
    }
}

#[cfg(test)]
mod tests;
