//! The program that writes firmware through a bootloader.

use std::process::Command;

/// Its name for the system's installer ([`crate::shell::INSTALL`]).
pub const PACKAGE: &str = "avrdude";

/// Returns the program, which is on the `PATH` if it is installed.
pub fn command() -> Command {
    Command::new("avrdude")
}
