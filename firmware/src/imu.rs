//! The MPU6050: set-up, one reading per tick, and its failures.
//!
//! Registers: InvenSense's register map RM-MPU-6000A-00. A reading is one burst from INT_STATUS, so that its seven
//! values belong to one sample and its DATA_RDY says whether that sample is new; the byte after them is a check. Values
//! are counts, sensor axes.
//!
//! Every 20 ms the configuration is read back. A loss of supply also clears INT_ENABLE, so that no sample
//! after it counts as new; if only a range changes, up to three samples are used with the wrong range, which matters
//! less than the 0.2 s of the set-up that follows. A check in every tick would cost 3 % of it.
//!
//! The sensor's oscillator and the tick differ by up to a few percent. A slower sensor now and then has no new sample in a
//! tick, and a faster one replaces a sample before it is read; neither is an error. A sample that arrives after the START
//! of a burst and before INT_STATUS is read loses its flag: the sample before it is used twice, and the new one is not
//! used.
//!
//! Nothing here waits: set-up takes one step per tick, and a failed transaction is repeated in the next tick. Failures are
//! counted; they become a fault after [`FAULT_AFTER_TICKS`] without a good reading:
//!
//! | failure | reaction |
//! | --- | --- |
//! | a transaction fails, or the sensor falls silent within one | repeat in the next tick; then [`Fault::ImuSilent`] or [`Fault::ImuBusStuck`] |
//! | the configuration is not what was written, or the sensor sleeps | set it up again; then, or if it occurs three times within 3 s, [`Fault::ImuLostConfig`] |
//! | no new sample for [`FROZEN_TICKS`], though it is set up | [`Fault::ImuFrozen`], and set it up again |
//! | readings that no working sensor makes | not used; after [`LIFELESS_READINGS`] treated as no new samples |
//! | WHO_AM_I is not 0x68 | a clone: used, and reported in the handshake |

use core::slice;

use embedded_hal::i2c::{ErrorKind, I2c};
use embedded_hal_compat::{Reverse, ReverseCompat};
use mpu6050::device::{self, WHOAMI};
use mpu6050::{Mpu6050, Mpu6050Error};
use protocol::units::{AccelRange, GyroRange, SensorCounts, TemperatureCounts};
use protocol::{Fault, Settings};

/// Ticks without a good reading that make a fault: more than a set-up takes, so that a short loss of the sensor's
/// supply does not end a trial.
pub const FAULT_AFTER_TICKS: u8 = 40;

/// Ticks without a new sample until the sensor is set up again; they are a fault if it was not asleep.
pub const FROZEN_TICKS: u8 = 20;

/// Number of readings in a row, each equal to the one before or with zero on all axes of the gyroscope, that make a
/// fault: 200 ms. A sensor has noise: none of the 65,067 readings of `tests/data/mpu6050/still-655s.csv` is of either
/// kind.
pub const LIFELESS_READINGS: u8 = 40;

/// Number of equal readings in a row that are used: a sensor at rest in its widest range and with its slowest filter
/// makes some.
const MAX_REPEATS: u8 = 4;

/// A loss of the configuration adds this to [`Imu::losses`], and each good reading subtracts 1: 3 s. The third of them
/// within 3 s of readings is a fault.
const LOSS: u16 = 3 * protocol::TICK_HZ as u16;

/// Readings between two checks of the configuration, that is, 20 ms.
const CHECK_INTERVAL: u8 = 4;

/// Addresses of registers that the crate `mpu6050` does not name.
mod register {
    /// Followed by CONFIG, GYRO_CONFIG and ACCEL_CONFIG.
    pub const SMPLRT_DIV: u8 = 0x19;
    pub const INT_ENABLE: u8 = 0x38;
    /// Followed by the sample, and by EXT_SENS_DATA_00.
    pub const INT_STATUS: u8 = 0x3A;
}

/// The ticks of a set-up that have a step.
mod tick {
    /// Reads WHO_AM_I.
    pub const IDENTIFY: u8 = 0;
    /// Resets every register.
    pub const RESET: u8 = 1;
    /// Wakes the sensor: 100 ms later, as the register map says.
    pub const WAKE: u8 = RESET + 20;
    /// Writes the configuration, a register a tick.
    pub const CONFIGURE: u8 = WAKE + 1;
    /// Sets the low-pass filter of a clone's accelerometer.
    pub const FILTER: u8 = CONFIGURE + 4;
    /// Enables DATA_RDY.
    pub const ENABLE: u8 = CONFIGURE + 5;
    /// Reads the first sample: 55 ms after waking; the data sheet asks for 30 ms for the gyroscope. Set-up is over.
    pub const SAMPLE: u8 = WAKE + 11;
}

/// Resets every register: DEVICE_RESET.
const RESETTING: [u8; 2] = [device::PWR_MGMT_1::ADDR, 0x80];

/// Awake, everything on, clock from the x gyroscope, which is steadier than the internal oscillator.
const WAKING: [u8; 2] = [device::PWR_MGMT_1::ADDR, 0x01];

/// WHO_AM_I of an MPU6050.
const GENUINE: u8 = 0x68;

/// The low-pass filter of the accelerometer in MPU6500 (0x70), MPU9250 (0x71) and ICM-20689 (0x98), which are sold as clones:
/// their CONFIG is for the gyroscope alone. The bandwidths are those of CONFIG, with 218 Hz in place of 184. An MPU6050
/// has no register there.
const ACCEL_CONFIG_2: u8 = 0x1D;

/// Makes the sensor set DATA_RDY with each sample.
const ENABLING: [u8; 2] = [register::INT_ENABLE, DATA_RDY];

/// In INT_ENABLE and INT_STATUS. Reading INT_STATUS clears it there.
const DATA_RDY: u8 = 0x01;

/// SMPLRT_DIV: all 1000 samples per second. The sensor's oscillator may be off by 1 %. At 200 samples per second, some
/// would be read twice or never, as often as a robot swings: at (-90, 90) rpm, with an oscillator that is off by 0.75
/// %, the yaw drifted by 0.073 °/s. The age of a sample remains, 1 ms at most: a drift of 0.012 °/s there, if the
/// oscillator is off by 0.15 %.
const DIVIDER: u8 = 0;

/// The bus reads this while no device drives it. The register after the sample, EXT_SENS_DATA_00, is zero. Reading it
/// as well shows whether the sensor sent to the end, because a sender acknowledges nothing.
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

impl Config {
    /// Returns the address of SMPLRT_DIV and the values of the registers from there on.
    #[inline(never)]
    fn bytes(self) -> [u8; 5] {
        [register::SMPLRT_DIV, DIVIDER, self.low_pass, (self.gyro_range as u8) << 3, (self.accel_range as u8) << 3]
    }
}

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

/// The sensor on its bus. Its set-up is our own, because `Mpu6050::init` waits, checks nothing, and refuses clones.
pub struct Imu<I2C> {
    sensor: Mpu6050<Reverse<I2C>>,
    config: Config,
    /// One of [`tick`], or between two of them.
    tick: u8,
    id: u8,
    /// Readings until the next check of the configuration.
    unchecked: u8,
    /// INT_STATUS, the last sample, and the byte after it.
    burst: [u8; 16],
    /// Weighted sum of the bytes of the last sample: it changes with the sensor's noise from sample to sample.
    sum: u8,
    /// Readings in a row that no working sensor makes, up to [`LIFELESS_READINGS`].
    lifeless: u8,
    /// Ticks since the last good reading.
    silence: u8,
    /// Rises by [`LOSS`] with each loss of the configuration.
    losses: u16,
    fault: Fault,
    errors: u16,
}

impl<I2C: I2c> Imu<I2C> {
    /// Returns a sensor that is not yet set up.
    pub fn new(bus: I2C) -> Self {
        Self {
            sensor: Mpu6050::new(bus.reverse()),
            config: Config::from(&Settings::DEFAULT),
            tick: 0,
            id: 0,
            unchecked: 0,
            burst: [0; 16],
            sum: 0,
            lifeless: 0,
            silence: 0,
            losses: 0,
            fault: Fault::None,
            errors: 0,
        }
    }

    /// Sets the configuration; the sensor is set up again if it differs.
    pub fn configure(&mut self, config: Config) {
        if self.config != config {
            self.config = config;
            self.tick = 0;
        }
    }

    /// Does one tick's work: reads a sample, or takes a step of set-up; the first one reads [`Imu::id`]. Returns whether
    /// there is a new [`Imu::reading`].
    #[inline(never)]
    pub fn poll(&mut self) -> bool {
        self.silence = self.silence.saturating_add(1);
        match self.step() {
            Ok(true) => {
                self.silence = 0;
                self.losses = self.losses.saturating_sub(1);
                self.fault = Fault::None;
                return true;
            }
            Ok(false) => {}
            Err(error) => self.handle_error(error),
        }
        false
    }

    /// Returns the sample, after [`Imu::poll`] has returned `true`.
    #[inline(never)]
    pub fn reading(&self) -> Reading {
        let [_, sample @ .., _] = &self.burst;
        let word = |place: usize| i16::from_be_bytes([sample[2 * place], sample[2 * place + 1]]);
        Reading {
            accel: [SensorCounts(word(0)), SensorCounts(word(1)), SensorCounts(word(2))],
            temperature: TemperatureCounts(word(3)),
            gyro: [SensorCounts(word(4)), SensorCounts(word(5)), SensorCounts(word(6))],
        }
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

    #[inline(never)]
    fn step(&mut self) -> Result<bool, ReadError> {
        match self.tick {
            tick::IDENTIFY => read(&mut self.sensor, WHOAMI, slice::from_mut(&mut self.id))?,
            tick::RESET => write(&mut self.sensor, RESETTING)?,
            tick::WAKE => write(&mut self.sensor, WAKING)?,
            tick::FILTER if self.id != GENUINE => {
                write(&mut self.sensor, [ACCEL_CONFIG_2, self.config.low_pass])?;
            }
            tick::CONFIGURE..tick::FILTER => {
                let place = self.tick - tick::CONFIGURE;
                let [first, values @ ..] = self.config.bytes();
                write(&mut self.sensor, [first + place, values[usize::from(place % 4)]])?;
            }
            tick::ENABLE => write(&mut self.sensor, ENABLING)?,
            tick::SAMPLE => return self.sample(),
            _ => {}
        }
        self.tick += 1;
        Ok(false)
    }

    /// Returns whether there is a new sample.
    #[inline(never)]
    fn sample(&mut self) -> Result<bool, ReadError> {
        read(&mut self.sensor, register::INT_STATUS, &mut self.burst)?;
        let [status, .., after] = self.burst;
        if after == SILENCE {
            return Err(ReadError::Silent);
        }
        self.check_config()?;
        let is_new = status & DATA_RDY != 0;
        if !is_new && self.silence >= FROZEN_TICKS {
            return Err(self.reason()?);
        }
        Ok(is_new && self.is_alive()?)
    }

    /// Returns whether a new sample is from a working sensor.
    fn is_alive(&mut self) -> Result<bool, ReadError> {
        let [_, sample @ .., _] = &self.burst;
        let [.., a, b, c, d, e, f] = sample;
        let turns = a | b | c | d | e | f != 0;
        // Each byte has its own weight, so that changes by one of a quiet sensor do not cancel each other.
        let sum = sample.iter().fold(0, |sum: u8, byte| sum.wrapping_mul(3).wrapping_add(*byte));
        let is_alive = sum != self.sum && turns;
        self.sum = sum;
        self.lifeless = if is_alive { 0 } else { (self.lifeless + 1).min(LIFELESS_READINGS) };
        if self.lifeless == LIFELESS_READINGS {
            return Err(ReadError::Frozen);
        }
        Ok(turns && self.lifeless <= MAX_REPEATS)
    }

    /// Returns why there are no new samples.
    #[inline(never)]
    fn reason(&mut self) -> Result<ReadError, ReadError> {
        let is_set_up = self.holds(WAKING)? && self.holds(ENABLING)?;
        Ok(if is_set_up { ReadError::Frozen } else { ReadError::LostConfig })
    }

    #[inline(never)]
    fn holds(&mut self, [register, value]: [u8; 2]) -> Result<bool, ReadError> {
        let mut found = 0;
        read(&mut self.sensor, register, slice::from_mut(&mut found))?;
        Ok(found == value)
    }

    fn check_config(&mut self) -> Result<(), ReadError> {
        if self.unchecked > 0 {
            self.unchecked -= 1;
            return Ok(());
        }
        let [first, config @ ..] = self.config.bytes();
        let mut found = [0; 4];
        read(&mut self.sensor, first, &mut found)?;
        if found != config {
            return Err(ReadError::LostConfig);
        }
        self.unchecked = CHECK_INTERVAL - 1;
        Ok(())
    }

    fn handle_error(&mut self, error: ReadError) {
        self.errors = self.errors.wrapping_add(1);
        let is_overdue = self.silence >= FAULT_AFTER_TICKS;
        let is_repeated = match error {
            ReadError::LostConfig => {
                self.losses = self.losses.saturating_add(LOSS);
                self.losses > 2 * LOSS
            }
            error => error == ReadError::Frozen,
        };
        if is_overdue || is_repeated {
            self.fault = match error {
                ReadError::Silent => Fault::ImuSilent,
                ReadError::BusStuck => Fault::ImuBusStuck,
                ReadError::LostConfig => Fault::ImuLostConfig,
                ReadError::Frozen => Fault::ImuFrozen,
            };
        }
        if self.tick < tick::SAMPLE {
            // The sensor may be gone.
            self.id = 0;
        } else if matches!(error, ReadError::Silent | ReadError::BusStuck) && !is_overdue {
            // One failed transaction does not mean that the sensor's registers changed.
            return;
        }
        self.tick = 0;
    }
}

#[inline(never)]
fn read<I2C: I2c>(sensor: &mut Mpu6050<Reverse<I2C>>, register: u8, bytes: &mut [u8]) -> Result<(), ReadError> {
    sensor.read_bytes(register, bytes).map_err(ReadError::from)
}

/// Writes a value to a register.
#[inline(never)]
fn write<I2C: I2c>(sensor: &mut Mpu6050<Reverse<I2C>>, [register, value]: [u8; 2]) -> Result<(), ReadError> {
    sensor.write_byte(register, value).map_err(ReadError::from)
}
