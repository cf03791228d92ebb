//! A virtual MPU6050: an I2C device at address 0x68 with the part's registers, fed by a [`Source`], with faults on
//! request.
//!
//! Registers and their reset values: register map RM-MPU-6000A-00.

pub mod errors;
pub mod fault;
pub mod hand;
pub mod noise;
pub mod part;
pub mod recording;
pub mod scale;
pub mod sensor;
pub mod sensor_file;
pub mod source;
pub mod spectrum;

use crate::mcu::BusAnswer;
use fault::{Data, Fault, Faults};
use source::{Readout, Source};

/// WHO_AM_I of the genuine part.
pub const GENUINE_ID: u8 = 0x68;

const ADDRESS: u8 = 0x68;

/// Register addresses.
mod register {
    pub const SMPLRT_DIV: u8 = 0x19;
    pub const CONFIG: u8 = 0x1A;
    pub const GYRO_CONFIG: u8 = 0x1B;
    pub const ACCEL_CONFIG: u8 = 0x1C;
    pub const INT_ENABLE: u8 = 0x38;
    pub const INT_STATUS: u8 = 0x3A;
    pub const ACCEL_XOUT_H: u8 = 0x3B;
    pub const GYRO_ZOUT_L: u8 = 0x48;
    pub const PWR_MGMT_1: u8 = 0x6B;
    pub const WHO_AM_I: u8 = 0x75;
}

const DEVICE_RESET: u8 = 0x80;
const SLEEP: u8 = 0x40;
/// In INT_ENABLE and INT_STATUS.
const DATA_RDY: u8 = 0x01;

/// How long a reset by DEVICE_RESET lasts, s: the bit stays set, and writes are lost. Assumed: as long as the typical
/// start-up of the registers after power-up (data sheet, section 6.3).
const RESET_S: f64 = 0.020;

/// State of a transaction.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    /// Not addressed: silent.
    Unselected,
    /// The next byte written is a register's address.
    Pointer,
    /// The next bytes are written to registers.
    Writing,
    /// The next bytes are read from registers.
    Reading,
}

/// Counts of events on the bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct BusCount {
    /// From START to STOP.
    pub transactions: u64,
    /// Reads that began at the first of the data registers.
    pub bursts: u64,
    /// Resets by DEVICE_RESET.
    pub resets: u64,
    /// Faults that struck.
    pub faults: u64,
}

/// The part.
pub struct Mpu6050 {
    registers: [u8; 128],
    /// Its WHO_AM_I after a reset.
    pub id: u8,
    /// The sensor's input.
    pub source: Source,
    faults: Faults,
    phase: Phase,
    pointer: u8,
    /// The number of the sample in the data registers; `None` before the first.
    sample: Option<u64>,
    /// The end of a reset that is under way, s.
    reset_until_s: Option<f64>,
    /// The time of the last address byte, s.
    time_s: f64,
    /// Fraction by which its own oscillator is too fast.
    pub oscillator_error: f64,
    in_transaction: bool,
    /// Bytes of this transaction so far, addresses included.
    byte: u8,
    scl: bool,
    /// Counts since the start.
    pub count: BusCount,
}

impl Mpu6050 {
    /// Returns a part that has just got power.
    pub fn new(id: u8, source: Source) -> Self {
        let oscillator_error = source.part.errors.sample_clock_error;
        let mut part = Self {
            registers: [0; 128],
            id,
            source,
            faults: Faults::default(),
            phase: Phase::Unselected,
            pointer: 0,
            sample: None,
            reset_until_s: None,
            time_s: 0.0,
            oscillator_error,
            in_transaction: false,
            byte: 0,
            scl: true,
            count: BusCount::default(),
        };
        part.power_up();
        part
    }

    /// Changes a register behind the program's back.
    pub fn set_register_behind(&mut self, address: u8, value: u8) {
        self.registers[usize::from(address & 0x7F)] = value;
        self.count.faults += 1;
    }

    /// Adds a fault.
    pub fn inject(&mut self, fault: Fault) {
        if fault == Fault::Glitch {
            self.power_up();
            self.count.faults += 1;
        } else {
            self.faults.add(fault);
        }
    }

    /// Ends all faults. Their effects on the registers stay.
    pub fn clear_faults(&mut self) {
        self.faults = Faults::default();
    }

    /// Returns whether the part keeps SDA low.
    pub fn holds_sda(&self) -> bool {
        self.faults.holds_sda()
    }

    /// Takes an address byte after a START, at a time in s.
    pub fn address(&mut self, time_s: f64, address: u8) -> BusAnswer {
        if !self.in_transaction {
            self.in_transaction = true;
            self.byte = 0;
            self.count.transactions += 1;
            self.faults.silent = false;
        }
        self.phase = Phase::Unselected;
        self.time_s = time_s;
        if self.reset_until_s.is_some_and(|end| time_s >= end) {
            self.reset_until_s = None;
            self.registers[usize::from(register::PWR_MGMT_1)] &= !DEVICE_RESET;
        }
        if let Some(answer) = self.strike(false) {
            return answer;
        }
        if address >> 1 != ADDRESS {
            return BusAnswer::Nack;
        }
        self.phase = if address & 1 == 0 { Phase::Pointer } else { Phase::Reading };
        if self.phase == Phase::Reading {
            self.count.bursts += u64::from(self.pointer == register::ACCEL_XOUT_H);
            // The part copies a sample into its registers only while the bus is idle, so that a burst is of one sample.
            self.take_sample(time_s);
        }
        BusAnswer::Ack
    }

    /// Takes a byte from the master.
    pub fn write(&mut self, byte: u8) -> BusAnswer {
        if let Some(answer) = self.strike(false) {
            return answer;
        }
        match self.phase {
            Phase::Pointer => {
                self.pointer = byte & 0x7F;
                self.phase = Phase::Writing;
            }
            Phase::Writing => {
                self.set_register(self.pointer, byte);
                self.advance_pointer();
            }
            Phase::Unselected | Phase::Reading => return BusAnswer::Nack,
        }
        BusAnswer::Ack
    }

    /// Returns a byte to the master; `None` while SDA is held low. A silent bus reads as ones.
    pub fn read(&mut self) -> Option<u8> {
        match self.strike(true) {
            Some(BusAnswer::Held) => return None,
            Some(_) => self.phase = Phase::Unselected,
            None => {}
        }
        if self.phase != Phase::Reading {
            return Some(0xFF);
        }
        let value = self.registers[usize::from(self.pointer)];
        if self.pointer == register::INT_STATUS {
            self.registers[usize::from(register::INT_STATUS)] = 0;
        }
        self.advance_pointer();
        Some(value)
    }

    /// Takes a STOP.
    pub fn stop(&mut self) {
        self.in_transaction = false;
        self.phase = Phase::Unselected;
    }

    /// Takes a change of the lines by the master. Returns whether the part releases SDA.
    pub fn lines(&mut self, scl: bool) -> bool {
        if scl && !self.scl {
            self.faults.clock();
        }
        self.scl = scl;
        !self.holds_sda()
    }

    /// Counts a byte of the transaction. Returns the reply of a faulty part, if a fault strikes this byte.
    fn strike(&mut self, sends: bool) -> Option<BusAnswer> {
        let byte = self.byte;
        self.byte = self.byte.saturating_add(1);
        let before = self.faults.struck;
        let answer = self.faults.strike(self.count.transactions, byte, sends);
        self.count.faults += self.faults.struck - before;
        if self.faults.take_glitch() {
            self.power_up();
            self.phase = Phase::Unselected;
            return Some(BusAnswer::Nack);
        }
        answer
    }

    fn power_up(&mut self) {
        self.registers = [0; 128];
        self.registers[usize::from(register::PWR_MGMT_1)] = SLEEP;
        self.registers[usize::from(register::WHO_AM_I)] = self.id;
        self.sample = None;
        self.reset_until_s = None;
    }

    fn set_register(&mut self, address: u8, value: u8) {
        match address {
            _ if self.reset_until_s.is_some() => {}
            register::PWR_MGMT_1 if value & DEVICE_RESET != 0 => {
                self.power_up();
                self.count.resets += 1;
                self.registers[usize::from(register::PWR_MGMT_1)] |= DEVICE_RESET;
                self.reset_until_s = Some(self.time_s + RESET_S);
            }
            register::INT_STATUS..=register::GYRO_ZOUT_L | register::WHO_AM_I => {}
            _ => self.registers[usize::from(address)] = value,
        }
    }

    fn advance_pointer(&mut self) {
        self.pointer = (self.pointer + 1) & 0x7F;
    }

    /// Returns a register's value, without the effects of reading it.
    pub fn register(&self, address: u8) -> u8 {
        self.registers[usize::from(address & 0x7F)]
    }

    /// Returns the samples per second that the registers set.
    fn sample_rate_hz(&self) -> f64 {
        let is_unfiltered = matches!(self.register(register::CONFIG) & 7, 0 | 7);
        let rate_hz = if is_unfiltered { scale::RATE_UNFILTERED_HZ } else { scale::RATE_FILTERED_HZ };
        rate_hz / (1.0 + f64::from(self.register(register::SMPLRT_DIV))) * (1.0 + self.oscillator_error)
    }

    /// Puts the newest sample into the data registers.
    fn take_sample(&mut self, time_s: f64) {
        let is_asleep = self.register(register::PWR_MGMT_1) & (SLEEP | DEVICE_RESET) != 0;
        if is_asleep || self.faults.data == Data::Frozen {
            return;
        }
        let rate_hz = self.sample_rate_hz();
        let number = (time_s * rate_hz) as u64;
        if self.sample == Some(number) {
            return;
        }
        self.sample = Some(number);
        if self.faults.data != Data::Repeated {
            self.set_data(number as f64 / rate_hz);
        }
        // Only an enabled interrupt is generated, and the bit shows it (section 4.21).
        self.registers[usize::from(register::INT_STATUS)] |= self.register(register::INT_ENABLE) & DATA_RDY;
    }

    /// Puts the sample of this time into the data registers.
    fn set_data(&mut self, time_s: f64) {
        let gyro_range = scale::GYRO[usize::from(self.register(register::GYRO_CONFIG) >> 3 & 3)];
        let accel_range = scale::ACCEL[usize::from(self.register(register::ACCEL_CONFIG) >> 3 & 3)];
        let low_pass = scale::LOW_PASS[usize::from(self.register(register::CONFIG) & 7)];
        let Readout { accel, gyro, temperature } = self.source.read(time_s, gyro_range, accel_range, low_pass);
        let gyro = if self.faults.data == Data::GyroZero { [0; 3] } else { gyro };
        let words = accel.into_iter().chain([temperature]).chain(gyro);
        let first = usize::from(register::ACCEL_XOUT_H);
        for (slot, byte) in self.registers[first..].iter_mut().zip(words.flat_map(i16::to_be_bytes)) {
            *slot = byte;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::fault::At;

    fn write(part: &mut Mpu6050, address: u8, value: u8) {
        assert_eq!(part.address(0.0, ADDRESS << 1), BusAnswer::Ack);
        assert_eq!(part.write(address), BusAnswer::Ack);
        assert_eq!(part.write(value), BusAnswer::Ack);
        part.stop();
    }

    fn read<const N: usize>(part: &mut Mpu6050, time_s: f64, address: u8) -> [u8; N] {
        part.address(time_s, ADDRESS << 1);
        part.write(address);
        part.address(time_s, ADDRESS << 1 | 1);
        let bytes = std::array::from_fn(|_| part.read().unwrap());
        part.stop();
        bytes
    }

    fn part() -> Mpu6050 {
        Mpu6050::new(GENUINE_ID, Source::still(1))
    }

    #[test]
    fn it_sleeps_until_woken_and_again_after_a_reset() {
        let mut part = part();
        assert_eq!(read(&mut part, 0.0, 0x75), [0x68]);
        assert_eq!(read(&mut part, 0.0, 0x6B), [0x40]);
        assert_eq!(read::<14>(&mut part, 0.01, 0x3B), [0; 14]);
        write(&mut part, 0x6B, 0x01);
        assert_ne!(read::<14>(&mut part, 0.02, 0x3B), [0; 14]);
        write(&mut part, 0x6B, 0x80);
        write(&mut part, 0x1B, 0x18);
        assert_eq!(read(&mut part, 0.019, 0x6B), [0xC0], "a reset takes its time");
        assert_eq!(read(&mut part, 0.021, 0x6B), [0x40]);
        assert_eq!(read(&mut part, 0.021, 0x1B), [0], "written during the reset");
    }

    #[test]
    fn data_ready_is_said_once_and_only_when_enabled() {
        let mut part = part();
        write(&mut part, 0x6B, 0x01);
        assert_eq!(read(&mut part, 0.01, 0x3A), [0]);
        write(&mut part, 0x38, 0x01);
        assert_eq!(read(&mut part, 0.02, 0x3A), [1]);
        assert_eq!(read(&mut part, 0.02, 0x3A), [0]);
        part.inject(Fault::Data(Data::Frozen));
        assert_eq!(read(&mut part, 0.03, 0x3A), [0]);
        let data = read::<14>(&mut part, 0.04, 0x3B);
        part.inject(Fault::Data(Data::Repeated));
        assert_eq!(read(&mut part, 0.05, 0x3A), [1]);
        assert_eq!(read(&mut part, 0.05, 0x3B), data);
        part.inject(Fault::Data(Data::GyroZero));
        assert_eq!(read(&mut part, 0.06, 0x3A), [1]);
        let changed = read::<14>(&mut part, 0.06, 0x3B);
        assert!(changed[..8] != data[..8] && changed[8..] == [0; 6], "{changed:?}");
    }

    #[test]
    fn a_sample_lasts_as_long_as_the_divider_says() {
        let mut part = part();
        write(&mut part, 0x6B, 0x01);
        write(&mut part, 0x1A, 3);
        write(&mut part, 0x19, 4);
        // 200 Hz.
        let first = read::<14>(&mut part, 0.00501, 0x3B);
        assert_eq!(read::<14>(&mut part, 0.00999, 0x3B), first);
        assert_ne!(read::<14>(&mut part, 0.01001, 0x3B), first);
        part.oscillator_error = -0.01;
        let slow = read::<14>(&mut part, 0.0202, 0x3B);
        assert_ne!(slow, read::<14>(&mut part, 0.02021, 0x3B), "the fourth sample begins after 20.202 ms");
    }

    #[test]
    fn gravity_scales_with_the_range() {
        let mut part = part();
        write(&mut part, 0x6B, 0x01);
        let z = |bytes: [u8; 2]| f64::from(i16::from_be_bytes(bytes));
        let at_2g = z(read(&mut part, 0.01, 0x3F));
        write(&mut part, 0x1C, 0x10);
        let at_8g = z(read(&mut part, 0.02, 0x3F));
        assert!((at_2g / at_8g - 4.0).abs() < 0.3, "{at_2g} {at_8g}");
    }

    #[test]
    fn a_nack_strikes_its_byte_only() {
        let mut part = part();
        part.inject(Fault::Nack { at: At::byte(1), count: 1 });
        assert_eq!(part.address(0.0, 0xD0), BusAnswer::Ack);
        assert_eq!(part.write(0x3B), BusAnswer::Nack);
        part.stop();
        assert_eq!(read(&mut part, 0.0, 0x75), [0x68]);
        assert_eq!(part.count.faults, 1);
    }

    #[test]
    fn clocks_free_a_stuck_line() {
        let mut part = part();
        part.inject(Fault::Stuck { at: At::now(), clocks: Some(3) });
        assert_eq!(part.address(0.0, 0xD0), BusAnswer::Held);
        for pulse in 0..3 {
            assert!(part.holds_sda(), "freed after {pulse} pulses");
            part.lines(false);
            part.lines(true);
        }
        assert!(!part.holds_sda());
    }
}
