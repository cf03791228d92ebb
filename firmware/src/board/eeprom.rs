//! The EEPROM (section 8.4): a read is immediate, a write takes 3.4 ms.

use avr_device::atmega328p::EEPROM;
use avr_device::interrupt;
use firmware::storage::Storage;

/// Iterations of the waiting loop, about 6 cycles each: well over the 3.4 ms of a write.
const MAX_POLLS: u16 = 20_000;

/// The EEPROM.
pub struct Eeprom(EEPROM);

impl Eeprom {
    /// Takes the EEPROM's registers.
    pub fn new(registers: EEPROM) -> Self {
        Self(registers)
    }

    fn select(&mut self, address: u16) {
        let mut polls_left = MAX_POLLS;
        while self.0.eecr.read().eepe().bit_is_set() && polls_left > 0 {
            polls_left -= 1;
        }
        // Addresses beyond the end wrap.
        self.0.eear.write(|write| write.bits(address));
    }
}

impl Storage for Eeprom {
    fn read(&mut self, address: u16) -> u8 {
        self.select(address);
        self.0.eecr.write(|write| write.eere().set_bit());
        self.0.eedr.read().bits()
    }

    #[inline(never)]
    fn write(&mut self, address: u16, byte: u8) {
        self.select(address);
        self.0.eedr.write(|write| write.bits(byte));
        // EEPE counts only within four cycles of EEMPE.
        interrupt::free(|_| {
            self.0.eecr.write(|write| write.eempe().set_bit());
            self.0.eecr.write(|write| write.eempe().set_bit().eepe().set_bit());
        });
    }
}
