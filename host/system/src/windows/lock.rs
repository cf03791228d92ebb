//! Locks of files. They exclude other locks, not readers: the lock is on one byte far beyond the end of any file, because other
//! programs cannot read locked bytes.

use std::fs::{File, TryLockError};
use std::io::{Error, Result};
use std::os::windows::io::AsRawHandle;
use windows_sys::Win32::Foundation::{ERROR_IO_PENDING, ERROR_LOCK_VIOLATION};
use windows_sys::Win32::Storage::FileSystem::{
    LOCKFILE_EXCLUSIVE_LOCK, LOCKFILE_FAIL_IMMEDIATELY, LockFileEx, UnlockFileEx,
};
use windows_sys::Win32::System::IO::OVERLAPPED;

/// Locks a file that is open for reading, exclusively.
///
/// # Errors
/// [`TryLockError::WouldBlock`] if the file is locked already.
pub fn try_lock(file: &File) -> std::result::Result<(), TryLockError> {
    lock(file, LOCKFILE_EXCLUSIVE_LOCK)
}

/// Locks a file that is open for reading, shared with other such locks.
///
/// # Errors
/// [`TryLockError::WouldBlock`] if the file is locked exclusively.
pub fn try_lock_shared(file: &File) -> std::result::Result<(), TryLockError> {
    lock(file, 0)
}

/// Releases the lock, as closing the file does.
///
/// # Errors
/// The file is not locked.
pub fn unlock(file: &File) -> Result<()> {
    // SAFETY: the file is open, and the pointer is valid.
    match unsafe { UnlockFileEx(file.as_raw_handle(), 0, 1, 0, &mut place()) } {
        0 => Err(Error::last_os_error()),
        _ => Ok(()),
    }
}

fn lock(file: &File, kind: u32) -> std::result::Result<(), TryLockError> {
    // SAFETY: the file is open, and the pointer is valid until the call returns, which is at once.
    if unsafe { LockFileEx(file.as_raw_handle(), kind | LOCKFILE_FAIL_IMMEDIATELY, 0, 1, 0, &mut place()) } != 0 {
        return Ok(());
    }
    let error = Error::last_os_error();
    let is_locked =
        [ERROR_LOCK_VIOLATION, ERROR_IO_PENDING].map(|code| Some(code as i32)).contains(&error.raw_os_error());
    Err(if is_locked { TryLockError::WouldBlock } else { TryLockError::Error(error) })
}

/// The place of the byte.
fn place() -> OVERLAPPED {
    let mut place = OVERLAPPED::default();
    place.Anonymous.Anonymous.Offset = u32::MAX - 1;
    place.Anonymous.Anonymous.OffsetHigh = i32::MAX as u32;
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_keeps_other_locks_away_and_no_reader() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("session.toml");
        std::fs::write(&path, "text").unwrap();
        let [one, other] = [(); 2].map(|()| File::open(&path).unwrap());
        let is_refused = |result| matches!(result, Err(TryLockError::WouldBlock));
        try_lock(&one).unwrap();
        assert!(is_refused(try_lock(&other)) && is_refused(try_lock_shared(&other)));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "text");
        std::fs::write(&path, "more").unwrap();
        drop(one);
        try_lock_shared(&other).unwrap();
        let one = File::open(&path).unwrap();
        try_lock_shared(&one).unwrap();
        unlock(&other).unwrap();
        assert!(is_refused(try_lock(&other)));
    }
}
