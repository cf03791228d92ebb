//! The speed at which the board's time passes.

use std::str::FromStr;
use std::time::{Duration, Instant};

/// The board's seconds per second.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Speed {
    /// This many.
    Factor(f64),
    /// As many as possible on the machine.
    Max,
    /// As many as the host asks for, one `exchange` after the other.
    Exchange,
}

impl Speed {
    /// The speed of a real board, whose time does not wait for its host.
    pub const REAL_TIME: Self = Self::Factor(1.0);
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse::<f64>() {
            _ if text == "max" => Ok(Self::Max),
            _ if text == "exchange" => Ok(Self::Exchange),
            Ok(factor) if (0.01..=100.0).contains(&factor) => Ok(Self::Factor(factor)),
            _ => Err("give `max`, `exchange`, or a factor from 0.01 to 100".into()),
        }
    }
}

/// If it is behind by more than this, the board does not try to catch up: the machine was suspended or is too slow.
const SLACK: Duration = Duration::from_millis(500);

/// Largest lead, over the last byte from its host, of a board that runs faster than real time. The host pings every 20
/// ms of the board's time. A busy machine may delay the host by 50 ms; at ten times real time that is the motors'
/// deadline, and five times the delay after which the start of a run counts as late.
const LEAD_S: f64 = 0.040;

/// Default time that the board waits for a silent host, which has hung or waits for the board. The board's time then passes
/// as fast as real time, and the motors' deadline is that of a real board. The wait must be shorter than a host's last wait
/// for an answer, 400 ms, because saving the settings takes the board longer than the lead. For a host that keeps sending
/// while it waits, the patience may be longer: it is silent only after its end.
pub const PATIENCE_S: f64 = 0.2;

/// Holds the board's time to a speed.
#[derive(Debug)]
pub struct Pace {
    speed: Speed,
    patience: Duration,
    /// Real time and the board's time (s) from which the speed is kept.
    since: (Instant, f64),
    /// Both times at the last byte from the host.
    heard: Option<(Instant, f64)>,
}

impl Pace {
    /// Returns a pace that starts now, at the board's time `board_s`, with this patience for a silent host.
    pub fn new(speed: Speed, patience: Duration, board_s: f64) -> Self {
        Self { speed, patience, since: (Instant::now(), board_s), heard: None }
    }

    /// Returns whether the board waits for a slow host rather than lose bytes: at any speed except real time.
    pub fn waits_for_host(&self) -> bool {
        self.speed != Speed::REAL_TIME
    }

    /// Returns whether time passes only in exchanges.
    pub fn stands_still(&self) -> bool {
        self.speed == Speed::Exchange
    }

    /// Sleeps until the board's time `board_s` is due.
    pub fn wait_for(&mut self, board_s: f64) {
        let Speed::Factor(factor) = self.speed else { return };
        let due = Duration::from_secs_f64((board_s - self.since.1) / factor);
        let passed = self.since.0.elapsed();
        if let Some(early) = due.checked_sub(passed) {
            std::thread::sleep(early);
        } else if passed - due > SLACK {
            self.since = (Instant::now(), board_s);
        }
    }

    /// Records that the host sent something at the board's time `board_s`.
    pub fn hear_host(&mut self, board_s: f64) {
        self.heard = Some((Instant::now(), board_s));
    }

    /// Returns whether a board that runs faster than real time must wait, so that a host that keeps its deadlines by
    /// its own clock also keeps them by the board's.
    pub fn is_ahead_of_host(&self, board_s: f64) -> bool {
        let faster = match self.speed {
            Speed::Factor(factor) => factor > 1.0,
            Speed::Max => true,
            Speed::Exchange => false,
        };
        faster
            && self.heard.is_some_and(|(at, then_s)| {
                let in_real_time_s = at.elapsed().saturating_sub(self.patience).as_secs_f64();
                board_s > then_s + LEAD_S + in_real_time_s
            })
    }

    /// Records that the host has closed the port: the board waits for nobody.
    pub fn lose_host(&mut self) {
        self.heard = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_board_waits_for_a_host_that_spoke_lately() {
        let ahead = |speed, heard: bool, board_s| {
            let mut pace = Pace::new(speed, Duration::from_millis(200), 0.0);
            if heard {
                pace.hear_host(1.0);
            }
            pace.is_ahead_of_host(board_s)
        };
        assert!(ahead(Speed::Max, true, 1.001 + LEAD_S));
        assert!(ahead(Speed::Factor(2.0), true, 1.001 + LEAD_S));
        assert!(!ahead(Speed::Max, true, 0.999 + LEAD_S));
        assert!(!ahead(Speed::Max, false, 1.001 + LEAD_S), "nobody spoke yet");
        let patience = Duration::from_secs(2);
        let mut pace = Pace::new(Speed::Max, patience, 0.0);
        let ago = |silence| Some((Instant::now().checked_sub(silence).unwrap(), 1.0));
        pace.heard = ago(patience - Duration::from_millis(500));
        assert!(pace.is_ahead_of_host(1.001 + LEAD_S), "time stands still for a host that may be slow");
        pace.heard = ago(patience + Duration::from_secs(3));
        assert!(!pace.is_ahead_of_host(3.9), "a silent host gets real time");
        assert!(pace.is_ahead_of_host(9.0), "and no more");
        pace.lose_host();
        assert!(!pace.is_ahead_of_host(9.0), "nobody is there");
        assert!(!ahead(Speed::Factor(1.0), true, 1.001 + LEAD_S), "real time waits for nobody");
    }

    #[test]
    fn a_speed_is_max_exchange_or_a_factor() {
        assert_eq!("max".parse(), Ok(Speed::Max));
        assert_eq!("exchange".parse(), Ok(Speed::Exchange));
        assert_eq!("2.5".parse(), Ok(Speed::Factor(2.5)));
        for wrong in ["", "0", "-1", "nan", "inf", "fast"] {
            assert!(wrong.parse::<Speed>().is_err(), "{wrong}");
        }
    }
}
