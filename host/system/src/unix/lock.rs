//! Locks of files. They keep other locks away, not readers.

use std::fs::{File, TryLockError};
use std::io;

/// Locks a file that is open for reading, for nobody else.
///
/// # Errors
/// [`TryLockError::WouldBlock`] if somebody else has locked it.
pub fn try_lock(file: &File) -> Result<(), TryLockError> {
    file.try_lock()
}

/// Locks a file that is open for reading, with others that do the same.
///
/// # Errors
/// [`TryLockError::WouldBlock`] if somebody else has locked it alone.
pub fn try_lock_shared(file: &File) -> Result<(), TryLockError> {
    file.try_lock_shared()
}

/// Releases the lock, as closing the file does.
///
/// # Errors
/// The system refuses.
pub fn unlock(file: &File) -> io::Result<()> {
    file.unlock()
}
