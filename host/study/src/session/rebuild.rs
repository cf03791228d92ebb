//! Rebuilds a lost or damaged manifest from the session's logs: each log contains the plan and the robot.

use super::manifest::Manifest;
use super::{MANIFEST, Session, SessionError, described, difference, is_in_use, log_names};
use crate::plan::{Plan, RobotFile};
use biflag_log::atomic_file::sweep;
use biflag_log::{Identity, LogError, PlanMeta, Reader, RobotMeta};
use std::path::{Path, PathBuf};

/// Result of rebuilding a session.
#[derive(Clone, PartialEq, Debug)]
pub struct Rebuilt {
    /// The session.
    pub session: Session,
    /// Whether the manifest was written; an intact one is kept.
    pub written: bool,
    /// The damaged manifest, under its new name.
    pub kept: Option<PathBuf>,
    /// Number of logs that have the session's plan.
    pub logs: usize,
    /// Logs without a readable plan, with the reasons.
    pub unreadable: Vec<String>,
}

/// Rebuilds the manifest of the session in `folder` from the logs, unless it is intact. Removes drafts of killed
/// programs.
///
/// # Errors
/// [`SessionError::NothingToRebuild`], [`SessionError::DifferentPlans`], [`SessionError::Newer`],
/// [`SessionError::BeingRecorded`], [`SessionError::Io`].
pub fn rebuild(folder: &Path) -> Result<Rebuilt, SessionError> {
    let damaged = match Session::open(folder) {
        Ok(session) => {
            // A program that is writing into the session has its own drafts.
            sweep(folder);
            let logs = log_names(folder)?.len();
            return Ok(Rebuilt { session, written: false, kept: None, logs, unreadable: Vec::new() });
        }
        Err(SessionError::NotASession { .. }) => false,
        Err(SessionError::Manifest { .. } | SessionError::Plan(_)) => true,
        Err(error) => return Err(error),
    };
    if damaged && is_in_use(folder) {
        return Err(SessionError::BeingRecorded { path: folder.to_owned() });
    }
    let (mut plan, mut logs, mut unreadable) = (None::<(PathBuf, Plan)>, 0, Vec::new());
    let mut created = None::<String>;
    for name in log_names(folder)? {
        let log = folder.join(name);
        let Ok(found) = plan_of(&log).map_err(|reason| unreadable.push(reason)) else { continue };
        logs += 1;
        let of_log =
            Reader::open(&log).ok().and_then(|reader| reader.meta()).map(|identity: Identity| identity.created);
        created = created.into_iter().chain(of_log.filter(|created| !created.is_empty())).min();
        match &plan {
            None => plan = Some((log, found)),
            Some((one, first)) => {
                if let Some(difference) = difference(first, &found) {
                    let (folder, one) = (folder.to_owned(), one.clone());
                    return Err(SessionError::DifferentPlans { folder, one, other: log, difference });
                }
            }
        }
    }
    let (_, plan) = plan.ok_or_else(|| SessionError::NothingToRebuild { folder: folder.to_owned() })?;
    sweep(folder);
    let manifest = folder.join(MANIFEST);
    let kept = damaged.then(|| manifest.with_added_extension("damaged"));
    if let Some(kept) = &kept {
        system::file::rename(&manifest, kept).map_err(|source| SessionError::Io { path: manifest, source })?;
    }
    // The session began with its first log.
    let mut manifest = Manifest::new(&plan);
    manifest.created = created.unwrap_or(manifest.created);
    manifest.write(folder)?;
    Ok(Rebuilt { session: Session::open(folder)?, written: true, kept, logs, unreadable })
}

/// Returns the plan in a log with its robot, or the reason why the log does not have both.
fn plan_of(log: &Path) -> Result<Plan, String> {
    let read = || -> Result<(Option<PlanMeta>, Option<RobotMeta>), LogError> {
        let mut reader = Reader::open(log)?;
        Ok((reader.read_until()?, reader.read_until()?))
    };
    let (meta, robot) = read().map_err(|error| described(&error))?;
    let plan = meta.and_then(|meta| Plan::parse(&meta.text, "the plan").ok()).zip(robot);
    let (plan, robot) = plan.ok_or_else(|| format!("{}: the record of its plan cannot be read", log.display()))?;
    let sensor = Reader::open(log).and_then(|mut reader| reader.read_until()).map_err(|error| described(&error))?;
    Ok(Plan { robot: RobotFile::of_log(Some(robot)), sensor, ..plan })
}
