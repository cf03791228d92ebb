//! Compares the time in the program's frames with the cycle count of the emulator at that moment.
//!
//! A frame has the time at which its tick began, and the program marks that moment (see [`crate::marks`]). The emulator
//! reads the program's bytes only here.

use crate::mcu::FREQUENCY_HZ;
use protocol::Message;
use protocol::frame::Accumulator;
use protocol::units::Micros;

/// Cycles in a microsecond.
const CYCLES_PER_US: u64 = FREQUENCY_HZ / 1_000_000;

/// The program's clock in the emulator's cycles.
#[derive(Default)]
pub struct ProgramClock {
    frame: Accumulator,
    /// The cycle at which the last tick began.
    tick: Option<u64>,
    /// The last tick before the frame under way began.
    sent_in: Option<u64>,
    within_frame: bool,
    /// The emulator's microseconds less the program's, modulo 2^32.
    ahead: Option<u32>,
}

impl ProgramClock {
    /// Records the beginning of a tick.
    pub fn tick(&mut self, cycle: u64) {
        self.tick = Some(cycle);
    }

    /// Reads a byte from the chip.
    pub fn hear(&mut self, byte: u8) {
        if !self.within_frame {
            self.sent_in = self.tick;
        }
        self.within_frame = byte != 0;
        if let (Some(Ok(Message::Telemetry(telemetry))), Some(cycle)) = (self.frame.push(byte), self.sent_in) {
            let ahead = ((cycle / CYCLES_PER_US) as u32).wrapping_sub(telemetry.time.0);
            // A frame that had to wait is sent in a later tick than its own, and seems older than it is.
            let is_less = self.ahead.is_none_or(|known| (ahead.wrapping_sub(known) as i32) < 0);
            if is_less {
                self.ahead = Some(ahead);
            }
        }
    }

    /// Returns the program's clock at a cycle, `None` before its first frame.
    pub fn at(&self, cycle: u64) -> Option<Micros> {
        let ours = (cycle / CYCLES_PER_US) as u32;
        self.ahead.map(|ahead| Micros(ours.wrapping_sub(ahead)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::Telemetry;
    use protocol::frame::{MAX_FRAME, encode};

    fn send(clock: &mut ProgramClock, time: u32) {
        let telemetry = Telemetry { time: Micros(time), ..Telemetry::default() };
        let mut buffer = [0; MAX_FRAME];
        for byte in encode(&Message::Telemetry(telemetry), &mut buffer).unwrap() {
            clock.hear(*byte);
        }
    }

    #[test]
    fn a_frame_tells_the_time_of_its_own_tick_across_the_wrap() {
        let mut clock = ProgramClock::default();
        assert_eq!(clock.at(16_000_000), None);
        // The program started 16 s after power, 10 ms before its clock wraps.
        let start = u32::MAX - 9_999;
        clock.tick(16 * 16_000_000);
        clock.tick(16 * 16_000_000 + 80_000);
        send(&mut clock, start);
        assert_eq!(clock.at(16_005 * 16_000), Some(Micros(start)), "as far as is known");
        send(&mut clock, start.wrapping_add(5000));
        assert_eq!(clock.at(16_005 * 16_000), Some(Micros(start.wrapping_add(5000))));
        assert_eq!(clock.at(16_025 * 16_000), Some(Micros(15_000)));
    }
}
