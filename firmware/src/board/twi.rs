//! The two-wire interface as a master (section 22), with a timeout, recovery from a stuck bus, and a speed that the bus
//! can follow.
//!
//! Every step on the bus, of at most nine bits, may take [`Twi::patience`]. A device that was interrupted in the middle of
//! a byte holds SDA low until it gets its clock pulses: after a bus error, up to nine pulses and a STOP free it (NXP UM10204,
//! section 3.1.16).
//!
//! Where lines rise slowly (long wires, weak pull-ups), the hardware itself makes each bit longer: its high time begins when
//! SCL is high. It does not wait for SDA: if SDA rises later than SCL, a one is seen as a zero, and arbitration is
//! lost. A lower speed gives SDA more time. So [`FAILURES`] bus errors in a row that left both lines high halve the
//! speed until the next start. This would not help if a line stays low. The speed is not halved again: at 100 kHz,
//! reading the sensor makes the longest tick as long as the time between two ticks.

use avr_device::atmega328p::{PORTC, TC0, TWI};
use embedded_hal::i2c::{self, ErrorKind, I2c, NoAcknowledgeSource, Operation};

use super::CPU_HZ;

/// Returns TWBR for a speed: SCL runs at the crystal's frequency / (16 + 2 TWBR).
const fn twbr(bus_hz: u32) -> u8 {
    ((CPU_HZ / bus_hz - 16) / 2) as u8
}

const FAST: u8 = twbr(400_000);
const SLOW: u8 = twbr(200_000);

/// Bus errors in a row before the speed is halved.
const FAILURES: u8 = 4;

/// Half a period of the recovery's pulses, 5 µs.
const HALF_PULSE_CYCLES: u32 = CPU_HZ / 200_000;

const SDA: u8 = 1 << 4;
const SCL: u8 = 1 << 5;

const TWINT: u8 = 1 << 7;
const TWEA: u8 = 1 << 6;
const TWSTA: u8 = 1 << 5;
const TWSTO: u8 = 1 << 4;
const TWEN: u8 = 1 << 2;

/// Status codes (tables 22-2 and 22-3).
mod status {
    pub const START: u8 = 0x08;
    pub const REPEATED_START: u8 = 0x10;
    pub const ADDRESS_WRITE_ACK: u8 = 0x18;
    pub const ADDRESS_WRITE_NACK: u8 = 0x20;
    pub const WRITE_ACK: u8 = 0x28;
    pub const WRITE_NACK: u8 = 0x30;
    pub const ADDRESS_READ_ACK: u8 = 0x40;
    pub const ADDRESS_READ_NACK: u8 = 0x48;
    pub const READ_ACK: u8 = 0x50;
    pub const READ_NACK: u8 = 0x58;
}

/// An error on the bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Error {
    /// No device answered.
    NoAcknowledge(NoAcknowledgeSource),
    /// The bus is in a wrong state or timed out. It has been recovered.
    Bus,
}

impl i2c::Error for Error {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NoAcknowledge(source) => ErrorKind::NoAcknowledge(*source),
            Self::Bus => ErrorKind::Bus,
        }
    }
}

/// The bus.
pub struct Twi {
    registers: TWI,
    lines: PORTC,
    twbr: u8,
    /// Bus errors in a row.
    failures: u8,
}

impl Twi {
    /// Takes the bus and recovers it from a transaction that a restart has cut off.
    pub fn new(registers: TWI, lines: PORTC) -> Self {
        let mut twi = Self { registers, lines, twbr: FAST, failures: 0 };
        twi.recover();
        twi
    }

    fn control(&mut self, bits: u8) {
        // SAFETY: any value is valid.
        self.registers.twcr.write(|write| unsafe { write.bits(bits | TWEN) });
    }

    /// Returns the longest time of a step, in counts of timer 0, which always runs for the PWM: nine bits, which are 22.5 or
    /// 45 µs, and 50 µs for the lines to rise, 5 µs a bit.
    fn patience(&self) -> u8 {
        self.twbr / 4 + 15
    }

    /// Waits while TWCR, masked, has this value.
    #[inline(never)]
    fn wait_while(&mut self, mask: u8, value: u8) -> Result<(), Error> {
        let start = time();
        loop {
            // The time is read first, so that an interrupt between the two reads is not taken for a delay of the bus.
            let passed = time().wrapping_sub(start);
            if self.registers.twcr.read().bits() & mask != value {
                return Ok(());
            }
            if passed > self.patience() {
                return Err(Error::Bus);
            }
        }
    }

    /// Takes one step on the bus; returns the status after it.
    fn step(&mut self, bits: u8) -> Result<u8, Error> {
        self.control(TWINT | bits);
        self.wait_while(TWINT, 0)?;
        Ok(self.registers.twsr.read().bits() & 0xF8)
    }

    fn send(&mut self, byte: u8) -> Result<u8, Error> {
        self.registers.twdr.write(|write| write.bits(byte));
        self.step(0)
    }

    fn start(&mut self, address: u8, read: bool) -> Result<(), Error> {
        let status = self.step(TWSTA)?;
        if status != status::START && status != status::REPEATED_START {
            return Err(Error::Bus);
        }
        match self.send(address << 1 | u8::from(read))? {
            status::ADDRESS_WRITE_ACK | status::ADDRESS_READ_ACK => Ok(()),
            status::ADDRESS_WRITE_NACK | status::ADDRESS_READ_NACK => {
                Err(Error::NoAcknowledge(NoAcknowledgeSource::Address))
            }
            _ => Err(Error::Bus),
        }
    }

    fn stop(&mut self) -> Result<(), Error> {
        self.control(TWINT | TWSTO);
        self.wait_while(TWSTO, TWSTO)
    }

    fn operate(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), Error> {
        let mut reading = None;
        for operation in operations {
            let is_read = matches!(operation, Operation::Read(_));
            if reading.replace(is_read) != Some(is_read) {
                self.start(address, is_read)?;
            }
            match operation {
                Operation::Write(bytes) => {
                    for byte in bytes.iter() {
                        match self.send(*byte)? {
                            status::WRITE_ACK => {}
                            status::WRITE_NACK => return Err(Error::NoAcknowledge(NoAcknowledgeSource::Data)),
                            _ => return Err(Error::Bus),
                        }
                    }
                }
                Operation::Read(bytes) => self.read(bytes)?,
            }
        }
        Ok(())
    }

    /// Reads bytes. Each of them arrives while the one before is stored.
    fn read(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        let mut left = bytes.len() as u8;
        // The last one is not acknowledged, which ends the transfer.
        let acknowledge = |left| if left > 1 { TWEA } else { 0 };
        self.control(TWINT | acknowledge(left));
        for byte in bytes {
            self.wait_while(TWINT, 0)?;
            let (status, value) = (self.registers.twsr.read().bits() & 0xF8, self.registers.twdr.read().bits());
            let expected = if left > 1 { status::READ_ACK } else { status::READ_NACK };
            left -= 1;
            if left > 0 {
                self.control(TWINT | acknowledge(left));
            }
            if status != expected {
                return Err(Error::Bus);
            }
            *byte = value;
        }
        Ok(())
    }

    /// Clocks the bus free and restarts the interface.
    fn recover(&mut self) {
        // SAFETY: any value is valid in these registers.
        unsafe {
            self.registers.twcr.write(|write| write.bits(0));
            // An output pulls its line low, an input releases it.
            self.lines.portc.modify(|read, write| write.bits(read.bits() & !(SDA | SCL)));
        }
        self.pull(SCL | SDA, 0);
        for _ in 0..9 {
            if self.lines.pinc.read().bits() & SDA != 0 {
                break;
            }
            self.pull(SCL, SCL);
            self.pull(SCL, 0);
        }
        // A START and a STOP by hand reset every device.
        self.pull(SDA, SDA);
        self.pull(SDA, 0);
        self.count_failure();
        // SAFETY: any value is valid in these registers.
        unsafe {
            self.registers.twbr.write(|write| write.bits(self.twbr));
            self.registers.twsr.write(|write| write.bits(0));
            self.registers.twcr.write(|write| write.bits(TWEN));
        }
    }

    /// Counts a bus error, and halves the speed if it is the likely reason.
    fn count_failure(&mut self) {
        let are_high = self.lines.pinc.read().bits() & (SDA | SCL) == SDA | SCL;
        self.failures = if are_high { self.failures.saturating_add(1) } else { 0 };
        if self.failures >= FAILURES {
            self.twbr = SLOW;
        }
    }

    /// Pulls the lines in `low` and releases the other lines of `mask`; then waits half a period.
    fn pull(&mut self, mask: u8, low: u8) {
        // SAFETY: any value is valid; interrupts do not use this port.
        self.lines.ddrc.modify(|read, write| unsafe { write.bits(read.bits() & !mask | low) });
        avr_device::asm::delay_cycles(HALF_PULSE_CYCLES);
    }
}

/// Returns the time in counts of 4 µs.
fn time() -> u8 {
    // SAFETY: only reads.
    unsafe { &*TC0::ptr() }.tcnt0.read().bits()
}

impl i2c::ErrorType for Twi {
    type Error = Error;
}

impl I2c for Twi {
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), Error> {
        let outcome = match self.operate(address, operations) {
            Ok(()) => self.stop(),
            Err(Error::Bus) => Err(Error::Bus),
            // The bus works: free it for the next transaction.
            Err(error) => self.stop().and(Err(error)),
        };
        if outcome == Err(Error::Bus) {
            self.recover();
        } else {
            self.failures = 0;
        }
        outcome
    }
}
