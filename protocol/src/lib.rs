//! The protocol between the robot's Arduino Nano and the host.
//!
//! # Messages
//!
//! The host sends [`Request`]s, each with a [`Command`]; the board answers every request with one [`Reply`] and streams
//! [`Telemetry`] on its own. Bytes on the wire, with framing ([`frame`]):
//!
//! | host to board | bytes | board answers | bytes |
//! | --- | --- | --- | --- |
//! | [`Command::Hello`] | 6 | [`Reply::Info`] | 29 |
//! | [`Command::SetSpeeds`] | 10 | [`Reply::Done`] | 7 |
//! | [`Command::Stop`] | 6 | [`Reply::Done`] | 7 |
//! | [`Command::Stream`] | 7 | [`Reply::Done`] | 7 |
//! | [`Command::CalibrateGyro`] | 8 | [`Reply::Done`] at once, the result later | 7 |
//! | [`Command::ReadCalibration`] | 6 | [`Reply::Calibration`] | 24 |
//! | [`Command::ReadSettings`] | 6 | [`Reply::Settings`] | 60 |
//! | [`Command::WriteSettings`] | 59 | [`Reply::Done`] | 7 |
//! | [`Command::SaveSettings`] | 6 | [`Reply::Done`] | 7 |
//! | [`Command::Ping`] | 6 | [`Reply::Pong`] | 11 |
//! | [`Command::ClearFault`] | 6 | [`Reply::Done`] | 7 |
//! | [`Command::SetPoint`] | 16 | [`Reply::Done`] | 7 |
//! | [`Command::StartSchedule`] | 11 | [`Reply::Done`] | 7 |
//! | [`Command::Drive`] | 12 | [`Reply::Done`] | 7 |
//! | [`Command::ReadFault`] | 7 | [`Reply::FaultRecord`] | 24 |
//! | any, refused | | [`Reply::Refused`] | 8 |
//! | | | [`Telemetry`], streamed | 71 |
//!
//! # Rules
//!
//! - A trial is a schedule: the host sends its set-points ([`Command::SetPoint`]) and starts it
//!   ([`Command::StartSchedule`]); the board changes the speeds at the ticks of the schedule, reports its phases in the
//!   telemetry, and stops the motors by itself at the end.
//! - The line runs at [`BAUD`], 8N1. Opening the port resets a Nano; its bootloader answers for up to two seconds.
//! - Every intact frame from the host feeds the motors' deadline ([`Settings::deadline_ms`]). Past it, if a motor turns or
//!   will turn in the schedule, the board stops both motors and latches [`Fault::LinkLost`].
//! - The board carries out a request only if the answer fits into its outbox. It drops other requests whole; they still feed
//!   the deadline.
//! - Every request is idempotent. A request with the sequence number of the one before gets the same answer again, without
//!   a second effect, so a host that received no answer may repeat the request.
//! - A fault stops the motors, is in every telemetry frame, and lasts until [`Command::ClearFault`].
//! - The first bytes of a handshake never change (see [`Message`]), so that the two sides learn each other's version even
//!   if it differs.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod fixed;
pub mod frame;
pub mod units;

use serde::{Deserialize, Serialize};
use serde_repr::{Deserialize_repr, Serialize_repr};
use units::{
    AccelRange, AxisMap, CentiRpm, Count, Duty, EncoderCounts, GyroRange, Micros, Millivolts, Quaternion, SensorCounts,
    TemperatureCounts,
};

/// Version of this protocol. It rises with every change of the bytes on the wire, which the tests' golden file reveals.
pub const VERSION: u8 = 2;

/// The first four bytes of the SHA-256 of the formats of all messages (`tests/wire/schema.txt`). Both sides compare it in
/// the handshake, because two builds of one version can differ while the protocol is being changed.
pub const SCHEMA: [u8; 4] = [0x03, 0x37, 0xfc, 0xf6];

/// Speed of the line, bit/s: exact with the Nano's 16 MHz crystal.
pub const BAUD: u32 = 500_000;

/// Ticks of the board's control loop per second; the highest rate of telemetry.
pub const TICK_HZ: u8 = 200;

/// A command with a number, which its answer repeats.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct Request {
    /// Differs from the number of the request before, unless this repeats it.
    pub seq: u8,
    /// The command.
    pub command: Command,
}

/// The requests of the host.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub enum Command {
    /// Handshake: asks for [`Info`]. Always the first variant, encoded as the byte 0.
    Hello,
    /// Turn flagella 1 and 2 at these speeds, each within [`CentiRpm::LIMIT`].
    SetSpeeds([CentiRpm; 2]),
    /// Motors off. Always accepted.
    Stop,
    /// Stream telemetry at a rate that divides [`TICK_HZ`]; 0 ends the stream.
    Stream {
        /// Frames per second.
        rate_hz: u8,
    },
    /// Average the gyroscope at rest and use the mean as its bias. Motors must be off.
    CalibrateGyro {
        /// 100 to 60000.
        #[serde(with = "fixed::u16")]
        duration_ms: u16,
    },
    /// Read the result of the last calibration.
    ReadCalibration,
    /// Read the settings in force.
    ReadSettings,
    /// Use these settings until the next reset. Motors must be off.
    WriteSettings(Settings),
    /// Save the settings in force to EEPROM.
    SaveSettings,
    /// Read the board's clock.
    Ping,
    /// Clear the latched fault. Refused while its cause lasts.
    ClearFault,
    /// Store one set-point of the schedule. Refused while a schedule runs.
    SetPoint {
        /// 0 to [`MAX_SET_POINTS`] - 1.
        index: u8,
        /// The set-point.
        point: SetPoint,
    },
    /// Run the first `count` set-points. Their ticks must increase, and the last one must have both motors off.
    StartSchedule {
        /// 1 to [`MAX_SET_POINTS`].
        count: u8,
        /// The board's clock at tick 0 of the schedule, in the next 10 minutes. The first tick of the control loop at or
        /// after it is tick 0.
        at: Micros,
    },
    /// Drive the motors open-loop, for the self-test of the wiring; then turn them off. Motors must be off. The board
    /// watches the deadline meanwhile, and not what the encoders say.
    Drive {
        /// Duties of motors 1 and 2.
        duty: [Duty; 2],
        /// 1 to [`MAX_DRIVE_MS`].
        #[serde(with = "fixed::u16")]
        duration_ms: u16,
    },
    /// Read an entry of the fault log.
    ReadFault {
        /// 0 is the latest one; up to [`FAULT_RECORDS`] - 1.
        index: u8,
    },
}

/// Largest number of set-points in a schedule.
pub const MAX_SET_POINTS: u8 = 16;

/// Longest open-loop drive, ms.
pub const MAX_DRIVE_MS: u16 = 2000;

/// Entries of the fault log.
pub const FAULT_RECORDS: u8 = 8;

/// What begins at a tick of a schedule.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SetPoint {
    /// Ticks from the start of the schedule.
    #[serde(with = "fixed::u32")]
    pub tick: u32,
    /// Target speeds of flagella 1 and 2 from then on, each within [`CentiRpm::LIMIT`].
    pub speeds: [CentiRpm; 2],
    /// The number that the telemetry carries from then on; the host chooses it, not 0.
    pub phase: u8,
}

/// The messages of the board.
///
/// An answer to [`Command::Hello`] begins, in every version of this protocol, with the bytes 0 (an answer), the number
/// of the request, 0 (an [`Info`]) and the version.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub enum Message {
    /// The answer to the request numbered `to`.
    Reply {
        /// [`Request::seq`].
        to: u8,
        /// The answer.
        reply: Reply,
    },
    /// A frame of the stream.
    Telemetry(Telemetry),
}

/// A [`Message`] that the sender keeps: the same bytes, without a copy on the board's stack.
#[derive(Serialize, Clone, Copy, Debug)]
pub enum MessageRef<'a> {
    /// [`Message::Reply`]
    Reply {
        /// [`Request::seq`].
        to: u8,
        /// The answer.
        reply: &'a Reply,
    },
    /// [`Message::Telemetry`]
    Telemetry(&'a Telemetry),
}

/// Returns the version in a handshake of any version, or `None` if `payload` is not one. The payload is a frame's content
/// before its CRC.
pub fn version_of(payload: &[u8]) -> Option<u8> {
    match payload {
        [0, _, 0, version, ..] => Some(*version),
        _ => None,
    }
}

/// The board's answers.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub enum Reply {
    /// To [`Command::Hello`].
    Info(Info),
    /// Done; begun, where it takes time.
    Done,
    /// Not done.
    Refused(Refusal),
    /// To [`Command::ReadSettings`].
    Settings(Settings),
    /// To [`Command::ReadCalibration`].
    Calibration(Calibration),
    /// To [`Command::Ping`]: the board's clock when it read the request.
    Pong(Micros),
    /// To [`Command::ReadFault`]; [`Fault::None`] in an empty entry.
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
    /// The EEPROM does not hold what was written to it.
    EepromFailed,
    /// The set-points are not a schedule, or it would start in the past.
    NotASchedule,
}

/// Identity of the board.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Info {
    /// [`VERSION`] of the firmware. Always the first field.
    pub protocol: u8,
    /// [`SCHEMA`] of the firmware.
    pub schema: [u8; 4],
    /// Version of the firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// The first four bytes of the commit that the firmware was built from; zero if it was not known.
    pub git_hash: [u8; 4],
    /// Whether the working tree had uncommitted changes.
    pub git_dirty: bool,
    /// [`Settings::board_id`].
    #[serde(with = "fixed::u16")]
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
    #[serde(with = "fixed::u16")]
    pub boot_count: u16,
}

/// WHO_AM_I of a genuine MPU6050.
pub const GENUINE_IMU_ID: u8 = 0x68;

/// Why the program started.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
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
    /// The program panicked, stopped the motors and restarted itself.
    Panic,
}

/// The board's state.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[repr(u8)]
pub enum State {
    /// Motors off.
    #[default]
    Idle,
    /// Motors off, averaging the gyroscope.
    Calibrating,
    /// Motors under speed control.
    Running,
    /// Motors driven open-loop.
    Driving,
    /// Motors off until the fault is cleared.
    Faulted,
}

/// A fault. The first one stays until it is cleared.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[repr(u8)]
pub enum Fault {
    /// No fault.
    #[default]
    None,
    /// No frame came from the host within the motors' deadline.
    LinkLost,
    /// The program hung and was restarted.
    Hang,
    /// The program panicked and was restarted.
    Panic,
    /// The IMU does not acknowledge.
    ImuSilent,
    /// The IMU's bus is stuck, and clock pulses did not free it.
    ImuBusStuck,
    /// The IMU has no new data.
    ImuFrozen,
    /// The IMU loses its configuration again and again.
    ImuLostConfig,
    /// The board's supply is below [`MIN_SUPPLY_MV`].
    SupplyLow,
    /// Motor 1 has a duty that turns it freely, and hardly moves.
    Motor1Stalled,
    /// The same for motor 2.
    Motor2Stalled,
    /// Motor 1 turns against its duty.
    Motor1Runaway,
    /// The same for motor 2.
    Motor2Runaway,
    /// Motor 1 draws more than it can bear (estimated from duty and speed).
    Motor1Overloaded,
    /// The same for motor 2.
    Motor2Overloaded,
    /// The direction of encoder 1 changes from edge to edge: one of its channels is dead.
    Encoder1Failed,
    /// The same for encoder 2.
    Encoder2Failed,
    /// Encoder 1 has more edges than the motor can make.
    Encoder1Noisy,
    /// The same for encoder 2.
    Encoder2Noisy,
}

impl Fault {
    /// Every fault, in the order of its number on the wire, and in the fault log.
    pub const ALL: [Self; 19] = [
        Self::None,
        Self::LinkLost,
        Self::Hang,
        Self::Panic,
        Self::ImuSilent,
        Self::ImuBusStuck,
        Self::ImuFrozen,
        Self::ImuLostConfig,
        Self::SupplyLow,
        Self::Motor1Stalled,
        Self::Motor2Stalled,
        Self::Motor1Runaway,
        Self::Motor2Runaway,
        Self::Motor1Overloaded,
        Self::Motor2Overloaded,
        Self::Encoder1Failed,
        Self::Encoder2Failed,
        Self::Encoder1Noisy,
        Self::Encoder2Noisy,
    ];
}

/// Supply of the board below which the motors stop, millivolts: below it the motors' bridge and the sensor's regulator are
/// outside of their data sheets.
pub const MIN_SUPPLY_MV: u16 = 4300;

/// An entry of the fault log, which survives resets and loss of power.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct FaultRecord {
    /// [`Info::boot_count`] of the start after which it occurred.
    #[serde(with = "fixed::u16")]
    pub boot: u16,
    /// The board's clock.
    pub time: Micros,
    /// The fault.
    pub fault: Fault,
    /// Duties of the bridges at that time.
    pub duty: [Duty; 2],
    /// Measured speeds.
    pub speed: [CentiRpm; 2],
    /// Where the program hung: the address in flash, bytes. 0 for other faults, or if it is not known.
    #[serde(with = "fixed::u16")]
    pub program_counter: u16,
}

/// State of the robot at one tick of the control loop.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Telemetry {
    /// One more than in the frame before, so that lost frames can be counted.
    pub seq: Count,
    /// The board's clock when the tick began to read the sensor.
    pub time: Micros,
    /// Attitude of the body in the world: z up, yaw from an arbitrary zero.
    pub attitude: Quaternion,
    /// Gyroscope, raw, sensor axes.
    pub gyro: [SensorCounts; 3],
    /// Accelerometer, raw, sensor axes.
    pub accel: [SensorCounts; 3],
    /// The sensor's temperature.
    pub temperature: TemperatureCounts,
    /// Target speeds of flagella 1 and 2.
    pub target: [CentiRpm; 2],
    /// Measured speeds.
    pub speed: [CentiRpm; 2],
    /// Duties of the bridges.
    pub duty: [Duty; 2],
    /// Positions of the encoders; [`Settings::counts_per_turn`] counts are one revolution of a flagellum.
    pub encoder: [EncoderCounts; 2],
    /// The board's state.
    pub state: State,
    /// The latched fault.
    pub fault: Fault,
    /// [`SetPoint::phase`] of the set-point in force; 0 without a schedule. The last one stays until the next command
    /// for the motors.
    pub phase: u8,
    /// The board's supply, measured once a second against its bandgap reference.
    pub supply: Millivolts,
    /// Whether the sensor was read in this tick; otherwise its values are of the last good reading.
    pub imu_fresh: bool,
    /// Frames of the stream that the board could not send in time.
    pub unsent: Count,
    /// Readings of the sensor that failed.
    pub imu_errors: Count,
    /// Readings with an axis at the end of its range.
    pub clipped: Count,
    /// Edges of both encoders that were too close to be motion.
    pub glitches: Count,
    /// Damaged frames from the host.
    pub bad_frames: Count,
    /// Ticks that were missed because an earlier one took too long.
    pub missed_ticks: Count,
}

/// Result of a calibration of the gyroscope.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Calibration {
    /// Whether the sensor was still throughout; if not, the bias in force is unchanged.
    pub still: bool,
    /// Mean reading, counts, sensor axes.
    pub bias: [f32; 3],
    /// Standard deviation of the readings, counts, largest axis; saturates at 65535.
    #[serde(with = "fixed::u16")]
    pub noise: u16,
    /// Number of averaged readings.
    #[serde(with = "fixed::u16")]
    pub samples: u16,
}

/// Settings of one robot, kept in EEPROM with a CRC.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub struct Settings {
    /// A number that identifies the board; 0 if none was set.
    #[serde(with = "fixed::u16")]
    pub board_id: u16,
    /// Range of the gyroscope.
    pub gyro_range: GyroRange,
    /// Range of the accelerometer.
    pub accel_range: AccelRange,
    /// The MPU6050's digital low-pass filter: register CONFIG, 0 (260 Hz) to 6 (5 Hz).
    pub low_pass: u8,
    /// Orientation of the gyroscope in the robot.
    pub gyro_axes: AxisMap,
    /// Orientation of the accelerometer in the robot; it reads +1 g on the axis that points up.
    pub accel_axes: AxisMap,
    /// Mean reading of the gyroscope at rest, counts, sensor axes.
    pub gyro_bias: [f32; 3],
    /// Gain of the attitude filter on the direction of gravity, 1/s.
    #[serde(with = "fixed::f32")]
    pub attitude_kp: f32,
    /// Gain of the attitude filter's own estimate of the gyroscope's bias, 1/s².
    #[serde(with = "fixed::f32")]
    pub attitude_ki: f32,
    /// Proportional gain of the speed control, duty steps per rpm.
    #[serde(with = "fixed::f32")]
    pub speed_kp: f32,
    /// Integral gain of the speed control, duty steps per rpm and second.
    #[serde(with = "fixed::f32")]
    pub speed_ki: f32,
    /// Encoder counts per revolution of a flagellum.
    #[serde(with = "fixed::f32")]
    pub counts_per_turn: f32,
    /// Whether a positive duty turns motors 1 and 2 backwards.
    pub motor_reversed: [bool; 2],
    /// Whether the encoders of motors 1 and 2 count backwards.
    pub encoder_reversed: [bool; 2],
    /// Longest silence of the host while the motors turn, 50 to 5000 ms.
    #[serde(with = "fixed::u16")]
    pub deadline_ms: u16,
    /// Duties above which motors 1 and 2 turn if nothing holds them. A motor that does not turn for a second at such a duty
    /// is stalled.
    pub moving_duty: [u8; 2],
    /// The chip's bandgap voltage, 1000 to 1200 mV (its electrical characteristics), against which the supply is measured.
    pub bandgap: Millivolts,
}

impl Settings {
    /// The published robot, with the published speed gains.
    ///
    /// Its encoders give 12 counts per motor revolution when both edges of both channels count, before a gear of 100.37;
    /// the board counts both edges of one channel.
    pub const DEFAULT: Self = Self {
        board_id: 0,
        gyro_range: GyroRange::Dps250,
        accel_range: AccelRange::G2,
        low_pass: 3,
        gyro_axes: AxisMap::IDENTITY,
        accel_axes: AxisMap::IDENTITY,
        gyro_bias: [0.0; 3],
        attitude_kp: 1.0,
        attitude_ki: 0.0,
        speed_kp: 1.0,
        speed_ki: 5.0,
        counts_per_turn: 602.22,
        motor_reversed: [false; 2],
        encoder_reversed: [false; 2],
        deadline_ms: 500,
        moving_duty: [100; 2],
        bandgap: Millivolts(1100),
    };

    /// Returns whether every value is in its range.
    pub fn is_valid(&self) -> bool {
        self.low_pass <= 6
            && self.gyro_axes.is_permutation()
            && self.accel_axes.is_permutation()
            && self.gyro_bias.iter().all(|bias| is_within(bias.abs(), 32768.0))
            && [self.attitude_kp, self.attitude_ki, self.speed_kp, self.speed_ki]
                .iter()
                .all(|gain| is_within(*gain, 1000.0))
            && is_within(self.counts_per_turn, 100_000.0)
            && self.counts_per_turn.to_bits() >= 1f32.to_bits()
            && (50..=5000).contains(&self.deadline_ms)
            && self.moving_duty.iter().all(|duty| *duty > 0)
            && (1000..=1200).contains(&self.bandgap.0)
    }
}

/// Returns whether `x` is in [0, limit]. As integers, because numbers without a sign have the order of their bits, and NaN
/// and the negative ones are above all of them: on the board a comparison of f32 takes a call.
fn is_within(x: f32, limit: f32) -> bool {
    x.to_bits() <= limit.to_bits()
}

impl Default for Settings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use units::Axis;

    const DEFAULT: Settings = Settings::DEFAULT;
    const TWICE_X: AxisMap = AxisMap([Axis::PlusX, Axis::MinusX, Axis::PlusZ]);

    #[test]
    fn settings_are_valid_up_to_their_limits() {
        let least = Settings {
            low_pass: 0,
            gyro_bias: [-32768.0; 3],
            attitude_kp: 0.0,
            attitude_ki: 0.0,
            speed_kp: 0.0,
            speed_ki: 0.0,
            counts_per_turn: 1.0,
            deadline_ms: 50,
            moving_duty: [1; 2],
            bandgap: Millivolts(1000),
            ..DEFAULT
        };
        let most = Settings {
            low_pass: 6,
            gyro_bias: [32768.0; 3],
            attitude_kp: 1000.0,
            attitude_ki: 1000.0,
            speed_kp: 1000.0,
            speed_ki: 1000.0,
            counts_per_turn: 100_000.0,
            deadline_ms: 5000,
            moving_duty: [255; 2],
            bandgap: Millivolts(1200),
            ..DEFAULT
        };
        for settings in [DEFAULT, least, most] {
            assert!(settings.is_valid(), "{settings:?}");
        }
    }

    #[test]
    fn one_value_out_of_its_range_makes_settings_invalid() {
        let mut unfit = vec![
            Settings { low_pass: 7, ..DEFAULT },
            Settings { gyro_axes: TWICE_X, ..DEFAULT },
            Settings { accel_axes: TWICE_X, ..DEFAULT },
            Settings { counts_per_turn: 0.99, ..DEFAULT },
            Settings { deadline_ms: 49, ..DEFAULT },
            Settings { deadline_ms: 5001, ..DEFAULT },
            Settings { moving_duty: [0, 100], ..DEFAULT },
            Settings { moving_duty: [100, 0], ..DEFAULT },
            Settings { bandgap: Millivolts(999), ..DEFAULT },
            Settings { bandgap: Millivolts(1201), ..DEFAULT },
        ];
        for bias in [32769.0, -32769.0, f32::NAN, f32::INFINITY] {
            unfit.extend(
                [[bias, 0.0, 0.0], [0.0, bias, 0.0], [0.0, 0.0, bias]]
                    .map(|gyro_bias| Settings { gyro_bias, ..DEFAULT }),
            );
        }
        for number in [-1.0, 1000.1, f32::NAN] {
            unfit.extend([
                Settings { attitude_kp: number, ..DEFAULT },
                Settings { attitude_ki: number, ..DEFAULT },
                Settings { speed_kp: number, ..DEFAULT },
                Settings { speed_ki: number, ..DEFAULT },
                Settings { counts_per_turn: 100.0 * number, ..DEFAULT },
            ]);
        }
        for settings in unfit {
            assert!(!settings.is_valid(), "{settings:?}");
        }
    }
}
