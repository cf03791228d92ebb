//! The latch that holds the first fault, and the cause of a start.

use protocol::{Fault, ResetCause};

/// Holds the first fault until it is cleared.
#[derive(Debug, Default)]
pub struct Latch(Fault);

impl Latch {
    /// Latches `fault`, unless one is latched already; returns whether it did.
    pub fn set(&mut self, fault: Fault) -> bool {
        let new = self.0 == Fault::None && fault != Fault::None;
        if new {
            self.0 = fault;
        }
        new
    }

    /// Clears the latched fault.
    pub fn clear(&mut self) {
        self.0 = Fault::None;
    }

    /// Returns the latched fault.
    pub fn get(&self) -> Fault {
        self.0
    }

    /// Returns whether a fault is latched.
    pub fn is_set(&self) -> bool {
        self.0 != Fault::None
    }
}

/// Returns the cause of a start, from the record of a hang and the hardware's reset flags (MCUSR of the ATmega328P,
/// section 11.9.1), which a bootloader usually clears.
pub fn reset_cause(has_hung: bool, mcusr: u8) -> ResetCause {
    const POWER_ON: u8 = 0b0001;
    const EXTERNAL: u8 = 0b0010;
    const BROWN_OUT: u8 = 0b0100;
    const WATCHDOG: u8 = 0b1000;
    match mcusr {
        _ if has_hung => ResetCause::Hang,
        // Power-on usually sets the flags of brown-out and the reset pin too.
        _ if mcusr & POWER_ON != 0 => ResetCause::PowerOn,
        _ if mcusr & BROWN_OUT != 0 => ResetCause::BrownOut,
        _ if mcusr & WATCHDOG != 0 => ResetCause::Watchdog,
        _ if mcusr & EXTERNAL != 0 => ResetCause::External,
        _ => ResetCause::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_fault_stays_until_it_is_cleared() {
        let mut latch = Latch::default();
        assert!(!latch.set(Fault::None));
        assert!(latch.set(Fault::LinkLost));
        assert!(!latch.set(Fault::Motor1Stalled));
        assert_eq!(latch.get(), Fault::LinkLost);
        latch.clear();
        assert!(!latch.is_set());
        assert!(latch.set(Fault::Motor1Stalled));
    }

    #[test]
    fn the_cause_of_a_start_is_found() {
        assert_eq!(reset_cause(false, 0), ResetCause::Unknown);
        assert_eq!(reset_cause(true, 0), ResetCause::Hang);
        assert_eq!(reset_cause(false, 0b0010), ResetCause::External);
        assert_eq!(reset_cause(false, 0b1000), ResetCause::Watchdog);
        assert_eq!(reset_cause(false, 0b0110), ResetCause::BrownOut);
        assert_eq!(reset_cause(false, 0b0111), ResetCause::PowerOn);
    }
}
