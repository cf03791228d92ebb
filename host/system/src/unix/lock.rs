//! Locks of files. They exclude other locks, not readers.

use std::fs::{File, TryLockError};
use std::io;

/// Locks a file that is open for reading, exclusively.
///
/// # Errors
/// [`TryLockError::WouldBlock`] if the file is locked already.
pub fn try_lock(file: &File) -> Result<(), TryLockError> {
    file.try_lock()
}

/// Locks a file that is open for reading, shared with other such locks.
///
/// # Errors
/// [`TryLockError::WouldBlock`] if the file is locked exclusively.
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
