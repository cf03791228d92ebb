//! The input of a command: the logs of a session, or a single log.

use super::{Skipped, TwinError};
use crate::plan::{Plan, RobotFile, Trial};
use crate::session::{Attempt, MANIFEST, Session};
use crate::trial::LogFinding;
use biflag_log::{PlanMeta, Reader, TrialMeta};
use std::path::{Path, PathBuf};

/// Returns the logs of a session folder, or the log itself, and findings about logs that are left out or missing.
///
/// # Errors
/// [`TwinError::Session`].
pub fn logs(path: &Path) -> Result<(Vec<Attempt>, Vec<LogFinding>), TwinError> {
    if path.is_dir() {
        let session = Session::open(path)?;
        let states = session.intact_states()?;
        let left_out = states.iter().flat_map(|state| state.left_out.clone()).chain(session.missing(&states)).collect();
        Ok((states.iter().filter_map(|state| state.best().cloned()).collect(), left_out))
    } else {
        Ok((vec![Attempt::of_log(path)], Vec::new()))
    }
}

/// The logs of a session, or one log.
#[derive(Clone, Debug)]
pub struct Source {
    /// The session folder, or the log.
    pub path: PathBuf,
    /// The plan of the logs.
    pub plan: Plan,
    /// Trials and their logs: the complete attempt, or else the last one.
    pub logs: Vec<(Trial, Attempt)>,
    /// Findings about logs that belong to no trial.
    pub left_out: Vec<LogFinding>,
    /// Trials without a log.
    pub skipped: Vec<Skipped>,
}

impl Source {
    /// Finds the logs of a session, or creates a source from one log.
    ///
    /// # Errors
    /// [`TwinError::Session`], [`TwinError::Log`], [`TwinError::Plan`], [`TwinError::Unusable`].
    pub fn open(path: &Path) -> Result<Self, TwinError> {
        if path.is_dir() { Self::session(path) } else { Self::log(path) }
    }

    fn session(folder: &Path) -> Result<Self, TwinError> {
        let session = Session::open(folder)?;
        let (mut logs, mut left_out, mut skipped) = (Vec::new(), Vec::new(), Vec::new());
        for state in session.intact_states()? {
            left_out.extend(state.left_out.iter().cloned());
            match state.best() {
                Some(attempt) => logs.push((state.trial.clone(), attempt.clone())),
                None => skipped.push(Skipped { name: state.trial.name.clone(), reason: "it has no log".to_owned() }),
            }
        }
        Ok(Self { path: folder.to_owned(), plan: session.plan().clone(), logs, left_out, skipped })
    }

    fn log(path: &Path) -> Result<Self, TwinError> {
        let mut reader = Reader::open(path)?;
        let unusable = |reason: &str| TwinError::Unusable {
            path: path.to_owned(),
            reason: reason.to_owned(),
            help: "name the session folder instead of the log",
        };
        // These records are at the beginning of a log, in this order.
        let meta: Option<PlanMeta> = reader.read_until()?;
        let name = reader.read_until::<TrialMeta>()?.map(|trial| trial.name);
        let robot = reader.read_until()?;
        let meta = meta.ok_or_else(|| unusable("the record of its plan cannot be read"))?;
        let mut plan = Plan::parse(&meta.text, &format!("plan in {}", path.display()))?;
        plan.robot = RobotFile::of_log(robot);
        let trial = plan.trials.iter().find(|trial| Some(&trial.name) == name.as_ref()).cloned();
        let trial = trial.ok_or_else(|| unusable("its trial is not in its plan"))?;
        let logs = vec![(trial, Attempt::of_log(path))];
        Ok(Self { path: path.to_owned(), plan, logs, left_out: Vec::new(), skipped: Vec::new() })
    }

    /// Returns the default folder for its replays: beside the session, or beside a log that is not in a session.
    pub fn replay_folder(&self) -> PathBuf {
        let folder = match self.path.parent() {
            _ if self.path.is_dir() => self.path.clone(),
            Some(folder) if folder.join(MANIFEST).exists() => folder.to_owned(),
            Some(folder) if folder.as_os_str().is_empty() && Path::new(MANIFEST).exists() => PathBuf::from("."),
            _ => self.path.with_extension(""),
        };
        let full =
            if folder.file_name().is_some() { folder } else { system::file::full_path(&folder).unwrap_or(folder) };
        let mut name = full.file_name().unwrap_or("trial".as_ref()).to_owned();
        name.push("-replay");
        full.with_file_name(name)
    }
}
