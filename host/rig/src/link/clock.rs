//! The board's clock: unwrapped, and compared with the host's.

use biflag_log::ClockMeta;
use protocol::units::Micros;
use std::collections::VecDeque;
use std::time::{Duration, SystemTime};
use study::statistics::Line;

/// Unwraps the board's clock, which wraps every 71.6 minutes.
#[derive(Debug, Clone, Default)]
pub struct BoardClock {
    last: Option<(Micros, u64)>,
}

impl BoardClock {
    /// Largest delay of a reading, µs: an answer can overtake the frame of its tick.
    const LATE_US: u32 = 1_000_000;
    /// Longest time between two readings, µs. The host gives up after a second without data, which is some ten seconds
    /// at most for the emulated board.
    const AHEAD_US: u32 = 30_000_000;

    /// Returns the microseconds since the board's start. Readings arrive in order, some a little late. Returns `None`
    /// if the clock has jumped back or ahead, because the board has restarted.
    pub fn unwrap(&mut self, time: Micros) -> Option<u64> {
        let unwrapped = match self.last {
            None => u64::from(time.0),
            Some((last, at)) => {
                let (ahead, behind) = (time.since(last), last.since(time));
                if behind <= Self::LATE_US {
                    return Some(at.saturating_sub(u64::from(behind)));
                }
                if ahead > Self::AHEAD_US {
                    return None;
                }
                at + u64::from(ahead)
            }
        };
        self.last = Some((time, unwrapped));
        Some(unwrapped)
    }
}

/// Board and host times of the latest pings.
#[derive(Debug, Clone, Default)]
pub struct PingClock {
    pings: VecDeque<Ping>,
}

#[derive(Debug, Clone, Copy)]
struct Ping {
    board_us: u64,
    /// Middle between request and answer, s since the link was opened.
    host_s: f64,
    round_trip_s: f64,
}

impl PingClock {
    const KEPT: usize = 4096;

    /// Adds a ping sent and answered at these times since the link was opened.
    pub fn add(&mut self, board_us: u64, sent: Duration, answered: Duration) {
        if self.pings.len() == Self::KEPT {
            self.pings.pop_front();
        }
        let (sent, answered) = (sent.as_secs_f64(), answered.as_secs_f64());
        self.pings.push_back(Ping { board_us, host_s: 0.5 * (sent + answered), round_trip_s: answered - sent });
    }

    /// Returns the least-squares fit over the faster half of the pings: a slow answer gives no exact time at which the board read
    /// its clock. `opened`: when the link was opened. Returns `None` with fewer than ten pings.
    pub fn fit(&self, opened: SystemTime) -> Option<ClockMeta> {
        if self.pings.len() < 10 {
            return None;
        }
        let mut pings: Vec<Ping> = self.pings.iter().copied().collect();
        pings.sort_by(|a, b| a.round_trip_s.total_cmp(&b.round_trip_s));
        pings.truncate(pings.len().div_ceil(2));
        // The host's clock, s since the link was opened, over the board's.
        let line = Line::through(pings.iter().map(|ping| (ping.board_us as f64 * 1e-6, ping.host_s)));
        if line.spread <= 0.0 {
            return None;
        }
        let offset_s = line.level - line.slope * line.middle;
        let opened_ns = i64::try_from(opened.duration_since(SystemTime::UNIX_EPOCH).ok()?.as_nanos()).ok()?;
        Some(ClockMeta {
            pings: pings.len() as u32,
            offset_ns: opened_ns.saturating_add((offset_s * 1e9) as i64),
            drift_ppm: (1.0 / line.slope - 1.0) * 1e6,
            residual_us: (line.squares / pings.len() as f64).sqrt() * 1e6,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_goes_on_after_its_wrap_and_takes_late_frames() {
        let mut clock = BoardClock::default();
        assert_eq!(clock.unwrap(Micros(u32::MAX - 9)), Some(u64::from(u32::MAX) - 9));
        assert_eq!(clock.unwrap(Micros(10)), Some(u64::from(u32::MAX) + 11));
        assert_eq!(clock.unwrap(Micros(u32::MAX - 9)), Some(u64::from(u32::MAX) - 9));
        assert_eq!(clock.unwrap(Micros(20)), Some(u64::from(u32::MAX) + 21));
    }

    #[test]
    fn a_board_that_starts_again_is_no_wrap_whenever_it_does() {
        // Within a minute of the start, in the middle of the range, and shortly before it wraps.
        for seconds in [5, 59, 100, 1800, 3000, 4260] {
            let mut clock = BoardClock::default();
            let before = Micros(seconds * 1_000_000);
            assert_eq!(clock.unwrap(before), Some(u64::from(before.0)));
            assert_eq!(clock.unwrap(Micros(300_000)), None, "after {seconds} s");
            assert_eq!(clock.unwrap(Micros(320_000)), None, "after {seconds} s");
        }
    }

    #[test]
    fn the_fit_finds_offset_and_rate_through_jitter() {
        let mut clock = PingClock::default();
        for i in 0..200u64 {
            let board_us = 1_000_000 + i * 100_000;
            let host = 3.0 + board_us as f64 * 1e-6 * 1.00005;
            let slow = if i % 3 == 0 { 0.02 } else { 0.001 };
            clock.add(board_us, Duration::from_secs_f64(host - 0.0005), Duration::from_secs_f64(host - 0.0005 + slow));
        }
        let fit = clock.fit(SystemTime::UNIX_EPOCH).unwrap();
        assert!((fit.drift_ppm + 49.9975).abs() < 0.1, "{fit:?}");
        assert!((fit.offset_ns - 3_000_000_000).abs() < 100_000, "{fit:?}");
        assert!(fit.residual_us < 1.0, "{fit:?}");
    }

    #[test]
    fn too_few_pings_give_no_fit() {
        assert_eq!(PingClock::default().fit(SystemTime::UNIX_EPOCH), None);
    }
}
