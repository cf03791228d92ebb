//! The board's supply, from a measurement of the chip's bandgap reference relative to the supply (ATmega328P, section
//! 23.5.2).

use protocol::units::Millivolts;
use protocol::{Fault, MIN_SUPPLY_MV};

use crate::round_to_i16;

/// Number of successive readings below the limit that make a fault. A single spike on the supply does not.
const LOW_READINGS: u8 = 2;

/// The supply over time.
#[derive(Debug, Default)]
pub struct Supply {
    low: u8,
}

impl Supply {
    /// Takes a reading of the reference, in 1024ths of the supply; returns the supply.
    #[inline(never)]
    pub fn update(&mut self, counts: u16, bandgap: Millivolts) -> Millivolts {
        // The program has a division of f32 anyway; one of u32 would add a kilobyte.
        let supply = round_to_i16(f32::from(bandgap.0) * 1024.0 / f32::from(counts.max(1)), 0).unsigned_abs();
        self.low = if supply < MIN_SUPPLY_MV { self.low.saturating_add(1) } else { 0 };
        Millivolts(supply)
    }

    /// Returns the present fault.
    pub fn fault(&self) -> Fault {
        if self.low >= LOW_READINGS { Fault::SupplyLow } else { Fault::None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BANDGAP: Millivolts = Millivolts(1100);

    #[test]
    fn the_supply_follows_from_the_reference() {
        let mut supply = Supply::default();
        assert_eq!(supply.update(225, BANDGAP), Millivolts(5006));
        assert_eq!(supply.update(225, Millivolts(1060)), Millivolts(4824));
        assert_eq!(supply.update(1023, BANDGAP), Millivolts(1101));
        assert_eq!(supply.update(0, Millivolts(1200)), Millivolts(32767), "no division by zero");
    }

    #[test]
    fn two_low_readings_in_a_row_are_a_fault_while_they_last() {
        let mut supply = Supply::default();
        let faults: Vec<_> = [225, 263, 225, 263, 263, 263, 225]
            .map(|counts| {
                supply.update(counts, BANDGAP);
                supply.fault() == Fault::SupplyLow
            })
            .into();
        assert_eq!(faults, [false, false, false, false, true, true, false]);
    }

    #[test]
    fn the_least_supply_is_no_fault() {
        for (bandgap, millivolts, fault) in [(1075, MIN_SUPPLY_MV, Fault::None), (1074, 4296, Fault::SupplyLow)] {
            let mut supply = Supply::default();
            for _ in 0..LOW_READINGS {
                assert_eq!(supply.update(256, Millivolts(bandgap)), Millivolts(millivolts));
            }
            assert_eq!(supply.fault(), fault);
        }
    }
}
