//! Statistics of the link.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Largest counter of a trial: 10¹², over a million per second in the longest trial. Sums over millions of trials fit
/// into 64 bits.
const MOST: u64 = 1_000_000_000_000;

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
    /// Number of times the host had to search for the start of a frame: broken COBS, no delimiter, or a foreign frame.
    pub resyncs: u64,
    /// Requests that were sent again.
    pub retries: u64,
}

impl LinkStats {
    /// Returns whether every frame arrived.
    pub fn is_lossless(&self) -> bool {
        self.lost == 0
    }

    /// Returns whether the counters are possible for a trial. Larger counters come from a damaged or forged log.
    pub(super) fn is_possible(mut self) -> bool {
        self.counters().into_iter().all(|count| *count <= MOST)
    }

    fn counters(&mut self) -> [&mut u64; 6] {
        let Self { samples, lost, repeated, crc_errors, resyncs, retries } = self;
        [samples, lost, repeated, crc_errors, resyncs, retries]
    }
}

impl std::ops::AddAssign for LinkStats {
    fn add_assign(&mut self, mut other: Self) {
        for (count, more) in self.counters().into_iter().zip(other.counters()) {
            *count = count.saturating_add(*more);
        }
    }
}

impl fmt::Display for LinkStats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { samples, lost, repeated, crc_errors, resyncs, retries } = self;
        write!(f, "{samples} samples, {lost} lost, {crc_errors} CRC errors, {resyncs} resyncs, {retries} retries")?;
        if *repeated > 0 { write!(f, ", {repeated} repeated") } else { Ok(()) }
    }
}
