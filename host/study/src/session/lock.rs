//! Locks a session, so that only one program at a time writes into it.

use super::{Attempt, MANIFEST, Session, SessionError, TrialState};
use biflag_log::atomic_file;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::Duration;
use system::lock;

/// End of the name of a log while a simulation writes it.
pub const UNFINISHED: &str = ".mcap.unfinished";

/// The other programs that may write into the session at the same time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sharing {
    /// None.
    Alone,
    /// Other shards of the same plan, which compute other trials.
    WithShards,
}

/// The lock of a session. It is released when it is dropped, or when the program ends in any way.
#[derive(Debug)]
pub struct Lock {
    _manifest: File,
}

/// Returns whether another program has exclusive use of the session in `folder`, like `biflag record`. Shards do not
/// count: their logs get their names when they are complete. The lock is not kept, and nothing in the folder is
/// changed; a folder without a manifest is not in use.
pub fn is_in_use(folder: &Path) -> bool {
    // Two programs that ask at once share the lock.
    File::open(folder.join(MANIFEST))
        .is_ok_and(|manifest| matches!(lock::try_lock_shared(&manifest), Err(TryLockError::WouldBlock)))
}

impl Session {
    /// Locks the session for writing. With [`Sharing::Alone`], also removes files left by killed programs.
    ///
    /// # Errors
    /// [`SessionError::InUse`] if another program holds the lock.
    pub fn lock(&self, sharing: Sharing) -> Result<Lock, SessionError> {
        let path = self.folder().join(MANIFEST);
        // On network file systems an exclusive lock requires a file open for writing.
        let manifest = File::options()
            .read(true)
            .write(true)
            .open(&path)
            .map_err(|source| SessionError::Io { path: path.clone(), source })?;
        let try_lock = || match sharing {
            Sharing::Alone => lock::try_lock(&manifest),
            Sharing::WithShards => lock::try_lock_shared(&manifest),
        };
        let mut locked = try_lock();
        if matches!(locked, Err(TryLockError::WouldBlock)) {
            // Another program may only have asked whether the session is in use.
            std::thread::sleep(Duration::from_millis(50));
            locked = try_lock();
        }
        match locked {
            Err(TryLockError::WouldBlock) => Err(SessionError::InUse { folder: self.folder().to_owned() }),
            // Not every file system supports locks. Without them, logs are still protected: they are never overwritten.
            Ok(()) | Err(TryLockError::Error(_)) => {
                if sharing == Sharing::Alone {
                    atomic_file::sweep(self.folder());
                    self.remove_unfinished();
                }
                Ok(Lock { _manifest: manifest })
            }
        }
    }

    /// Removes the unfinished logs of killed simulations. The lock ensures that no program is writing them.
    fn remove_unfinished(&self) {
        for entry in std::fs::read_dir(self.folder()).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().ends_with(UNFINISHED) {
                // A file that cannot be removed is replaced when the trial is computed again.
                let _ = std::fs::remove_file(entry.path());
            }
        }
    }
}

/// Returns the log that a program is writing into the session in `folder`, from the states of its trials: the last modified log
/// without a summary. Other logs without a summary are of recordings that were killed.
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
    let folder = atomic_file::folder_of(log);
    let open = || recorded(folder, Session::open(folder).ok()?.states().ok()?.iter());
    is_in_use(folder) && open().is_some_and(|recorded| recorded.file_name() == log.file_name())
}
