//! Suggests a file for a mistyped path, and a name for a mistyped name.

use std::path::{Path, PathBuf};

/// Smallest similarity of two names, 0 to 1: 0.75 is one wrong letter, or two that changed places, in four.
const LEAST: f64 = 0.75;

/// Returns the existing file or folder with the name most similar to a path that does not exist: first a file whose ending
/// `.toml` was left out, as it may be for files inside biflag.
pub fn similar(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let whole = path.with_added_extension("toml");
    if whole.is_file() {
        return Some(whole);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let entries = std::fs::read_dir(folder.unwrap_or(Path::new("."))).ok()?;
    let found = most_alike(name, entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()))?;
    Some(path.with_file_name(found))
}

/// Returns the name most similar to a mistyped one, if any is similar.
pub fn most_alike<T: AsRef<str> + Ord>(typed: &str, names: impl IntoIterator<Item = T>) -> Option<T> {
    let likeness = |name: T| {
        let likeness = strsim::normalized_damerau_levenshtein(typed, name.as_ref());
        (likeness >= LEAST && name.as_ref() != typed).then_some((likeness, name))
    };
    let likely = names.into_iter().filter_map(likeness);
    likely.max_by(|(a, one), (b, other)| a.total_cmp(b).then_with(|| other.cmp(one))).map(|(_, name)| name)
}

/// Returns a help text that suggests the most similar name, or else `otherwise`.
pub fn suggest<T: AsRef<str> + Ord>(typed: &str, names: impl IntoIterator<Item = T>, otherwise: &str) -> String {
    most_alike(typed, names).map_or_else(|| otherwise.to_owned(), |name| format!("did you mean {}?", name.as_ref()))
}

/// Returns a help text that suggests a similar file for one that does not exist, or else `otherwise`.
pub fn did_you_mean(path: &Path, otherwise: &str) -> String {
    let found = similar(path).filter(|_| !path.exists());
    found.map_or_else(|| otherwise.to_owned(), |found| format!("did you mean {}?", found.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_letter_finds_the_file() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["first.toml", "first.html", "002_w1-90_w2+90.mcap", "002_w1-90_w2+91.mcap", "glycerin-1"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = |name: &str| similar(&folder.path().join(name));
        for (typed, meant) in [
            ("frist.toml", Some("first.toml")),
            ("first.tom", Some("first.toml")),
            ("first", Some("first.toml")),
            ("glycerin-11", Some("glycerin-1")),
            ("002_w1-90_w2+9.mcap", Some("002_w1-90_w2+90.mcap")),
            ("second.toml", None),
            ("", None),
            ("missing/first.toml", None),
        ] {
            assert_eq!(found(typed), meant.map(|name| folder.path().join(name)), "{typed}");
        }
    }
}
