//! Lines that the user types while a command works.

use std::io::{IsTerminal, stdin};

/// Calls a function, on a thread of its own, for each line that the user types, if standard input is a console.
pub fn hear(mut line: impl FnMut(&str) + Send + 'static) {
    if stdin().is_terminal() {
        std::thread::spawn(move || stdin().lines().map_while(Result::ok).for_each(|typed| line(typed.trim())));
    }
}
