//! How fast the board's time passes.

use crate::mcu::FREQUENCY_HZ;
use std::str::FromStr;
use std::time::{Duration, Instant};

/// The board's seconds per second.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Speed {
    /// So many.
    Factor(f64),
    /// As many as the machine can.
    Max,
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse::<f64>() {
            _ if text == "max" => Ok(Self::Max),
            Ok(factor) if (0.01..=100.0).contains(&factor) => Ok(Self::Factor(factor)),
            _ => Err("give `max`, or a factor from 0.01 to 100".into()),
        }
    }
}

/// Behind by more than this, the board does not try to catch up: the machine was suspended or is too slow.
const SLACK: Duration = Duration::from_millis(500);

/// Holds the board's time to a speed.
#[derive(Debug)]
pub struct Pace {
    speed: Speed,
    since: Instant,
    cycle: u64,
}

impl Pace {
    /// From now on, when the board's clock says `cycle`.
    pub fn new(speed: Speed, cycle: u64) -> Self {
        Self { speed, since: Instant::now(), cycle }
    }

    /// Whether the board waits for a slow host rather than lose bytes.
    pub fn waits_for_host(&self) -> bool {
        self.speed == Speed::Max
    }

    /// Sleeps until `cycle` is due.
    pub fn wait_for(&mut self, cycle: u64) {
        let Speed::Factor(factor) = self.speed else { return };
        let due = Duration::from_secs_f64((cycle - self.cycle) as f64 / FREQUENCY_HZ as f64 / factor);
        let passed = self.since.elapsed();
        if let Some(early) = due.checked_sub(passed) {
            std::thread::sleep(early);
        } else if passed - due > SLACK {
            *self = Self::new(self.speed, cycle);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_max_or_a_factor() {
        assert_eq!("max".parse(), Ok(Speed::Max));
        assert_eq!("2.5".parse(), Ok(Speed::Factor(2.5)));
        for wrong in ["", "0", "-1", "nan", "inf", "fast"] {
            assert!(wrong.parse::<Speed>().is_err(), "{wrong}");
        }
    }
}
