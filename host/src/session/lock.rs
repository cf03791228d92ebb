//! One program at a time writes into a session: two boards, or a board and the model, would mix their trials.

use super::{MANIFEST, Session, SessionError};
use std::fs::{File, TryLockError};

/// Who else may write into the session meanwhile.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sharing {
    /// Nobody.
    Alone,
    /// Other shards of the same plan, which have trials of their own.
    WithShards,
}

/// The right to write into a session, until it is dropped or the program ends, however it ends.
#[derive(Debug)]
pub struct Lock {
    _manifest: File,
}

impl Session {
    /// Takes the right to write into the session.
    ///
    /// # Errors
    /// [`SessionError::InUse`] where another program has it.
    pub fn lock(&self, sharing: Sharing) -> Result<Lock, SessionError> {
        let path = self.folder().join(MANIFEST);
        // Over a network, only a file that is open for writing can be locked alone.
        let manifest = File::options()
            .read(true)
            .write(true)
            .open(&path)
            .map_err(|source| SessionError::Io { path: path.clone(), source })?;
        let locked = match sharing {
            Sharing::Alone => manifest.try_lock(),
            Sharing::WithShards => manifest.try_lock_shared(),
        };
        match locked {
            Err(TryLockError::WouldBlock) => Err(SessionError::InUse { folder: self.folder().to_owned() }),
            // Not every file system can lock; there the names of the logs, which are exclusive, are all there is.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Lock { _manifest: manifest }),
        }
    }
}
