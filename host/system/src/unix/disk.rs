//! Room on a disk.

use std::path::Path;

/// Returns the bytes that this user may still write on the disk of a folder, if the system knows.
pub fn free_bytes(folder: &Path) -> Option<f64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail as f64 * disk.f_frsize as f64)
}
