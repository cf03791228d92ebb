//! The shell of a user's commands.

pub use crate::shell::quoted_for_sh as quoted;

use std::process::Command;

/// Returns the shell that runs a user's command.
pub fn command(line: &str) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", line]);
    shell
}
