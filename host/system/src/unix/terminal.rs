//! Lines that the user types while a command works.

use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::getpgrp;
use rustix::termios::tcgetpgrp;
use std::io::{IsTerminal, stdin};
use std::time::Duration;

/// Interval of the checks whether the command is in the foreground, while a line waits.
const AGAIN: Duration = Duration::from_millis(200);

/// Calls a function, on a thread of its own, for each line that the user types, if standard input is a terminal. A command in the
/// background reads nothing, because the system would stop it.
pub fn hear(mut line: impl FnMut(&str) + Send + 'static) {
    let listen = move || {
        let mut typed = String::new();
        while poll(&mut [PollFd::new(&stdin(), PollFlags::IN)], None).is_ok() {
            // A terminal that does not control the command has no background.
            if tcgetpgrp(stdin()).is_ok_and(|front| front != getpgrp()) {
                std::thread::sleep(AGAIN);
            } else if matches!(stdin().read_line(&mut typed), Ok(1..)) {
                line(std::mem::take(&mut typed).trim());
            } else {
                return;
            }
        }
    };
    if stdin().is_terminal() {
        std::thread::spawn(listen);
    }
}
