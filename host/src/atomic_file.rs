//! Files that are there whole or not at all.

use std::fs::File;
use std::io::{BufWriter, ErrorKind};
use std::path::{Path, PathBuf};

/// Writes a file beside its place and then puts it there, over whatever bore its name. A link of that name is replaced,
/// never followed, so that a folder that came from elsewhere leads no writing out of itself.
///
/// # Errors
/// Where it cannot be written; what was there before then still is.
pub fn replace(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>) -> std::io::Result<()> {
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

/// A new file at `path`. What a killed program left there goes; a link goes too, and not what it points to.
///
/// # Errors
/// Where it cannot be created.
pub fn create(path: &Path) -> std::io::Result<File> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    File::create_new(path)
}

/// Where a file is written until it is whole. Two programs that write the same file have one each.
pub fn draft(path: &Path) -> PathBuf {
    path.with_added_extension(format!("{}.partial", std::process::id()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn links_are_replaced_and_not_followed() {
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
    fn what_fails_leaves_everything_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let page = folder.path().join("page");
        std::fs::write(&page, "old").unwrap();
        replace(&page, |file| file.write_all(b"ne").and(Err(std::io::Error::other("full")))).unwrap_err();
        assert_eq!(std::fs::read_to_string(&page).unwrap(), "old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
