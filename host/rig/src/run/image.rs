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

/// Marker in the image, followed by the hash of its sources.
const SOURCES_MARKER: &[u8] = b"biflag-sources:";

/// The script in the repository that builds the image and prints the hash of its sources.
const SCRIPT: &str = "firmware/build.sh";

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
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum ImageError {
    /// The file cannot be read.
    #[error("{path}: the firmware image cannot be read")]
    #[diagnostic(code(wrong_use), help("check the path, or leave out --firmware to build the image"))]
    Unreadable { path: PathBuf, source: io::Error },
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

    /// Returns the image of the source in a repository: the one that `firmware/build.sh` left there, or this embedded one. If
    /// both were built from another source, whatever their times, it is built first.
    ///
    /// # Errors
    /// [`ImageError::BuildFailed`], or as [`Image::read`] and [`Image::extract`].
    pub fn of_source(repository: &Path, embedded: &[u8]) -> Result<Self, ImageError> {
        let sources = script(repository, &["--sources"])?;
        let is_of_source = |bytes: &[u8]| after(bytes, SOURCES_MARKER, sources.len()) == Some(sources.as_bytes());
        let elf = repository.join("target/firmware.elf");
        if std::fs::read(&elf).is_ok_and(|bytes| is_of_source(&bytes)) {
            return Self::read(&elf);
        }
        if is_of_source(embedded) {
            return Self::extract(embedded);
        }
        let text = "building the firmware first, because its source has changed; up to a minute, or longer while another cargo builds";
        let _ = writeln!(io::stderr(), "{text}");
        Self::read(Path::new(&script(repository, &[])?))
    }
}

/// Runs the script that builds the image; returns the last line of its output. Its messages go to standard error.
fn script(repository: &Path, arguments: &[&str]) -> Result<String, ImageError> {
    let output = Command::new("sh")
        .arg(repository.join(SCRIPT))
        .args(arguments)
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| ImageError::BuildFailed(error.to_string()))?;
    if !output.status.success() {
        return Err(ImageError::BuildFailed(format!("{SCRIPT} ended with {}, see above", output.status)));
    }
    let stdout = String::from_utf8_lossy(&output.stdout);
    Ok(stdout.lines().last().unwrap_or_default().trim().to_owned())
}

/// Returns `length` bytes after a marker.
fn after<'a>(bytes: &'a [u8], marker: &[u8], length: usize) -> Option<&'a [u8]> {
    let start = bytes.windows(marker.len()).position(|window| window == marker)? + marker.len();
    bytes.get(start..start + length)
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
    let (digits, dirty) = after(bytes, MARKER, 9)?.split_at(8);
    let hash = u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
    Some(commit_text(hash.to_be_bytes(), dirty == b"+"))
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
    fn an_image_is_used_until_its_source_changes() {
        let repository = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = repository.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        // The script exits where it would build.
        file(SCRIPT, &include_str!("../../../../firmware/build.sh").replace("# True if", "exit 3\n# True if"));
        let sources = ["firmware/src/main.rs", "protocol/Cargo.toml", "Cargo.toml", "Cargo.lock"];
        sources.iter().for_each(|name| file(name, "old"));
        let of_source = |embedded: &str| Image::of_source(repository.path(), embedded.as_bytes());
        let hash = script(repository.path(), &["--sources"]).unwrap();
        let [left, embedded] =
            ["c0ffee12", "c0ffee13"].map(|commit| format!("biflag-firmware:{commit} 1 biflag-sources:{hash}"));
        assert_eq!(of_source(&embedded).unwrap().commit, "c0ffee13");
        file("target/firmware.elf", &left);
        assert_eq!(of_source(&embedded).unwrap().commit, "c0ffee12");
        for name in sources {
            file(name, "new");
            let error = of_source(&embedded).unwrap_err();
            assert!(
                matches!(&error, ImageError::BuildFailed(text) if text.contains("exit status: 3")),
                "{name}: {error}"
            );
            file(name, "old");
            assert!(of_source(&embedded).is_ok(), "{name} as before, though it is younger");
        }
    }

    #[test]
    fn other_files_are_rejected() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = Image::read(file.path()).unwrap_err();
        assert!(matches!(error, ImageError::NotOurs(_)));
    }
}
