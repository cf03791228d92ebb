//! Faults: the latch that holds the first one, and the record that carries the news of a crash across a restart.
//!
//! The program restarts itself after a hang or a panic. What it was is left as one byte where a restart by jump leaves it
//! alone and every reset of the hardware clears it:
//!
//! | byte | the program |
//! | --- | --- |
//! | 0 | was started by a reset |
//! | 0xB1 | hung |
//! | 0xB2 | panicked |

use protocol::{Fault, ResetCause};

/// Holds the first fault until it is cleared.
#[derive(Debug, Default)]
pub struct Latch(Fault);

impl Latch {
    /// Latches `fault`, unless one is latched already. Whether this one is new.
    pub fn set(&mut self, fault: Fault) -> bool {
        let new = self.0 == Fault::None && fault != Fault::None;
        if new {
            self.0 = fault;
        }
        new
    }

    /// Forgets the latched fault.
    pub fn clear(&mut self) {
        self.0 = Fault::None;
    }

    /// The latched fault.
    pub fn get(&self) -> Fault {
        self.0
    }

    /// Whether one is latched.
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
    /// The crash that a record tells of.
    pub fn from_record(record: u8) -> Option<Self> {
        const HANG: u8 = Crash::Hang as u8;
        const PANIC: u8 = Crash::Panic as u8;
        match record {
            HANG => Some(Self::Hang),
            PANIC => Some(Self::Panic),
            _ => None,
        }
    }

    /// The fault to latch after this crash.
    pub fn fault(self) -> Fault {
        match self {
            Self::Hang => Fault::Hang,
            Self::Panic => Fault::Panic,
        }
    }
}

/// The cause of a start, from the record of a crash and the reset flags that the hardware left (MCUSR of the
/// ATmega328P, section 11.9.1). A bootloader usually clears these.
pub fn reset_cause(crash: Option<Crash>, mcusr: u8) -> ResetCause {
    const POWER_ON: u8 = 1 << 0;
    const EXTERNAL: u8 = 1 << 1;
    const BROWN_OUT: u8 = 1 << 2;
    const WATCHDOG: u8 = 1 << 3;
    match crash {
        Some(Crash::Hang) => ResetCause::Hang,
        Some(Crash::Panic) => ResetCause::Panic,
        // Power-on usually flags brown-out and the reset pin with it.
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
    fn the_cause_of_a_start_is_told() {
        assert_eq!(reset_cause(None, 0), ResetCause::Unknown);
        assert_eq!(reset_cause(Some(Crash::Hang), 0), ResetCause::Hang);
        assert_eq!(reset_cause(Some(Crash::Panic), 0), ResetCause::Panic);
        assert_eq!(reset_cause(None, 0b0010), ResetCause::External);
        assert_eq!(reset_cause(None, 0b1000), ResetCause::Watchdog);
        assert_eq!(reset_cause(None, 0b0110), ResetCause::BrownOut);
        assert_eq!(reset_cause(None, 0b0111), ResetCause::PowerOn);
    }
}
