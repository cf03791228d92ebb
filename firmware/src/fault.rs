//! Faults: the latch that holds the first one, and the crash record that survives a restart.
//!
//! The program restarts itself after a hang or a panic, by a jump. The record is one byte that a jump leaves unchanged and
//! every hardware reset clears:
//!
//! | byte | cause of the start |
//! | --- | --- |
//! | 0 | a reset |
//! | 0xB1 | a hang |
//! | 0xB2 | a panic |

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

/// Why the program restarted itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Crash {
    /// The watchdog was not fed.
    Hang = 0xB1,
    /// A panic.
    Panic = 0xB2,
}

impl Crash {
    /// Returns the crash in a record.
    pub fn from_record(record: u8) -> Option<Self> {
        const HANG: u8 = Crash::Hang as u8;
        const PANIC: u8 = Crash::Panic as u8;
        match record {
            HANG => Some(Self::Hang),
            PANIC => Some(Self::Panic),
            _ => None,
        }
    }

    /// Returns the fault to latch after this crash.
    pub fn fault(self) -> Fault {
        match self {
            Self::Hang => Fault::Hang,
            Self::Panic => Fault::Panic,
        }
    }
}

/// Returns the cause of a start, from the crash record and the hardware's reset flags (MCUSR of the ATmega328P, section
/// 11.9.1), which a bootloader usually clears.
pub fn reset_cause(crash: Option<Crash>, mcusr: u8) -> ResetCause {
    const POWER_ON: u8 = 0b0001;
    const EXTERNAL: u8 = 0b0010;
    const BROWN_OUT: u8 = 0b0100;
    const WATCHDOG: u8 = 0b1000;
    match crash {
        Some(Crash::Hang) => ResetCause::Hang,
        Some(Crash::Panic) => ResetCause::Panic,
        // Power-on usually sets the flags of brown-out and the reset pin too.
        None if mcusr & POWER_ON != 0 => ResetCause::PowerOn,
        None if mcusr & BROWN_OUT != 0 => ResetCause::BrownOut,
        None if mcusr & WATCHDOG != 0 => ResetCause::Watchdog,
        None if mcusr & EXTERNAL != 0 => ResetCause::External,
        None => ResetCause::Unknown,
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
    fn a_crash_is_read_back_and_nothing_else_is() {
        assert_eq!((0..=u8::MAX).filter_map(Crash::from_record).collect::<Vec<_>>(), [Crash::Hang, Crash::Panic]);
        assert_eq!(Crash::from_record(Crash::Hang as u8).map(Crash::fault), Some(Fault::Hang));
        assert_eq!(Crash::from_record(Crash::Panic as u8).map(Crash::fault), Some(Fault::Panic));
    }

    #[test]
    fn the_cause_of_a_start_is_found() {
        assert_eq!(reset_cause(None, 0), ResetCause::Unknown);
        assert_eq!(reset_cause(Some(Crash::Hang), 0), ResetCause::Hang);
        assert_eq!(reset_cause(Some(Crash::Panic), 0), ResetCause::Panic);
        assert_eq!(reset_cause(None, 0b0010), ResetCause::External);
        assert_eq!(reset_cause(None, 0b1000), ResetCause::Watchdog);
        assert_eq!(reset_cause(None, 0b0110), ResetCause::BrownOut);
        assert_eq!(reset_cause(None, 0b0111), ResetCause::PowerOn);
    }
}
