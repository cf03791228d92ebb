//! Questions to the user.

use crate::colour;
use crate::run::rig::RecordError;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Asks the user and returns the answer in small letters. Motors are off.
///
/// # Errors
/// [`RecordError::Interrupted`], also at the end of the input.
pub(super) fn ask(question: &str, interrupted: &AtomicBool) -> Result<String, RecordError> {
    colour::eprint(&format!("{question}: "));
    let (sender, answers) = channel();
    // A signal does not end the reading of a line, so another thread waits for it.
    std::thread::spawn(move || {
        let mut line = String::new();
        let _ = std::io::stdin().read_line(&mut line).map(|read| sender.send((read, line)));
    });
    loop {
        match answers.recv_timeout(Duration::from_millis(50)) {
            Ok((1.., line)) => return Ok(line.trim().to_lowercase()),
            // The terminal is closed.
            Ok((0, _)) | Err(RecvTimeoutError::Disconnected) => return Err(RecordError::Interrupted),
            Err(RecvTimeoutError::Timeout) if interrupted.load(Ordering::Relaxed) => {
                return Err(RecordError::Interrupted);
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}
