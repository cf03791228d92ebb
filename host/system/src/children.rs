//! Programs that this one starts.

use crate::own::group::{self, Group};
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// A program and all that it starts in turn.
///
/// Ctrl-C on the terminal does not reach it. It must end by itself when its standard input ends. This program holds that input,
/// so the other one also ends if this program is killed.
#[derive(Debug)]
pub struct Family {
    /// The program.
    pub child: Child,
    group: Group,
}

impl Family {
    /// Starts a program.
    ///
    /// # Errors
    /// As [`Command::spawn`].
    pub fn start(command: &mut Command) -> std::io::Result<Self> {
        let (child, group) = group::start(command)?;
        Ok(Self { child, group })
    }

    /// Waits for the program to exit; returns `None` if it has not exited within `longest`.
    pub fn wait(&mut self, longest: Duration) -> Option<ExitStatus> {
        let begun = Instant::now();
        loop {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            if begun.elapsed() >= longest {
                return None;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Waits for the program to exit; after this time it is killed with all that it has started.
    pub fn end(&mut self, longest: Duration) {
        if self.wait(longest).is_none() {
            // Killing only a shell would leave its children running.
            self.group.kill(&self.child);
            let _ = self.child.wait();
        }
    }

    /// Returns whether the program only waits for a processor (`R`) or the disk (`D`): see proc_pid_stat(5). Other
    /// systems than Linux give `false`.
    pub fn is_held_up(&self) -> bool {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).unwrap_or_default();
        // The name of the program before it may contain spaces and parentheses.
        let state = stat.rsplit_once(')').and_then(|(_, rest)| rest.split_whitespace().next());
        matches!(state, Some("R" | "D"))
    }
}

/// Reads lines of at most `longest` bytes on a thread, which ends with the output: a program that hangs must not block this one.
pub fn lines(output: impl Read + Send + 'static, longest: u64) -> Receiver<String> {
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        let mut output = BufReader::new(output);
        let mut line = Vec::new();
        while let Ok(1..) = output.by_ref().take(longest).read_until(b'\n', &mut line) {
            if sender.send(String::from_utf8_lossy(&line).trim_end().to_owned()).is_err() {
                return;
            }
            line.clear();
        }
    });
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Stdio;

    #[test]
    fn a_program_ends_with_its_children() {
        let line =
            if cfg!(windows) { "start /b ping -n 1000 127.0.0.1 & echo & pause" } else { "sleep 1000 & echo & wait" };
        let mut command = crate::shell::command(line);
        let mut family = Family::start(command.stdin(Stdio::piped()).stdout(Stdio::piped())).unwrap();
        let mut output = BufReader::new(family.child.stdout.take().unwrap());
        output.read_line(&mut String::new()).unwrap();
        let begun = Instant::now();
        family.end(Duration::from_millis(100));
        // The output ends with the last of them.
        output.read_to_end(&mut Vec::new()).unwrap();
        assert!(begun.elapsed() < Duration::from_secs(10), "somebody was left");
    }
}
