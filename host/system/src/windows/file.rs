//! The identity of a file, and its name.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{Error, ErrorKind, Result};
use std::mem::zeroed;
use std::os::windows::ffi::OsStringExt;
use std::os::windows::fs::OpenOptionsExt;
use std::os::windows::io::AsRawHandle;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use windows_sys::Win32::Foundation::{ERROR_SHARING_VIOLATION, MAX_PATH};
use windows_sys::Win32::Storage::FileSystem::{
    FILE_FLAG_BACKUP_SEMANTICS, GetFileInformationByHandle, GetFinalPathNameByHandleW,
};

/// Longest time for which a virus scanner or an editor may delay the renaming or replacement of a file that it has open.
const IN_USE: Duration = Duration::from_secs(2);

/// Returns whether two paths name the same file, also through links.
pub fn is_same(one: &Path, other: &Path) -> bool {
    matches!((id(one), id(other)), (Some(one), Some(other)) if one == other)
}

fn id(path: &Path) -> Option<[u32; 3]> {
    // Folders open with this flag only.
    let file = OpenOptions::new().access_mode(0).custom_flags(FILE_FLAG_BACKUP_SEMANTICS).open(path).ok()?;
    // SAFETY: it consists of integers.
    let mut found = unsafe { zeroed() };
    // SAFETY: the file is open, and the pointer is valid.
    let is_known = unsafe { GetFileInformationByHandle(file.as_raw_handle(), &mut found) } != 0;
    is_known.then_some([found.dwVolumeSerialNumber, found.nFileIndexHigh, found.nFileIndexLow])
}

/// Returns the path of a file from the root, without links.
///
/// # Errors
/// As [`Path::canonicalize`].
pub fn full_path(path: &Path) -> Result<PathBuf> {
    Ok(plain(path.canonicalize()?))
}

/// Returns a path of a drive in its usual form, which other programs know too, if it is short enough for them.
fn plain(full: PathBuf) -> PathBuf {
    let is_usual = |path: &&str| path.len() < MAX_PATH as usize && path.as_bytes().get(1) == Some(&b':');
    full.to_str().and_then(|path| path.strip_prefix(r"\\?\")).filter(is_usual).map_or(full.clone(), PathBuf::from)
}

/// Renames a file, in place of another. Another program that has one of them open may delay this for a moment.
///
/// # Errors
/// As [`fs::rename`].
pub fn rename(from: &Path, to: &Path) -> Result<()> {
    let begun = Instant::now();
    loop {
        match fs::rename(from, to) {
            Err(error) if is_in_use(&error) && !to.is_dir() && begun.elapsed() < IN_USE => {
                std::thread::sleep(IN_USE / 100);
            }
            result => return result,
        }
    }
}

fn is_in_use(error: &Error) -> bool {
    error.kind() == ErrorKind::PermissionDenied || error.raw_os_error() == Some(ERROR_SHARING_VIOLATION as i32)
}

/// Returns a path by which a program can open the file of its standard output, to write at any position.
///
/// # Errors
/// The system does not know the path.
pub fn output_path(output: &File) -> Result<PathBuf> {
    let mut path = vec![0; 32_768];
    // SAFETY: the file is open, and the buffer has the stated length.
    let length = unsafe { GetFinalPathNameByHandleW(output.as_raw_handle(), path.as_mut_ptr(), path.len() as u32, 0) };
    if length == 0 {
        return Err(Error::last_os_error());
    }
    path.truncate(length as usize);
    Ok(plain(OsString::from_wide(&path).into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_the_same_under_another_name() {
        let folder = tempfile::tempdir().unwrap();
        let [one, link, other] = ["one", "link", "other"].map(|name| folder.path().join(name));
        fs::write(&one, "").unwrap();
        fs::write(&other, "").unwrap();
        fs::hard_link(&one, &link).unwrap();
        assert!(is_same(&one, &link) && is_same(folder.path(), &folder.path().join(".")));
        assert!(!is_same(&one, &other) && !is_same(&one, &folder.path().join("missing")));
    }

    #[test]
    fn a_full_path_has_its_usual_form() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let full = full_path(file.path()).unwrap();
        assert!(full.to_str().unwrap().as_bytes()[1] == b':' && is_same(&full, file.path()), "{full:?}");
        assert_eq!(output_path(file.as_file()).unwrap(), full);
        let of_server = PathBuf::from(r"\\?\UNC\lab\folder");
        assert_eq!(plain(of_server.clone()), of_server);
    }

    #[test]
    fn a_file_that_another_program_reads_is_replaced_when_it_is_done() {
        let folder = tempfile::tempdir().unwrap();
        let [old, new] = ["old", "new"].map(|name| folder.path().join(name));
        fs::write(&old, "old").unwrap();
        fs::write(&new, "new").unwrap();
        // Opened as by most programs: the file cannot be removed meanwhile.
        let reader = OpenOptions::new().read(true).share_mode(1).open(&old).unwrap();
        let reads = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(300));
            drop(reader);
        });
        rename(&new, &old).unwrap();
        assert!(reads.is_finished() && fs::read_to_string(&old).unwrap() == "new");
    }
}
