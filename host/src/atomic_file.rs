//! Atomic file replacement: a reader sees the old file or the new one, never a partial file.

use std::fs::File;
use std::io::{BufWriter, ErrorKind};
use std::path::{Path, PathBuf};

/// Writes a draft beside `path` and renames it to `path`. A link at `path` is replaced, not followed, so that links in
/// an untrusted folder cannot redirect the write.
///
/// # Errors
/// The file cannot be written; an existing file is unchanged. A device is not replaced.
pub fn replace(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>) -> std::io::Result<()> {
    if path.metadata().is_ok_and(|existing| !existing.is_file() && !existing.is_dir()) {
        return Err(std::io::Error::other("not a regular file"));
    }
    let draft = draft(path);
    let written = create(&draft).and_then(|file| {
        let mut file = BufWriter::new(file);
        write(&mut file)?;
        file.into_inner()?.sync_all()
    });
    let placed = written.and_then(|()| std::fs::rename(&draft, path));
    if placed.is_err() {
        let _ = std::fs::remove_file(&draft);
    }
    placed
}

/// Creates a file at `path`, replacing one that a killed program left. A link is removed, not its target.
///
/// # Errors
/// The file cannot be created.
pub fn create(path: &Path) -> std::io::Result<File> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    File::create_new(path)
}

/// Returns the path of the draft of a file. It differs between programs that write the same file.
pub fn draft(path: &Path) -> PathBuf {
    path.with_added_extension(format!("{}.partial", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn links_are_replaced_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [inside, outside] = ["inside", "outside"].map(|name| folder.path().join(name));
        std::fs::create_dir(&inside).unwrap();
        std::fs::write(&outside, "precious").unwrap();
        let page = inside.join("page");
        for link in [page.clone(), draft(&page)] {
            std::os::unix::fs::symlink(&outside, link).unwrap();
        }
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
}
