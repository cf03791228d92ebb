//! The shell of a user's commands.

pub use crate::shell::quoted_for_sh as quoted;

use std::process::Command;

/// The command that installs a program, without its name.
pub const INSTALL: &str = if cfg!(target_os = "macos") { "brew install" } else { "sudo apt install" };

/// Returns the shell that runs a user's command.
pub fn command(line: &str) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", line]);
    shell
}
