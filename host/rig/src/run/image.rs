//! Firmware images: their source, and the commit that they were built from.

use miette::Diagnostic;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::SystemTime;
use study::text::hex;
use tempfile::TempPath;
use thiserror::Error;

/// Marker in the image, followed by the first eight digits of the commit, a `+` or a space for a working tree with or
/// without changes, and the version of the protocol.
const MARKER: &[u8] = b"biflag-firmware:";

/// What builds the image, in the repository.
const SCRIPT: &str = "firmware/build.sh";

/// What the image is built from, in the repository.
const SOURCES: [&str; 4] = ["firmware", "protocol", "Cargo.toml", "Cargo.lock"];

/// A firmware image.
#[derive(Debug)]
pub struct Image {
    /// The ELF file.
    pub elf: PathBuf,
    /// The commit that it was built from, as formatted by [`commit_text`].
    pub commit: String,
    /// Removes the temporary file of the program's own image when it is no longer used.
    _temporary: Option<TempPath>,
}

/// Why there is no firmware image.
#[derive(Debug, Error, Diagnostic)]
pub enum ImageError {
    /// The file cannot be read.
    #[error("{path}: the firmware image cannot be read")]
    #[diagnostic(code(wrong_use), help("check the path, or leave out --firmware to build the image"))]
    Unreadable {
        /// The image.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is not a firmware image of the robot.
    #[error("{0}: is not a firmware image of the robot")]
    #[diagnostic(code(wrong_use), help("leave out --firmware to build the right one"))]
    NotOurs(PathBuf),
    /// The program has no image, and is not in the repository, where it could build one.
    #[error("this biflag was built without a firmware image, and is not in the folder of its source")]
    #[diagnostic(help("build biflag with `make build`, or name an image with --firmware"))]
    NoSource,
    /// The image inside the program could not be written to a file.
    #[error("the firmware image cannot be written to a temporary file")]
    #[diagnostic(help("make room in the folder for temporary files, or set TMPDIR to another one"))]
    NotWritten(#[source] io::Error),
    /// The build failed.
    #[error("building the firmware failed: {0}")]
    #[diagnostic(help("run `make setup` in the repository, then `sh firmware/build.sh`"))]
    BuildFailed(String),
}

impl Image {
    /// Reads an image.
    ///
    /// # Errors
    /// [`ImageError::Unreadable`] or [`ImageError::NotOurs`].
    pub fn read(elf: &Path) -> Result<Self, ImageError> {
        let bytes = std::fs::read(elf).map_err(|source| ImageError::Unreadable { path: elf.to_owned(), source })?;
        let commit = commit_of_image(&bytes).ok_or_else(|| ImageError::NotOurs(elf.to_owned()))?;
        Ok(Self { elf: elf.to_owned(), commit, _temporary: None })
    }

    /// Writes an image to a temporary file, which exists as long as the result.
    ///
    /// # Errors
    /// [`ImageError::NotWritten`], or as [`Image::read`].
    pub fn extract(content: &[u8]) -> Result<Self, ImageError> {
        let temporary = || {
            let mut file = tempfile::Builder::new().prefix("biflag-firmware-").suffix(".elf").tempfile()?;
            file.write_all(content)?;
            Ok(file.into_temp_path())
        };
        let path = temporary().map_err(ImageError::NotWritten)?;
        let image = Self::read(&path)?;
        Ok(Self { _temporary: Some(path), ..image })
    }

    /// Reads the image that `firmware/build.sh` left in a repository; `None` if there is none, or if a source is newer.
    pub fn built(repository: &Path) -> Option<Self> {
        let elf = repository.join("target/firmware.elf");
        let built = elf.metadata().and_then(|file| file.modified()).ok()?;
        let is_newest = SOURCES.iter().all(|name| last_change(&repository.join(name)).is_ok_and(|time| time <= built));
        is_newest.then(|| Self::read(&elf).ok()).flatten()
    }

    /// Builds the image from the source in a repository.
    ///
    /// # Errors
    /// [`ImageError::BuildFailed`] with the output of the build, or as [`Image::read`].
    pub fn build(repository: &Path) -> Result<Self, ImageError> {
        let output = Command::new("sh")
            .arg(repository.join(SCRIPT))
            .stdin(Stdio::null())
            .output()
            .map_err(|error| ImageError::BuildFailed(error.to_string()))?;
        if !output.status.success() {
            return Err(ImageError::BuildFailed(String::from_utf8_lossy(&output.stderr).trim_end().to_owned()));
        }
        let stdout = String::from_utf8_lossy(&output.stdout);
        Self::read(Path::new(stdout.lines().last().unwrap_or_default().trim()))
    }
}

/// Returns when a file, or the newest file in a folder, was changed.
fn last_change(path: &Path) -> io::Result<SystemTime> {
    let itself = path.metadata()?;
    if itself.is_file() {
        return itself.modified();
    }
    let entries = path.read_dir()?.map(|entry| last_change(&entry?.path()));
    entries.reduce(|newest, time| Ok(newest?.max(time?))).unwrap_or_else(|| itself.modified())
}

/// Returns the repository that this program is in: the nearest folder above it with the firmware's script and this crate.
pub fn repository() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let is_root = |folder: &&Path| [SCRIPT, "host/rig/Cargo.toml"].iter().all(|name| folder.join(name).is_file());
    program.ancestors().find(is_root).map(Path::to_owned)
}

/// Formats a commit: `c0ffee12`, or `c0ffee12+` if the working tree had changes. Zeros mean an unknown commit.
pub fn commit_text(git_hash: [u8; 4], git_dirty: bool) -> String {
    hex(&git_hash) + if git_dirty { "+" } else { "" }
}

/// Returns the commit that an image was built from, as formatted by [`commit_text`]; `None` if it is not an image of
/// the robot.
pub fn commit_of_image(bytes: &[u8]) -> Option<String> {
    let start = bytes.windows(MARKER.len()).position(|window| window == MARKER)? + MARKER.len();
    let digits = std::str::from_utf8(bytes.get(start..start + 8)?).ok()?;
    let hash = u32::from_str_radix(digits, 16).ok()?;
    Some(commit_text(hash.to_be_bytes(), bytes.get(start + 8) == Some(&b'+')))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commit_is_read_from_the_marker() {
        assert_eq!(commit_of_image(b"..biflag-firmware:c0ffee12+1..").unwrap(), "c0ffee12+");
        assert_eq!(commit_of_image(b"biflag-firmware:00000000 1").unwrap(), "00000000");
        assert_eq!(commit_of_image(b"biflag-firmware:c0ffee"), None);
        assert_eq!(commit_of_image(b"another program"), None);
    }

    #[test]
    fn an_image_is_used_until_a_source_is_newer() {
        let repository = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str, hour: u64| {
            let path = repository.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, text).unwrap();
            let time = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(3600 * hour);
            std::fs::File::options().write(true).open(path).unwrap().set_modified(time).unwrap();
        };
        let sources = ["firmware/src/main.rs", "protocol/Cargo.toml", "Cargo.toml", "Cargo.lock"];
        sources.iter().for_each(|name| file(name, "", 1));
        assert!(Image::built(repository.path()).is_none());
        file("target/firmware.elf", "biflag-firmware:c0ffee12 1", 2);
        assert_eq!(Image::built(repository.path()).unwrap().commit, "c0ffee12");
        for name in sources {
            file(name, "", 3);
            assert!(Image::built(repository.path()).is_none(), "{name}");
            file(name, "", 1);
        }
    }

    #[test]
    fn other_files_are_rejected() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = Image::read(file.path()).unwrap_err();
        assert!(matches!(error, ImageError::NotOurs(_)));
    }
}
