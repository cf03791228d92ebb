//! The identity of a file, and its name.

use std::fs::File;
use std::io::Result;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Returns whether two paths name the same file, also through links.
pub fn is_same(one: &Path, other: &Path) -> bool {
    let id = |path: &Path| std::fs::metadata(path).map(|meta| (meta.dev(), meta.ino()));
    matches!((id(one), id(other)), (Ok(one), Ok(other)) if one == other)
}

/// Returns the path of a file from the root, without links.
///
/// # Errors
/// As [`Path::canonicalize`].
pub fn full_path(path: &Path) -> Result<PathBuf> {
    path.canonicalize()
}

/// Renames a file, in place of another.
///
/// # Errors
/// As [`std::fs::rename`].
pub fn rename(from: &Path, to: &Path) -> Result<()> {
    std::fs::rename(from, to)
}

/// Returns a path by which a program can open the file of its standard output, to write at any position.
///
/// # Errors
/// None on this system.
pub fn output_path(_output: &File) -> Result<PathBuf> {
    Ok("/dev/stdout".into())
}
