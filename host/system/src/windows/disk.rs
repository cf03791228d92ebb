//! Room on a disk.

use std::os::windows::ffi::OsStrExt;
use std::path::Path;
use std::ptr::null_mut;
use windows_sys::Win32::Storage::FileSystem::GetDiskFreeSpaceExW;

/// Returns the bytes that this user may still write on the disk of a folder, if the system knows.
pub fn free_bytes(folder: &Path) -> Option<f64> {
    // Wine cannot canonicalise a long path, but finds the room for the path as it is.
    let full = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let name: Vec<u16> = full.as_os_str().encode_wide().chain([0]).collect();
    let mut free = 0;
    // SAFETY: the name ends with a zero, and null is allowed for numbers that are not needed.
    let is_known = unsafe { GetDiskFreeSpaceExW(name.as_ptr(), &mut free, null_mut(), null_mut()) };
    (is_known != 0).then_some(free as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disk_of_a_folder_has_room() {
        let folder = tempfile::tempdir().unwrap();
        assert!(free_bytes(folder.path()).unwrap() > 1e6);
        assert_eq!(free_bytes(&folder.path().join("missing")), None);
        let deep = folder.path().join("a".repeat(150)).join("b".repeat(150));
        std::fs::create_dir_all(&deep).unwrap();
        assert!(free_bytes(&deep).unwrap() > 1e6);
    }
}
