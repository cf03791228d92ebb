//! The board's telemetry outside of trials.

use super::error::RecordError;
use crate::link::{Event, Link, LinkError};
use protocol::{Command, Telemetry};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Waits for the next frame.
///
/// # Errors
/// [`RecordError::Interrupted`], [`RecordError::Silent`], [`LinkError::Closed`].
pub(super) fn next_frame(link: &Link, interrupted: &AtomicBool) -> Result<Telemetry, RecordError> {
    loop {
        if interrupted.load(Ordering::Relaxed) {
            return Err(RecordError::Interrupted);
        }
        match link.next(Duration::from_millis(20)).map(|received| received.event) {
            Some(Event::Telemetry(frame)) => return Ok(frame),
            Some(Event::Silent { bytes }) => return Err(RecordError::Silent { cause: None, bytes }),
            Some(Event::Closed) => return Err(link.closed().into()),
            _ => {}
        }
    }
}

/// Ends the telemetry and discards everything that has already arrived.
///
/// # Errors
/// As [`Link::command`].
pub(super) fn end(link: &Link) -> Result<(), LinkError> {
    link.command(Command::Stream { rate_hz: 0 })?;
    while link.next(Duration::ZERO).is_some_and(|received| !matches!(received.event, Event::Closed)) {}
    Ok(())
}
