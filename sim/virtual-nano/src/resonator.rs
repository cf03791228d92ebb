//! The chip's resonator: its cycles in real time.

use crate::mcu::FREQUENCY_HZ;

/// A resonator, whose frequency may change.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Resonator {
    /// The frequency.
    pub hz: f64,
    /// The last change: cycle, and time in s.
    since: (u64, f64),
}

impl Default for Resonator {
    fn default() -> Self {
        Self { hz: FREQUENCY_HZ as f64, since: (0, 0.0) }
    }
}

impl Resonator {
    /// Returns the time at a cycle, s.
    pub fn seconds(&self, cycle: u64) -> f64 {
        self.since.1 + (cycle - self.since.0) as f64 / self.hz
    }

    /// Returns the cycle at a time, which must not be before the last change of frequency.
    pub fn cycle(&self, time_s: f64) -> u64 {
        self.since.0 + ((time_s - self.since.1).max(0.0) * self.hz).round() as u64
    }

    /// Sets the relative error of the frequency from this cycle on.
    pub fn set_error(&mut self, cycle: u64, fraction: f64) {
        self.since = (cycle, self.seconds(cycle));
        self.hz = FREQUENCY_HZ as f64 * (1.0 + fraction);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_on_where_the_frequency_changes() {
        let mut resonator = Resonator::default();
        resonator.set_error(16_000_000, 0.005);
        assert_eq!(resonator.seconds(16_000_000), 1.0);
        assert!((resonator.seconds(16_000_000 + 16_080_000) - 2.0).abs() < 1e-12);
        assert_eq!(resonator.cycle(2.0), 32_080_000);
    }
}
