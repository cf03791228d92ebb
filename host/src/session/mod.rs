//! A session: a folder with the plan and a log for each attempt at each of its trials.
//!
//! ```text
//! glycerin/
//!   session.toml                         the plan, and what began the session
//!   001_w1+50_w2+10.mcap                 the first attempt at the first trial
//!   001_w1+50_w2+10.attempt2.mcap        the second
//!   001_w1+50_w2+10.recovered.mcap       what `biflag recover` made of the first
//! ```
//!
//! How far a trial is stands in its logs; the folder keeps no second account of it. Names come from the plan's numbers
//! alone, so no text of a plan can lead out of the folder.
//!
//! One program at a time writes into a session ([`Session::lock`]), and all of its trials run on the same thing
//! ([`Session::expect_same_rig`]).

mod error;
mod lock;
mod manifest;
mod rig;

pub use error::SessionError;
pub use lock::{Lock, Sharing};
pub use manifest::MANIFEST;

use crate::log::{self, End, RecoveryMeta, Summary};
use crate::plan::{Plan, Trial};
use manifest::Manifest;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// A session's folder.
#[derive(Clone, PartialEq, Debug)]
pub struct Session {
    folder: PathBuf,
    plan: Plan,
}

/// How far a trial is.
#[derive(Clone, PartialEq, Debug)]
pub struct TrialState {
    /// The trial.
    pub trial: Trial,
    /// Its logs, in the order of the attempts.
    pub attempts: Vec<Attempt>,
}

/// A log of a trial.
#[derive(Clone, PartialEq, Debug)]
pub struct Attempt {
    /// Which attempt it is, from 1. A recovered log bears the number of the one that it was recovered from.
    pub number: u32,
    /// The log.
    pub path: PathBuf,
    /// What it came to; `None`: the log does not end as it should.
    pub summary: Option<Summary>,
    /// What is lost of it, in words: of the log that it was recovered from, or where it does not read itself, as far as
    /// that was looked for.
    pub losses: Vec<String>,
}

impl TrialState {
    /// The last attempt that holds the whole trial. One that something was lost of does not, though its log may end as
    /// it should: what was recovered of it says so.
    pub fn complete(&self) -> Option<&Attempt> {
        let lost = |number| self.attempts.iter().any(|attempt| attempt.number == number && !attempt.losses.is_empty());
        let ended = |attempt: &&Attempt| attempt.summary.as_ref().is_some_and(|summary| summary.end == End::Complete);
        self.attempts.iter().rev().filter(ended).find(|attempt| !lost(attempt.number))
    }

    /// Reads the log of a complete trial through, and so on until one is whole or none is left.
    fn check(&mut self) {
        while let Some(path) = self.complete().map(|attempt| attempt.path.clone()) {
            let losses = match log::check(&path) {
                Ok(losses) if losses.is_empty() => return,
                Ok(losses) => losses.iter().map(ToString::to_string).collect(),
                Err(error) => vec![error.to_string()],
            };
            for attempt in self.attempts.iter_mut().filter(|attempt| attempt.path == path) {
                attempt.losses.clone_from(&losses);
            }
        }
    }

    /// The number of the attempt that comes next.
    pub fn next_number(&self) -> u32 {
        self.attempts.iter().map(|attempt| attempt.number).max().unwrap_or(0).saturating_add(1)
    }
}

impl Session {
    /// Starts a session of `plan` in `folder`, which must not hold one; the folder is made if need be.
    ///
    /// # Errors
    /// [`SessionError::Exists`], [`SessionError::Io`].
    pub fn create(folder: &Path, plan: &Plan) -> Result<Self, SessionError> {
        std::fs::create_dir_all(folder).map_err(|source| SessionError::Io { path: folder.to_owned(), source })?;
        let session = Self { folder: folder.to_owned(), plan: plan.clone() };
        // The name of a log says which trial it is of, so a log of another session would pass for one of this.
        if !folder.join(MANIFEST).exists()
            && let Some(log) = session.log_names()?.into_iter().next()
        {
            return Err(SessionError::StrayLog { folder: folder.to_owned(), log });
        }
        Manifest::new(plan).write(folder)?;
        Ok(session)
    }

    /// Goes on with the session of `plan` in `folder`, or starts it where there is none.
    ///
    /// # Errors
    /// [`SessionError::OtherPlan`] where the folder holds another plan's session.
    pub fn resume(folder: &Path, plan: &Plan) -> Result<Self, SessionError> {
        if !folder.join(MANIFEST).exists() {
            return Self::create(folder, plan);
        }
        let session = Self::open(folder)?;
        match difference(&session.plan, plan) {
            Some(difference) => Err(SessionError::OtherPlan { folder: folder.to_owned(), difference }),
            None => Ok(session),
        }
    }

    /// Reads the session in `folder`.
    ///
    /// # Errors
    /// [`SessionError::NotASession`], [`SessionError::Manifest`], [`SessionError::Plan`].
    pub fn open(folder: &Path) -> Result<Self, SessionError> {
        let plan = Manifest::read(folder)?.plan(folder)?;
        Ok(Self { folder: folder.to_owned(), plan })
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// How far each trial is, in their order.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn states(&self) -> Result<Vec<TrialState>, SessionError> {
        let names = self.log_names()?;
        self.plan.trials.iter().map(|trial| self.state_among(trial, &names)).collect()
    }

    /// How far each trial is, with every log that counts read through: damage in the middle does not show at its end.
    /// Takes some 0.1 s a log.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn checked_states(&self) -> Result<Vec<TrialState>, SessionError> {
        let mut states = self.states()?;
        states.par_iter_mut().for_each(TrialState::check);
        Ok(states)
    }

    /// How far one trial is.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn state(&self, trial: &Trial) -> Result<TrialState, SessionError> {
        self.state_among(trial, &self.log_names()?)
    }

    /// Number and log of the next attempt at a trial. The log does not exist yet.
    ///
    /// # Errors
    /// [`SessionError::Io`], [`SessionError::Log`].
    pub fn next_attempt(&self, trial: &Trial) -> Result<(u32, PathBuf), SessionError> {
        let number = self.state(trial)?.next_number();
        let suffix = if number == 1 { String::new() } else { format!(".attempt{number}") };
        Ok((number, self.folder.join(format!("{}{suffix}.mcap", trial.name))))
    }

    /// The names of all logs, sorted.
    fn log_names(&self) -> Result<Vec<String>, SessionError> {
        let failed = |source| SessionError::Io { path: self.folder.clone(), source };
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&self.folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            // A name that is no Unicode is none of ours.
            if let Ok(name) = entry.file_name().into_string()
                && name.ends_with(".mcap")
                && entry.file_type().is_ok_and(|kind| kind.is_file())
            {
                names.push(name);
            }
        }
        names.sort_unstable();
        Ok(names)
    }

    fn state_among(&self, trial: &Trial, names: &[String]) -> Result<TrialState, SessionError> {
        let prefix = format!("{}.", trial.name);
        let first = names.partition_point(|name| *name < prefix);
        let mut attempts = Vec::new();
        for name in names[first..].iter().take_while(|name| name.starts_with(&prefix)) {
            let path = self.folder.join(name);
            let number = attempt_number(&name[prefix.len()..]);
            let losses = log::last_meta::<RecoveryMeta>(&path)?.into_iter().map(|recovery| recovery.lost).collect();
            attempts.push(Attempt { number, summary: log::summary(&path)?, losses, path });
        }
        attempts.sort_by_key(|attempt| attempt.number);
        Ok(TrialState { trial: trial.clone(), attempts })
    }
}

/// The attempt that a log is of, from what follows the trial's name and a dot.
fn attempt_number(suffix: &str) -> u32 {
    suffix
        .split('.')
        .next()
        .and_then(|part| part.strip_prefix("attempt"))
        .and_then(|number| number.parse().ok())
        .unwrap_or(1)
}

/// What two plans differ in, as far as it makes other trials of them. Names and notes may differ.
fn difference(old: &Plan, new: &Plan) -> Option<&'static str> {
    let phases = |plan: &Plan| plan.trials.first().map(|trial| trial.phases);
    if phases(old) != phases(new) {
        Some("the durations of [trial]")
    } else if old.trials != new.trials {
        Some("the speeds, repeats or seed")
    } else if old.robot != new.robot {
        Some("the robot")
    } else if old.board.of_the_data() != new.board.of_the_data() {
        Some("the settings of [board]")
    } else {
        None
    }
}

/// The folder that a plan's session takes when the user names none: the plan's name, made fit for a folder's name.
pub fn default_folder(plan: &Plan) -> PathBuf {
    let fit = |c: char| if c.is_alphanumeric() || "-_+.".contains(c) { c } else { '-' };
    let name: String = plan.name.chars().map(fit).take(60).collect();
    let name = name.trim_matches(['.', '-']);
    PathBuf::from(if name.is_empty() { "session" } else { name })
}

#[cfg(test)]
mod tests;
