//! The ADC, which measures the bandgap reference in parts of the supply (section 23).

use avr_device::atmega328p::ADC;

/// Reference AVCC, input the bandgap (section 23.9.1).
const BANDGAP: u8 = 1 << 6 | 0b1110;
/// Enabled, with 16 MHz / 128: within the converter's 50 to 200 kHz.
const ENABLED: u8 = 1 << 7 | 0b111;
const START: u8 = 1 << 6;

/// Ticks between measurements: four a second.
const INTERVAL: u8 = 50;

/// The converter.
pub struct SupplyMonitor {
    registers: ADC,
    /// Ticks until the next measurement begins.
    wait: u8,
}

impl SupplyMonitor {
    /// Takes the converter's registers.
    pub fn new(registers: ADC) -> Self {
        // SAFETY: any value is valid in these registers.
        unsafe {
            registers.admux.write(|write| write.bits(BANDGAP));
            registers.adcsra.write(|write| write.bits(ENABLED));
        }
        Self { registers, wait: INTERVAL }
    }

    /// Advances one tick; returns the reference in 1024ths of the supply when a measurement has ended. A measurement takes
    /// 0.1 ms and begins a tick before it is read. The reference settles in the 250 ms before the first one.
    pub fn poll(&mut self) -> Option<u16> {
        self.wait -= 1;
        match self.wait {
            1 => {
                // SAFETY: any value is valid.
                self.registers.adcsra.write(|write| unsafe { write.bits(ENABLED | START) });
                None
            }
            0 => {
                self.wait = INTERVAL;
                Some(self.registers.adc.read().bits())
            }
            _ => None,
        }
    }
}
