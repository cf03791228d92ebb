//! Counts of what arrived over the link and what was lost.

use biflag_log::LinkStats;
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

/// Counts of the link during one trial.
#[derive(Debug, Clone, Default)]
pub struct Monitor {
    stats: LinkStats,
    last: Option<Count>,
    out_of_step: bool,
}

impl Monitor {
    /// Returns the counts so far.
    pub fn stats(&self) -> LinkStats {
        self.stats
    }

    /// Counts a frame of the stream; returns the gap before it.
    pub fn frame(&mut self, telemetry: &Telemetry) -> Option<Gap> {
        self.stats.samples += 1;
        self.out_of_step = false;
        let before = self.last.replace(telemetry.seq)?;
        let first = Count(before.0.wrapping_add(1));
        let count = telemetry.seq.0.wrapping_sub(first.0);
        self.stats.lost += u64::from(count);
        (count > 0).then_some(Gap { first, count })
    }

    /// Counts a frame that could not be read. Consecutive ones are one resync.
    pub fn damaged(&mut self, error: FrameError) {
        self.stats.crc_errors += u64::from(error == FrameError::Crc);
        self.stats.resyncs += u64::from(!self.out_of_step);
        self.out_of_step = true;
    }

    /// Counts a request that was sent this many times.
    pub fn asked(&mut self, attempts: u32) {
        self.stats.retries += u64::from(attempts.saturating_sub(1));
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
        assert_eq!((monitor.stats().samples, monitor.stats().lost), (3, 3));
    }

    #[test]
    fn a_run_of_damage_is_one_resync() {
        let mut monitor = Monitor::default();
        monitor.frame(&telemetry(0));
        monitor.damaged(FrameError::Crc);
        monitor.damaged(FrameError::Cobs);
        monitor.frame(&telemetry(3));
        monitor.damaged(FrameError::Crc);
        let stats = monitor.stats();
        assert_eq!((stats.crc_errors, stats.resyncs, stats.lost), (2, 2, 2));
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
        assert_eq!((monitor.stats().lost, monitor.stats().samples), (dropped, 1_000_000 - dropped));
        assert!(dropped > 50_000);
    }
}
