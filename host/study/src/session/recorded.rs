//! Which log of a session is being recorded at present.

use super::{Attempt, Session, TrialState, is_in_use};
use std::path::{Path, PathBuf};

/// Returns the log that a program writes into the session in `folder`, whose trials have these states: of those without a
/// summary, the one that was written to last. The others are those of recordings that were killed.
pub fn recorded<'a>(folder: &Path, states: impl Iterator<Item = &'a TrialState>) -> Option<PathBuf> {
    if !is_in_use(folder) {
        return None;
    }
    let open = states.filter_map(TrialState::best).filter(|attempt| attempt.summary.is_none());
    let written = |attempt: &&Attempt| attempt.path.metadata().and_then(|file| file.modified()).ok();
    open.max_by_key(written).map(|attempt| attempt.path.clone())
}

/// Returns whether a log is being recorded.
pub fn is_being_recorded(log: &Path) -> bool {
    let folder = log.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let open = || recorded(folder, Session::open(folder).ok()?.states().ok()?.iter());
    is_in_use(folder) && open().is_some_and(|recorded| recorded.file_name() == log.file_name())
}
