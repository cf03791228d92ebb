//! Signals: interruption by the user, and limits on the size of files.

#[cfg(unix)]
pub use crate::own::presses::is_ignored;
pub use crate::own::presses::survive_file_limits;

use crate::own::presses;
use miette::{IntoDiagnostic, WrapErr};
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

/// The exit code of a program that the user has interrupted.
pub const INTERRUPTED: u8 = 130;

/// Two signals closer than this are one Ctrl-C: wrappers pass on the signal that the terminal has already sent.
const SAME: Duration = Duration::from_millis(500);

/// Longest wait for the last words: the terminal may hang as well.
const LAST_WORDS: Duration = Duration::from_millis(500);

/// The flag of [`interruption`].
static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Returns whether the user has interrupted a command that handles it.
pub fn is_interrupted() -> bool {
    FLAG.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}

/// Returns a flag that is set by Ctrl-C, by a request to end, and when the terminal closes. To be called once in a
/// program.
///
/// The program then closes its files, which takes for ever on a disk that hangs: a second Ctrl-C, half a second later or
/// more, ends it at once.
///
/// On Unix, a signal that was ignored when the program started stays ignored.
///
/// # Errors
/// If the system does not allow the program to handle a signal.
pub fn interruption() -> miette::Result<Arc<AtomicBool>> {
    let interrupted = Arc::clone(FLAG.get_or_init(Arc::default));
    let mut first: Option<Instant> = None;
    let pressed = move || {
        if first.get_or_insert_with(Instant::now).elapsed() > SAME {
            say_what_is_lost();
            presses::end(INTERRUPTED);
        }
    };
    presses::hear(&interrupted, pressed).into_diagnostic().wrap_err("Ctrl-C")?;
    Ok(interrupted)
}

/// Prints the program's last words, from a thread of their own.
fn say_what_is_lost() {
    let (said, is_said) = channel();
    thread::spawn(move || {
        let _ = writeln!(
            io::stderr(),
            "interrupted again: ended at once. What was not on the disk yet is lost, and the last log may be cut off \
             (`biflag recover` keeps its beginning). Motors that turn stop at the board's deadline."
        );
        let _ = said.send(());
    });
    let _ = is_said.recv_timeout(LAST_WORDS);
}
