//! Replies from the board to the host.

use crate::fault::FaultRecord;
use crate::settings::Settings;
use crate::units::{AccelRange, EncoderCounts, GyroRange, Micros};
use serde::{Deserialize, Serialize};
use serde_repr::{Deserialize_repr, Serialize_repr};
#[cfg(target_arch = "avr")]
use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes};

/// The board's answers.
#[cfg_attr(not(target_arch = "avr"), derive(Deserialize))]
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub enum Reply {
    /// To [`Command::Hello`](crate::Command::Hello).
    Info(Info),
    /// Done, or begun if the command takes time.
    Done,
    /// The command was not carried out.
    Refused(Refusal),
    /// To [`Command::ReadSettings`](crate::Command::ReadSettings).
    Settings(Settings),
    /// To [`Command::ReadCalibration`](crate::Command::ReadCalibration).
    Calibration(Calibration),
    /// To [`Command::Ping`](crate::Command::Ping): the board's clock when it read the request. To
    /// [`Command::ReadNote`](crate::Command::ReadNote): the bytes, as a little-endian number.
    Pong(Micros),
    /// To [`Command::ReadFault`](crate::Command::ReadFault); [`Fault::None`](crate::Fault::None) in an empty entry.
    FaultRecord(FaultRecord),
}

/// Why a command was not carried out.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Refusal {
    /// A value is outside of its range.
    OutOfRange,
    /// A fault is latched; see the telemetry for which one.
    Faulted,
    /// The motors are turning.
    Running,
    /// A calibration is running.
    Calibrating,
    /// The EEPROM does not hold the bytes written to it.
    EepromFailed,
    /// The set-points are not a schedule, or it would start in the past.
    NotASchedule,
    /// The motors have no encoders.
    NoEncoders,
}

/// Identity of the board.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[cfg_attr(target_arch = "avr", repr(C), serde(remote = "Self"))]
pub struct Info {
    /// [`VERSION`](crate::VERSION) of the firmware. Always the first field.
    pub protocol: u8,
    /// [`SCHEMA`](crate::SCHEMA) of the firmware.
    pub schema: [u8; 4],
    /// Version of the firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// The first four bytes of the commit that the firmware was built from; zero if it was not known.
    pub git_hash: [u8; 4],
    /// Whether the working tree had uncommitted changes.
    pub git_dirty: bool,
    /// [`Settings::board_id`].
    #[serde(with = "crate::fixed::u16")]
    pub board_id: u16,
    /// The sensor's WHO_AM_I register: 0x68 for a genuine MPU6050, 0 if no sensor answered.
    pub imu_id: u8,
    /// Range of the gyroscope.
    pub gyro_range: GyroRange,
    /// Range of the accelerometer.
    pub accel_range: AccelRange,
    /// Whether the settings are from EEPROM; otherwise they are the defaults.
    pub settings_stored: bool,
    /// Why the program started.
    pub reset_cause: ResetCause,
    /// Number of starts of the program since the EEPROM was blank.
    #[serde(with = "crate::fixed::u16")]
    pub boot_count: u16,
    /// Whether the flagella's positions count from their marks: since [`Command::Align`](crate::Command::Align) every
    /// motion was counted, over resets and loss of power.
    pub angles_known: bool,
    /// [`Telemetry::encoder`](crate::Telemetry::encoder).
    pub encoder: [EncoderCounts; 2],
    /// Bytes of memory that neither data nor stack have reached since the start.
    #[serde(with = "crate::fixed::u16")]
    pub ram_left: u16,
}

/// WHO_AM_I of a genuine MPU6050.
pub const GENUINE_IMU_ID: u8 = 0x68;

/// Why the program started.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[repr(u8)]
pub enum ResetCause {
    /// Not known: the bootloader cleared the flags.
    #[default]
    Unknown,
    /// Power came on.
    PowerOn,
    /// The reset pin: the host opened the port, or the button.
    External,
    /// The supply fell below 2.7 V.
    BrownOut,
    /// The watchdog's hardware.
    Watchdog,
    /// The program hung; its watchdog interrupt stopped the motors and restarted it.
    Hang,
    /// The program panicked, stopped the motors and restarted itself. See [`Fault::Panic`](crate::Fault::Panic).
    Panic,
}

/// Result of a calibration of the gyroscope.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug, Default)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[cfg_attr(target_arch = "avr", repr(C), serde(remote = "Self"))]
pub struct Calibration {
    /// Whether the sensor was still throughout; if not, the bias in force is unchanged.
    pub still: bool,
    /// Mean reading, counts, sensor axes.
    pub bias: [f32; 3],
    /// Standard deviation of the readings, counts, largest axis; saturates at 65535.
    #[serde(with = "crate::fixed::u16")]
    pub noise: u16,
    /// Number of averaged readings.
    #[serde(with = "crate::fixed::u16")]
    pub samples: u16,
}
