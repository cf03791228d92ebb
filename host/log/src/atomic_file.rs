//! Atomic creation and replacement of files: a reader sees the old file, the new one or none, never a partial file.
//!
//! A file is first written as a draft beside it, `NAME.RANDOM.partial`. Programs on several computers, or in containers
//! with equal process numbers, may write the same file at once: none of them touches another's draft. A killed program
//! leaves its draft behind. [`sweep`] removes such drafts from a folder that one program uses exclusively.

use std::ffi::OsStr;
use std::fs::File;
use std::hash::{BuildHasher, RandomState};
use std::io::{BufWriter, Error, ErrorKind, Result, Write};
use std::path::{Path, PathBuf};
use system::file::rename;
use system::lock;

/// Writes a draft beside `path` and renames it to `path`. A link at `path` is replaced, not followed, so links in an
/// untrusted folder cannot redirect the write.
///
/// # Errors
/// The file cannot be written; an existing file is unchanged. A device is not replaced.
pub fn replace(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    if path.metadata().is_ok_and(|existing| !existing.is_file() && !existing.is_dir()) {
        return Err(Error::other("not a regular file"));
    }
    let draft = Draft::create(path)?;
    let mut file = BufWriter::new(draft.file.try_clone()?);
    write(&mut file)?;
    file.into_inner()?;
    draft.file.sync_all()?;
    rename(&draft.path, path)
}

/// Writes a new file at `path`, which must not exist.
///
/// # Errors
/// [`ErrorKind::AlreadyExists`], or the file cannot be written.
pub fn create(path: &Path, text: &str) -> Result<()> {
    let mut draft = Draft::create(path)?;
    draft.file.write_all(text.as_bytes())?;
    draft.publish(path)
}

/// The draft of a file. Dropping it removes it.
#[derive(Debug)]
pub struct Draft {
    /// The open file.
    pub file: File,
    path: PathBuf,
}

impl Draft {
    /// Creates a draft of the file at `path`.
    ///
    /// # Errors
    /// The draft cannot be created.
    pub fn create(path: &Path) -> Result<Self> {
        let draft = path.with_added_extension(format!("{}.partial", random_name()));
        let file = File::options().read(true).write(true).create_new(true).open(&draft)?;
        // Protects the draft from `sweep`, which must not be called on file systems without locks.
        let _ = lock::try_lock(&file);
        Ok(Self { file, path: draft })
    }

    /// Syncs the draft and gives it its final name, which must not exist.
    ///
    /// # Errors
    /// [`ErrorKind::AlreadyExists`], or the file cannot be written.
    pub fn publish(self, path: &Path) -> Result<()> {
        self.file.sync_all()?;
        match std::fs::hard_link(&self.path, path) {
            // Some file systems do not support links.
            Err(error) if error.kind() != ErrorKind::AlreadyExists && path.symlink_metadata().is_err() => {
                rename(&self.path, path)?;
            }
            other => other?,
        }
        sync_folder_of(path);
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // After a rename there is nothing left to remove.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Removes the drafts that killed programs left in a folder. The caller must have locked the folder's content. A draft
/// that cannot be removed stays, without an error.
pub fn sweep(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        let is_left = || {
            let file = File::options().read(true).write(true).open(&path).ok()?;
            lock::try_lock(&file).ok()
        };
        if is_draft(&path) && entry.file_type().is_ok_and(|kind| kind.is_file()) && is_left().is_some() {
            let _ = std::fs::remove_file(&path);
        }
    }
}

/// Returns whether this is the name of a draft.
fn is_draft(path: &Path) -> bool {
    let random = path.file_stem().map(Path::new).and_then(Path::extension).and_then(OsStr::to_str);
    path.extension() == Some("partial".as_ref()) && random.is_some_and(|text| u64::from_str_radix(text, 16).is_ok())
}

/// Returns a name that no other program uses, on this computer or another: 16 random digits.
pub fn random_name() -> String {
    // The hasher's keys come from the system's source of random numbers.
    format!("{:016x}", RandomState::new().hash_one(()))
}

/// Syncs the folder of a file, so that its name is on the disk. Not every file system can sync a folder.
pub fn sync_folder_of(path: &Path) {
    let _ = File::open(folder_of(path)).and_then(|folder| folder.sync_all());
}

/// Returns the folder of a file.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_replaced_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [inside, outside] = ["inside", "outside"].map(|name| folder.path().join(name));
        std::fs::create_dir(&inside).unwrap();
        std::fs::write(&outside, "precious").unwrap();
        let page = inside.join("page");
        std::os::unix::fs::symlink(&outside, &page).unwrap();
        replace(&page, |file| file.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read_to_string(&outside).unwrap(), "precious");
        assert_eq!(std::fs::read_to_string(&page).unwrap(), "new");
        assert!(!page.is_symlink() && std::fs::read_dir(&inside).unwrap().count() == 1);
    }

    #[test]
    fn devices_are_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("null");
        std::os::unix::fs::symlink("/dev/null", &link).unwrap();
        replace(&link, |file| file.write_all(b"new")).unwrap_err();
        assert!(link.is_symlink());
    }

    #[test]
    fn failed_write_leaves_the_file_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("page");
        std::fs::write(&page, "old").unwrap();
        replace(&page, |file| file.write_all(b"ne").and(Err(std::io::Error::other("full")))).unwrap_err();
        assert_eq!(std::fs::read_to_string(&page).unwrap(), "old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn file_that_exists_is_not_published_over() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("log");
        let mut draft = Draft::create(&log).unwrap();
        draft.file.write_all(b"one").unwrap();
        assert!(!log.exists());
        draft.publish(&log).unwrap();
        let again = Draft::create(&log).unwrap().publish(&log).unwrap_err();
        assert_eq!(again.kind(), ErrorKind::AlreadyExists);
        assert_eq!(std::fs::read_to_string(&log).unwrap(), "one");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    /// Drafts without locks and with the same process number, as in two containers.
    #[test]
    fn drafts_of_one_file_do_not_touch_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("page");
        let mut drafts = [(); 9].map(|()| Draft::create(&page).unwrap());
        for (number, draft) in drafts.iter_mut().enumerate() {
            lock::unlock(&draft.file).unwrap();
            write!(draft.file, "{number}").unwrap();
        }
        replace(&page, |file| file.write_all(b"whole")).unwrap();
        for (number, draft) in drafts.iter().enumerate() {
            assert_eq!(std::fs::read_to_string(&draft.path).unwrap(), number.to_string());
        }
        drop(drafts);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn drafts_of_killed_programs_are_swept() {
        let folder = tempfile::tempdir().unwrap();
        let [left, log, other] = ["page.1f.partial", "a.mcap", "not.partial"].map(|name| folder.path().join(name));
        for file in [&left, &log, &other] {
            std::fs::write(file, "half").unwrap();
        }
        let in_use = Draft::create(&folder.path().join("page")).unwrap();
        assert!(left.exists(), "a draft of another program");
        sweep(folder.path());
        assert!(!left.exists() && log.exists() && in_use.path.exists() && other.exists());
    }
}
