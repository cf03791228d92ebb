//! The identity of a file.

use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Returns whether two paths name the same file, also through links.
pub fn is_same(one: &Path, other: &Path) -> bool {
    let id = |path: &Path| std::fs::metadata(path).map(|meta| (meta.dev(), meta.ino()));
    matches!((id(one), id(other)), (Ok(one), Ok(other)) if one == other)
}
