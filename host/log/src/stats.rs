//! Statistics of the link.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Link statistics of a trial.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(default)]
pub struct LinkStats {
    /// Telemetry frames that arrived intact.
    pub samples: u64,
    /// Telemetry frames that were lost, counted by gaps in their sequence numbers.
    pub lost: u64,
    /// Telemetry frames that arrived again, and were left out.
    pub repeated: u64,
    /// Frames from the board with a wrong CRC.
    pub crc_errors: u64,
    /// Times the host had to look for the start of a frame: broken COBS, no delimiter, or a foreign frame.
    pub resyncs: u64,
    /// Requests that were sent again.
    pub retries: u64,
}

impl LinkStats {
    /// Returns whether every frame arrived.
    pub fn is_lossless(&self) -> bool {
        self.lost == 0
    }
}

impl std::ops::AddAssign for LinkStats {
    fn add_assign(&mut self, other: Self) {
        self.samples += other.samples;
        self.lost += other.lost;
        self.repeated += other.repeated;
        self.crc_errors += other.crc_errors;
        self.resyncs += other.resyncs;
        self.retries += other.retries;
    }
}

impl fmt::Display for LinkStats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { samples, lost, repeated, crc_errors, resyncs, retries } = self;
        write!(f, "{samples} samples, {lost} lost, {crc_errors} CRC errors, {resyncs} resyncs, {retries} retries")?;
        if *repeated > 0 { write!(f, ", {repeated} repeated") } else { Ok(()) }
    }
}
