//! The user's folders.

use std::path::PathBuf;

/// What a user without a folder for settings can do.
pub const CURE: &str = "set APPDATA";

/// Returns the folder of the user's settings: `%APPDATA%`. `None` if the user has none.
pub fn config() -> Option<PathBuf> {
    std::env::var_os("APPDATA").map(PathBuf::from).filter(|path| path.is_absolute())
}
