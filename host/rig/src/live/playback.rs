//! Plays a log at its original or another speed.

use super::server::Live;
use biflag_log::schema::{self, biflag::event::Kind};
use biflag_log::{Body, LogError, Reader};
use serde::Serialize;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use study::progress::Progress;

/// Longest wait between checks for an interruption.
const NAP: Duration = Duration::from_millis(50);

/// Wait for a viewer to subscribe to all of its channels, one by one.
const SETTLING: Duration = Duration::from_millis(300);

/// Result of playing a log.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Played {
    /// Played time of the log, s.
    pub played_s: f64,
    /// Messages sent.
    pub messages: u64,
    /// Whether the log was played to its end.
    pub complete: bool,
}

/// Waits until a viewer has subscribed; returns `false` if the user interrupted the program.
pub fn wait_for_viewer(live: &Live, interrupted: &AtomicBool) -> bool {
    while !live.is_watched() {
        if interrupted.load(Ordering::Relaxed) {
            return false;
        }
        std::thread::sleep(NAP);
    }
    std::thread::sleep(SETTLING);
    true
}

/// Plays a log at `speed` times the speed of its recording.
///
/// # Errors
/// [`LogError`].
pub fn play(
    log: &Path,
    speed: f64,
    live: &Live,
    progress: &Progress,
    interrupted: &AtomicBool,
) -> Result<Played, LogError> {
    let mut played = Played::default();
    let begun = Instant::now();
    let mut first_ns = None;
    for message in Reader::open(log)? {
        let message = message?;
        let Some(channel) = schema::channel(&message.topic) else { continue };
        let elapsed_ns = message.log_time_ns.saturating_sub(*first_ns.get_or_insert(message.log_time_ns));
        let elapsed_s = elapsed_ns as f64 * 1e-9;
        let due = begun + Duration::from_secs_f64(elapsed_s / speed);
        loop {
            if interrupted.load(Ordering::Relaxed) {
                return Ok(played);
            }
            let wait = due.saturating_duration_since(Instant::now());
            if wait.is_zero() {
                break;
            }
            std::thread::sleep(wait.min(NAP));
        }
        if let Body::Event(event) = &message.body
            && event.kind() == Kind::Phase
        {
            progress.phase(&log.display().to_string(), &event.text);
        }
        progress.within(elapsed_s);
        live.show(channel, message.log_time_ns, &message.body.encode());
        played.messages += 1;
        played.played_s = played.played_s.max(elapsed_s);
    }
    played.complete = true;
    Ok(played)
}
