//! A program and all that it starts in turn: a group of processes.

use rustix::process::{Pid, Signal, kill_process_group};
use std::io::Result;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command};

/// The group, which has the number of its first program.
#[derive(Debug)]
pub struct Group;

/// Starts a program in a group of its own, which Ctrl-C does not reach.
pub fn start(command: &mut Command) -> Result<(Child, Group)> {
    Ok((command.process_group(0).spawn()?, Group))
}

impl Group {
    /// Kills all programs of the group.
    pub fn kill(&self, first: &Child) {
        let _ = kill_process_group(Pid::from_child(first), Signal::KILL);
    }
}
