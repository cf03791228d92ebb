//! Firmware images: their source, and the commit that they were built from.

use miette::Diagnostic;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use study::text::hex;
use tempfile::TempPath;
use thiserror::Error;

/// Marker in the image, followed by the first eight digits of the commit, a `+` or a space for a working tree with or
/// without changes, and the version of the protocol.
const MARKER: &[u8] = b"biflag-firmware:";

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
    /// The program has no image, and the firmware's source is missing.
    #[error("this biflag was built without a firmware image, and the firmware's source is not in {0}")]
    #[diagnostic(help("build biflag with `make build`, or name an image with --firmware"))]
    NoSource(PathBuf),
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

    /// Builds the image from source. This is quick if nothing changed.
    ///
    /// # Errors
    /// [`ImageError::NoSource`], [`ImageError::BuildFailed`] with the output of the build, or as [`Image::read`].
    pub fn build() -> Result<Self, ImageError> {
        let folder = source_folder();
        let script = folder.join("build.sh");
        if !script.is_file() {
            return Err(ImageError::NoSource(folder));
        }
        let output = Command::new("sh")
            .arg(&script)
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

/// Returns the repository that this program was built in.
fn repository() -> &'static Path {
    let this_crate = Path::new(env!("CARGO_MANIFEST_DIR"));
    this_crate.ancestors().nth(2).unwrap_or(this_crate)
}

/// Formats a commit: `c0ffee12`, or `c0ffee12+` if the working tree had changes. Zeros mean an unknown commit.
pub fn commit_text(git_hash: [u8; 4], git_dirty: bool) -> String {
    hex(&git_hash) + if git_dirty { "+" } else { "" }
}

/// Returns whether this program is inside the repository in which it was built, and not a copy elsewhere.
pub fn in_repository() -> bool {
    match (std::env::current_exe(), repository().canonicalize()) {
        (Ok(program), Ok(root)) => program.starts_with(root),
        _ => false,
    }
}

/// Returns the folder of the firmware's source in the repository that this program was built in.
pub fn source_folder() -> PathBuf {
    repository().join("firmware")
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
    fn other_files_are_rejected() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = Image::read(file.path()).unwrap_err();
        assert!(matches!(error, ImageError::NotOurs(_)));
    }
}
