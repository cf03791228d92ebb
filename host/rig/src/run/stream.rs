//! The board's telemetry outside of trials.

use super::error::RecordError;
use crate::link::{Event, Link, LinkError};
use protocol::{Command, TICK_HZ, Telemetry};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Counts seconds without a frame.
pub(super) struct Silences {
    count: u32,
    largest: u32,
}

impl Silences {
    /// Returns a count for the board on this link. A busy computer may keep an emulated one from running for some seconds.
    pub(super) fn new(link: &Link) -> Self {
        Self { count: 0, largest: if system::port::is_emulated(link.path()) { 4 } else { 1 } }
    }

    /// Records that a frame has arrived.
    pub(super) fn hear(&mut self) {
        self.count = 0;
    }

    /// Counts a second with this many other bytes.
    ///
    /// # Errors
    /// [`RecordError::Silent`] if the board has stopped sending.
    pub(super) fn add(&mut self, bytes: usize) -> Result<(), RecordError> {
        self.count += 1;
        if self.count < self.largest { Ok(()) } else { Err(RecordError::Silent { cause: None, bytes }) }
    }
}

/// Waits for the next frame.
///
/// # Errors
/// [`RecordError::Interrupted`], [`RecordError::Silent`], [`LinkError::Closed`].
pub(super) fn next_frame(link: &Link, interrupted: &AtomicBool) -> Result<Telemetry, RecordError> {
    let mut silences = Silences::new(link);
    loop {
        if interrupted.load(Ordering::Relaxed) {
            return Err(RecordError::Interrupted);
        }
        match link.next(Duration::from_millis(20)).map(|received| received.event) {
            Some(Event::Telemetry(frame)) => return Ok(frame),
            Some(Event::Silent { bytes }) => silences.add(bytes)?,
            Some(Event::Closed) => return Err(link.closed().into()),
            _ => {}
        }
    }
}

/// Runs `work` with motors while the board streams; then stops the motors and the stream, which must not fill memory while the
/// user reads.
///
/// # Errors
/// Those of `work`; as [`Link::command`].
pub(super) fn with_motors<T>(link: &Link, work: impl FnOnce() -> Result<T, RecordError>) -> Result<T, RecordError> {
    begin(link)?;
    let done = work();
    let stopped = link.command(Command::Stop);
    end(link)?;
    let done = done?;
    stopped?;
    Ok(done)
}

/// Begins the telemetry. A fault from before, as of a program that was killed, is forgotten with its frames.
///
/// # Errors
/// As [`Link::command`].
pub(super) fn begin(link: &Link) -> Result<(), LinkError> {
    end(link)?;
    link.clear_fault()?;
    link.command(Command::Stream { rate_hz: TICK_HZ })
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
