//! The MPU6050: set-up, one reading per tick, and its failures.
//!
//! Registers are those of InvenSense's register map RM-MPU-6000A-00. A reading is one burst of 14 bytes from
//! ACCEL_XOUT_H, so that all seven values belong to one sample, and of one byte more as a check. Values are counts, sensor
//! axes.
//!
//! Nothing here waits: set-up takes one step per tick, and a failed transaction is repeated in the next tick. Failures are
//! counted; they become a fault after [`FAULT_AFTER_TICKS`] without a good reading:
//!
//! | failure | reaction |
//! | --- | --- |
//! | a transaction fails, or the sensor falls silent within one | repeat in the next tick; then [`Fault::ImuSilent`] or [`Fault::ImuBusStuck`] |
//! | all values zero, or another divider of the sample rate (checked once a second) | the sensor lost its supply: set it up again; then [`Fault::ImuFrozen`] |
//! | the same 14 bytes for [`FROZEN_TICKS`] | [`Fault::ImuFrozen`], and set it up again |
//! | WHO_AM_I is not 0x68 | a clone: used, and reported in the handshake |

use embedded_hal::i2c::{ErrorKind, I2c};
use embedded_hal_compat::{Reverse, ReverseCompat};
use mpu6050::device::{self, ACC_REGX_H, WHOAMI};
use mpu6050::{Mpu6050, Mpu6050Error};
use protocol::units::{AccelRange, GyroRange, SensorCounts, TemperatureCounts};
use protocol::{Fault, Settings};

/// Ticks without a good reading until it is a fault: more than a set-up takes, so that a short loss of the sensor's
/// supply does not end a trial.
pub const FAULT_AFTER_TICKS: u8 = 20;

/// Repetitions of the same 14 bytes until the sensor counts as frozen. A working sensor's noise changes every sample; a
/// few repetitions are normal if it samples more slowly than the tick.
pub const FROZEN_TICKS: u8 = 20;

/// Ticks from the last step of set-up to the first reading: 50 ms, where the data sheet says 30 ms for the gyroscope.
const SETTLING_TICKS: u8 = 10;

/// Readings between two checks of the configuration.
const CHECK_INTERVAL: u8 = protocol::TICK_HZ;

/// Divider of the sample rate.
const SMPLRT_DIV: u8 = 0x19;

/// 200 samples per second from 1 kHz.
const DIVIDER: u8 = 4;

/// PWR_MGMT_1: awake, everything on, clock from the x gyroscope, which is steadier than the internal oscillator.
const AWAKE: u8 = 0x01;

/// What the bus reads while no device drives it. The register after the sample, EXT_SENS_DATA_00, is zero, and reading it
/// too shows whether the sensor sent to the end: it acknowledges nothing while it sends.
const SILENCE: u8 = 0xFF;

/// One sample.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Reading {
    /// Accelerometer.
    pub accel: [SensorCounts; 3],
    /// Temperature.
    pub temperature: TemperatureCounts,
    /// Gyroscope.
    pub gyro: [SensorCounts; 3],
}

impl Reading {
    /// Returns whether an axis is at the end of its range.
    pub fn is_clipped(&self) -> bool {
        let is_end = |counts: &SensorCounts| counts.0 == i16::MAX || counts.0 == i16::MIN;
        self.accel.iter().chain(&self.gyro).any(is_end)
    }
}

/// The sensor's configuration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Config {
    /// Range of the gyroscope.
    pub gyro_range: GyroRange,
    /// Range of the accelerometer.
    pub accel_range: AccelRange,
    /// [`Settings::low_pass`].
    pub low_pass: u8,
}

impl From<&Settings> for Config {
    fn from(settings: &Settings) -> Self {
        let Settings { gyro_range, accel_range, low_pass, .. } = *settings;
        Self { gyro_range, accel_range, low_pass }
    }
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    /// The next step of set-up.
    SetUp(u8),
    /// Ticks until the first reading.
    Settling(u8),
    /// Readings until the next check of the configuration.
    Sampling(u8),
}

/// Steps of [`Imu::set_up`].
const STEPS: u8 = 6;

/// Why a reading failed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum ReadError {
    Silent,
    BusStuck,
    LostConfig,
    Frozen,
}

impl<E: embedded_hal::i2c::Error> From<Mpu6050Error<E>> for ReadError {
    fn from(error: Mpu6050Error<E>) -> Self {
        match error {
            Mpu6050Error::I2c(error) if !matches!(error.kind(), ErrorKind::NoAcknowledge(_)) => Self::BusStuck,
            _ => Self::Silent,
        }
    }
}

/// The sensor on its bus.
pub struct Imu<I2C> {
    sensor: Mpu6050<Reverse<I2C>>,
    config: Config,
    phase: Phase,
    id: u8,
    /// The last sample, raw.
    sample: [u8; 14],
    repeats: u8,
    silence: u8,
    fault: Fault,
    errors: u16,
}

impl<I2C: I2c> Imu<I2C> {
    /// Returns a sensor that is not yet set up.
    pub fn new(bus: I2C) -> Self {
        Self {
            sensor: Mpu6050::new(bus.reverse()),
            config: Config::from(&Settings::DEFAULT),
            phase: Phase::SetUp(0),
            id: 0,
            sample: [0; 14],
            repeats: 0,
            silence: 0,
            fault: Fault::None,
            errors: 0,
        }
    }

    /// Sets the configuration; the sensor is set up again if it differs.
    pub fn configure(&mut self, config: Config) {
        if self.config != config {
            self.config = config;
            self.phase = Phase::SetUp(0);
        }
    }

    /// Takes all steps of set-up at once; if one fails, [`Imu::poll`] continues.
    pub fn set_up_now(&mut self) {
        for _ in 0..STEPS {
            self.poll();
        }
    }

    /// Does one tick's work: reads a sample, or takes a step of set-up. Returns whether there is a new [`Imu::reading`].
    #[inline(never)]
    pub fn poll(&mut self) -> bool {
        let outcome = match self.phase {
            Phase::SetUp(step) => self.set_up(step),
            Phase::Settling(ticks) => {
                self.phase = if ticks > 1 { Phase::Settling(ticks - 1) } else { Phase::Sampling(CHECK_INTERVAL) };
                Ok(false)
            }
            Phase::Sampling(checked) => self.sample(checked),
        };
        self.silence = self.silence.saturating_add(1);
        match outcome {
            Ok(true) => {
                self.silence = 0;
                self.fault = Fault::None;
                return true;
            }
            Ok(false) => {}
            Err(error) => self.handle_error(error),
        }
        false
    }

    /// Returns the last sample.
    #[inline(never)]
    pub fn reading(&self) -> Reading {
        Reading { accel: self.triple(0), temperature: TemperatureCounts(self.word(6)), gyro: self.triple(8) }
    }

    #[inline(never)]
    fn triple(&self, place: usize) -> [SensorCounts; 3] {
        [0, 2, 4].map(|offset| SensorCounts(self.word(place + offset)))
    }

    fn word(&self, place: usize) -> i16 {
        i16::from_be_bytes([self.sample[place], self.sample[place + 1]])
    }

    /// Returns WHO_AM_I; 0 if no sensor answered.
    pub fn id(&self) -> u8 {
        self.id
    }

    /// Returns the present fault.
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// Returns the number of failures since the start.
    pub fn errors(&self) -> u16 {
        self.errors
    }

    /// Takes one step of set-up. `Mpu6050::init` does the same in one call, but waits 100 ms and refuses clones.
    #[inline(never)]
    fn set_up(&mut self, step: u8) -> Result<bool, ReadError> {
        let Config { gyro_range, accel_range, low_pass } = self.config;
        let (register, value) = match step {
            0 => (device::PWR_MGMT_1::ADDR, AWAKE),
            1 => (device::ACCEL_CONFIG::ADDR, (accel_range as u8) << 3),
            2 => (device::GYRO_CONFIG::ADDR, (gyro_range as u8) << 3),
            3 => (device::CONFIG::ADDR, low_pass),
            4 => (SMPLRT_DIV, DIVIDER),
            _ => {
                self.id = self.sensor.read_byte(WHOAMI)?;
                self.phase = Phase::Settling(SETTLING_TICKS);
                return Ok(false);
            }
        };
        self.sensor.write_byte(register, value)?;
        self.phase = Phase::SetUp(step + 1);
        Ok(false)
    }

    #[inline(never)]
    fn sample(&mut self, checked: u8) -> Result<bool, ReadError> {
        // A loss of supply clears the whole configuration; the divider is the part of it that is never zero.
        if checked == 0 && self.sensor.read_byte(SMPLRT_DIV)? != DIVIDER {
            return Err(ReadError::LostConfig);
        }
        self.phase = Phase::Sampling(if checked == 0 { CHECK_INTERVAL } else { checked - 1 });
        let mut bytes = [0; 15];
        self.sensor.read_bytes(ACC_REGX_H, &mut bytes)?;
        let [sample @ .., after] = &bytes;
        if *after == SILENCE {
            return Err(ReadError::Silent);
        }
        // Accelerometer and gyroscope never read exactly zero on six axes: these are the registers of a sleeping sensor.
        if sample.iter().all(|byte| *byte == 0) {
            return Err(ReadError::LostConfig);
        }
        self.repeats = if *sample == self.sample { self.repeats.saturating_add(1) } else { 0 };
        self.sample = *sample;
        if self.repeats >= FROZEN_TICKS { Err(ReadError::Frozen) } else { Ok(true) }
    }

    fn handle_error(&mut self, error: ReadError) {
        self.errors = self.errors.wrapping_add(1);
        let is_overdue = self.silence >= FAULT_AFTER_TICKS;
        if is_overdue || error == ReadError::Frozen {
            self.fault = match error {
                ReadError::Silent => Fault::ImuSilent,
                ReadError::BusStuck => Fault::ImuBusStuck,
                ReadError::LostConfig | ReadError::Frozen => Fault::ImuFrozen,
            };
        }
        match self.phase {
            // The sensor may be gone.
            Phase::SetUp(_) => self.id = 0,
            // One failed transaction does not mean that the sensor's registers changed.
            _ if matches!(error, ReadError::Silent | ReadError::BusStuck) && !is_overdue => return,
            _ => {}
        }
        self.phase = Phase::SetUp(0);
    }
}
