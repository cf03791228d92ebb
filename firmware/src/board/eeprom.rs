//! The EEPROM (section 8.4): reads at once, writes 3.4 ms long.

use avr_device::atmega328p::EEPROM;
use avr_device::interrupt;
use firmware::settings::Storage;

/// Turns of the waiting loop, about 6 cycles each: well over the 3.4 ms of a write.
const PATIENCE: u16 = 20_000;

/// The EEPROM.
pub struct Eeprom(EEPROM);

impl Eeprom {
    /// Takes it.
    pub fn new(registers: EEPROM) -> Self {
        Self(registers)
    }

    fn select(&mut self, address: u16) {
        let mut patience = PATIENCE;
        while self.0.eecr().read().eepe().bit_is_set() && patience > 0 {
            patience -= 1;
        }
        // SAFETY: a write is not going on; addresses beyond the end wrap.
        self.0.eear().write(|write| unsafe { write.bits(address) });
    }
}

impl Storage for Eeprom {
    fn read(&mut self, address: u16) -> u8 {
        self.select(address);
        self.0.eecr().write(|write| write.eere().set_bit());
        self.0.eedr().read().bits()
    }

    fn write(&mut self, address: u16, byte: u8) {
        self.select(address);
        // SAFETY: any value is valid.
        self.0.eedr().write(|write| unsafe { write.bits(byte) });
        // EEPE counts only within four cycles of EEMPE.
        interrupt::free(|_| {
            self.0.eecr().write(|write| write.eempe().set_bit());
            self.0.eecr().write(|write| write.eempe().set_bit().eepe().set_bit());
        });
    }
}
