//! The user's folders.

use std::path::PathBuf;

/// What a user without a folder for settings can do.
pub const CURE: &str = "set HOME or XDG_CONFIG_HOME";

/// Returns the folder of the user's settings: `XDG_CONFIG_HOME`, or `~/.config`. `None` if the user has no home.
pub fn config() -> Option<PathBuf> {
    let configured = std::env::var_os("XDG_CONFIG_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    configured.or_else(|| Some(std::env::home_dir()?.join(".config")))
}
