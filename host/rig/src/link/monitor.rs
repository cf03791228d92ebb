//! Counts of received and lost frames.

use biflag_log::LinkStats;
use protocol::Telemetry;
use protocol::frame::FrameError;
use protocol::units::Count;

/// Missing frames of the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Gap {
    /// The number of the first missing frame.
    pub first: Count,
    /// Number of missing frames.
    pub count: u16,
}

/// The place of a frame in the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// The frame is the next one, or the first.
    Next,
    /// Frames before this one are missing.
    After(Gap),
    /// The frame has already been counted, or is older than a counted one.
    Repeated,
}

/// Counts of the link during one trial.
#[derive(Debug, Clone, Default)]
pub struct Monitor {
    /// The counts so far.
    pub stats: LinkStats,
    last: Option<Count>,
    out_of_step: bool,
}

impl Monitor {
    /// Counts a frame of the stream.
    pub fn frame(&mut self, telemetry: &Telemetry) -> Arrival {
        self.out_of_step = false;
        let ahead = self.last.map_or(1, |last| telemetry.seq.0.wrapping_sub(last.0));
        // A gap of half of all numbers would be minutes of silence, which would have ended the trial.
        if ahead == 0 || ahead > u16::MAX / 2 {
            self.stats.repeated += 1;
            return Arrival::Repeated;
        }
        self.last = Some(telemetry.seq);
        self.stats.samples += 1;
        let count = ahead - 1;
        self.stats.lost += u64::from(count);
        match count {
            0 => Arrival::Next,
            count => Arrival::After(Gap { first: Count(telemetry.seq.0.wrapping_sub(count)), count }),
        }
    }

    /// Returns whether a frame that has not been counted directly follows the last one.
    pub fn is_next(&self, telemetry: &Telemetry) -> bool {
        self.last.is_some_and(|last| telemetry.seq.0 == last.0.wrapping_add(1))
    }

    /// Counts missing frames after the last one. Returns `None` if there are none.
    pub fn missing(&mut self, count: u16) -> Option<Gap> {
        let last = self.last.filter(|_| count > 0)?;
        self.stats.lost += u64::from(count);
        Some(Gap { first: Count(last.0.wrapping_add(1)), count })
    }

    /// Counts a frame that could not be read. Consecutive unreadable frames count as one resync.
    pub fn damaged(&mut self, error: FrameError) {
        self.stats.crc_errors += u64::from(error == FrameError::Crc);
        self.stats.resyncs += u64::from(!self.out_of_step);
        self.out_of_step = true;
    }

    /// Counts the repetitions of a request after this many attempts.
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
        assert_eq!(monitor.frame(&telemetry(65534)), Arrival::Next);
        assert_eq!(monitor.frame(&telemetry(65535)), Arrival::Next);
        assert!(monitor.is_next(&telemetry(0)) && !monitor.is_next(&telemetry(3)));
        assert_eq!(monitor.frame(&telemetry(3)), Arrival::After(Gap { first: Count(0), count: 3 }));
        assert_eq!((monitor.stats.samples, monitor.stats.lost), (3, 3));
    }

    #[test]
    fn frames_that_come_again_are_no_loss() {
        let mut monitor = Monitor::default();
        let arrivals = [65534, 65535, 65534, 65535, 0, 0, 2, 1].map(|seq| monitor.frame(&telemetry(seq)));
        assert_eq!(arrivals.iter().filter(|arrival| **arrival == Arrival::Repeated).count(), 4, "{arrivals:?}");
        let stats = monitor.stats;
        assert_eq!((stats.samples, stats.lost, stats.repeated), (4, 1, 4));
    }

    #[test]
    fn a_run_of_damage_is_one_resync() {
        let mut monitor = Monitor::default();
        monitor.frame(&telemetry(0));
        monitor.damaged(FrameError::Crc);
        monitor.damaged(FrameError::Cobs);
        monitor.frame(&telemetry(3));
        monitor.damaged(FrameError::Crc);
        let stats = monitor.stats;
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
        assert_eq!((monitor.stats.lost, monitor.stats.samples), (dropped, 1_000_000 - dropped));
        assert!(dropped > 50_000);
    }
}
