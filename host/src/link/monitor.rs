//! What of the stream arrived, and what did not.

use protocol::Telemetry;
use protocol::frame::FrameError;
use protocol::units::Count;

/// Frames that are missing from the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gap {
    /// The number of the first frame that is missing.
    pub first: Count,
    /// How many are missing.
    pub count: u16,
}

/// Counts what comes over the link during one trial.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Monitor {
    /// Frames of telemetry that arrived.
    pub received: u64,
    /// Frames of telemetry that the numbers show to be missing.
    pub lost: u64,
    /// Frames that were damaged.
    pub crc_errors: u64,
    /// Times that the receiver had to find its step again: runs of damaged frames.
    pub resyncs: u64,
    /// Requests that were sent again.
    pub retries: u64,
    last: Option<Count>,
    in_step: bool,
}

impl Monitor {
    /// Takes a frame of the stream; answers what is missing before it.
    pub fn frame(&mut self, telemetry: &Telemetry) -> Option<Gap> {
        self.received += 1;
        self.in_step = true;
        let before = self.last.replace(telemetry.seq)?;
        let first = Count(before.0.wrapping_add(1));
        let count = telemetry.seq.0.wrapping_sub(first.0);
        self.lost += u64::from(count);
        (count > 0).then_some(Gap { first, count })
    }

    /// Takes a frame that could not be read.
    pub fn damaged(&mut self, _error: FrameError) {
        self.crc_errors += 1;
        self.resyncs += u64::from(self.in_step);
        self.in_step = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn telemetry(seq: u16) -> Telemetry {
        Telemetry { seq: Count(seq), ..Telemetry::default() }
    }

    #[test]
    fn gaps_are_counted_across_the_wrap() {
        let mut monitor = Monitor::default();
        assert_eq!(monitor.frame(&telemetry(65534)), None);
        assert_eq!(monitor.frame(&telemetry(65535)), None);
        assert_eq!(monitor.frame(&telemetry(3)), Some(Gap { first: Count(0), count: 3 }));
        assert_eq!((monitor.received, monitor.lost), (3, 3));
    }

    #[test]
    fn a_run_of_damage_is_one_resync() {
        let mut monitor = Monitor::default();
        monitor.frame(&telemetry(0));
        monitor.damaged(FrameError::Crc);
        monitor.damaged(FrameError::Cobs);
        monitor.frame(&telemetry(3));
        monitor.damaged(FrameError::Crc);
        assert_eq!((monitor.crc_errors, monitor.resyncs, monitor.lost), (3, 2, 2));
    }

    /// Over a million frames, dropped at random, the count is exact.
    #[test]
    fn every_dropped_frame_is_counted() {
        let mut monitor = Monitor::default();
        let (mut dropped, mut random) = (0u64, 1u64);
        for i in 0..1_000_000u64 {
            random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let first_or_last = i == 0 || i == 999_999;
            if !first_or_last && random >> 60 == 0 {
                dropped += 1;
            } else {
                monitor.frame(&telemetry(i as u16));
            }
        }
        assert_eq!((monitor.lost, monitor.received), (dropped, 1_000_000 - dropped));
        assert!(dropped > 50_000);
    }
}
