//! The replays of a trial in their session. The last one used has the plain name; the others, of other models or of
//! earlier recordings, are in the folder `attempts`.

use crate::plan::Trial;
use crate::session::{Session, SessionError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Name of the folder of the older replays.
pub(super) const ATTEMPTS: &str = "attempts";

/// Returns all replays of a trial: the plain name first, then the others, from the latest to the earliest.
pub(super) fn all(session: &Session, trial: &Trial) -> Result<Vec<PathBuf>, SessionError> {
    let mut logs: Vec<PathBuf> = session.state(trial)?.attempts.into_iter().map(|attempt| attempt.path).collect();
    logs.reverse();
    let older = session.folder().join(ATTEMPTS);
    let free = free_number(&older, trial)?;
    logs.extend((1..free).rev().map(|number| numbered(&older, trial, number)).filter(|log| log.exists()));
    Ok(logs)
}

/// Gives a replay the plain name, and moves the others away; returns the replay's path.
pub(super) fn put_first(session: &Session, trial: &Trial, log: &Path) -> Result<PathBuf, SessionError> {
    let plain = plain(session, trial);
    if log == plain {
        return Ok(plain);
    }
    let held = log.with_added_extension("moved");
    rename(log, &held)?;
    retire(session, trial)?;
    rename(&held, &plain)?;
    Ok(plain)
}

/// Moves all replays of a trial into the folder of older replays.
pub(super) fn retire(session: &Session, trial: &Trial) -> Result<(), SessionError> {
    let older = session.folder().join(ATTEMPTS);
    for attempt in session.state(trial)?.attempts {
        std::fs::create_dir_all(&older).map_err(|source| SessionError::Io { path: older.clone(), source })?;
        rename(&attempt.path, &numbered(&older, trial, free_number(&older, trial)?))?;
    }
    Ok(())
}

fn plain(session: &Session, trial: &Trial) -> PathBuf {
    session.folder().join(format!("{}.mcap", trial.name))
}

fn numbered(older: &Path, trial: &Trial, number: u32) -> PathBuf {
    older.join(format!("{}.attempt{number}.mcap", trial.name))
}

/// Returns the number after the largest one in use.
fn free_number(older: &Path, trial: &Trial) -> Result<u32, SessionError> {
    let entries = match std::fs::read_dir(older) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(1),
        Err(source) => return Err(SessionError::Io { path: older.to_owned(), source }),
    };
    let number = |name: String| -> Option<u32> {
        name.strip_prefix(&trial.name)?.strip_prefix(".attempt")?.strip_suffix(".mcap")?.parse().ok()
    };
    let used = entries.flatten().filter_map(|entry| number(entry.file_name().into_string().ok()?)).max();
    Ok(used.unwrap_or(0).saturating_add(1))
}

fn rename(from: &Path, to: &Path) -> Result<(), SessionError> {
    system::file::rename(from, to).map_err(|source| SessionError::Io { path: from.to_owned(), source })
}
