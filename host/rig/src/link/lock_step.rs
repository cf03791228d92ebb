//! A line to an emulated board that waits for this program: its time passes only while this program waits for it.
//!
//! Nothing here depends on the computer's clock or on another thread, so requests reach the board at the same time of
//! its clock in every run, at any load of the computer. There are no pings: a program that turns the motors sends
//! speeds more often than the board's deadline.

use super::worker::{Disconnected, Line};
use std::time::{Duration, SystemTime};

/// Passes bytes to the board, lets [`SLICE_US`] of its time pass, and returns the bytes that it sent; `None` if it has
/// ended.
pub type Advance = Box<dyn FnMut(&[u8]) -> Option<Vec<u8>>>;

/// Time by which the board advances in one step, µs.
pub const SLICE_US: u64 = 1_000;

/// The line. Its times are those of the board's clock.
pub(super) struct LockStep {
    advance: Advance,
    /// Time that has passed for the board.
    passed: Duration,
    opened: SystemTime,
    outgoing: Vec<u8>,
}

impl LockStep {
    pub(super) fn new(advance: Advance, opened: SystemTime) -> Self {
        Self { advance, passed: Duration::ZERO, opened, outgoing: Vec::new() }
    }
}

impl Line for LockStep {
    fn read(&mut self) -> Result<Vec<u8>, Disconnected> {
        let outgoing = std::mem::take(&mut self.outgoing);
        let bytes = (self.advance)(&outgoing).ok_or(Disconnected)?;
        self.passed += Duration::from_micros(SLICE_US);
        Ok(bytes)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Disconnected> {
        self.outgoing.extend_from_slice(bytes);
        Ok(())
    }

    fn now(&self) -> Duration {
        self.passed
    }

    fn wall(&self) -> SystemTime {
        self.opened + self.passed
    }
}

impl Drop for LockStep {
    fn drop(&mut self) {
        let _ = (self.advance)(&self.outgoing);
    }
}
