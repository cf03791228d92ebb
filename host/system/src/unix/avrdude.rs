//! The program that writes firmware through a bootloader.

use std::process::Command;

/// How to get it.
pub const CURE: &str = if cfg!(target_os = "macos") { "brew install avrdude" } else { "sudo apt install avrdude" };

/// Returns the program, which is on the `PATH` if it is installed.
pub fn command() -> Command {
    Command::new("avrdude")
}
