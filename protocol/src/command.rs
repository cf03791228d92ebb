//! Requests from the host to the board.

use crate::settings::Settings;
use crate::units::{CentiRpm, Duty, EncoderCounts, Micros};
use serde::{Deserialize, Serialize};
#[cfg(target_arch = "avr")]
use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes};

/// A command with a sequence number, which the answer repeats.
#[cfg_attr(not(target_arch = "avr"), derive(Deserialize))]
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
#[cfg_attr(target_arch = "avr", derive(TryFromBytes, KnownLayout, Immutable), repr(C))]
pub struct Request {
    /// Sequence number: differs from that of the previous request, unless this request repeats it.
    pub seq: u8,
    /// The command.
    pub command: Command,
}

/// The requests of the host.
#[cfg_attr(not(target_arch = "avr"), derive(Deserialize))]
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
#[cfg_attr(target_arch = "avr", derive(TryFromBytes, KnownLayout, Immutable), repr(u8))]
pub enum Command {
    /// Handshake: asks for [`Info`](crate::Info). Always the first variant, encoded as the byte 0.
    Hello,
    /// Turn flagella 1 and 2 at these speeds, each within [`CentiRpm::LIMIT`]. A board without encoders accepts only zeros.
    SetSpeeds([CentiRpm; 2]),
    /// Motors off. Always accepted.
    Stop,
    /// Stream telemetry at a rate that divides [`TICK_HZ`](crate::TICK_HZ); 0 ends the stream.
    Stream {
        /// Frames per second.
        rate_hz: u8,
    },
    /// Average the gyroscope at rest and use the mean as its bias. Motors must be off.
    CalibrateGyro {
        /// 100 to 60000.
        #[serde(with = "crate::fixed::u16")]
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
    /// Drive the motors open-loop, for the self-test of the wiring; then turn them off. Motors must be off. During the drive
    /// the board checks the deadline, the heat of the windings and the noise of the encoders, but not the motion.
    Drive {
        /// Duties of motors 1 and 2.
        duty: [Duty; 2],
        /// 1 to [`MAX_DRIVE_MS`].
        #[serde(with = "crate::fixed::u16")]
        duration_ms: u16,
    },
    /// Read an entry of the fault log.
    ReadFault {
        /// 0 is the latest one; up to [`FAULT_RECORDS`](crate::FAULT_RECORDS) - 1.
        index: u8,
    },
    /// Turn both flagella to these positions of their encoders, then turn the motors off. Motors must be off. Refused without
    /// encoders.
    TurnTo {
        /// Positions of encoders 1 and 2, less than 2^31 counts away.
        position: [EncoderCounts; 2],
        /// The speed of a flagellum that is far from its position, 0.01 rpm to [`MAX_TURN_SPEED`].
        speed: CentiRpm,
    },
    /// Set the positions of both flagella, which are at their marks, to zero; they are known from now on. Motors must be off.
    /// Refused without encoders.
    Align,
    /// Read four bytes of the note.
    ReadNote {
        /// Number of the first byte, 0 to 60.
        index: u8,
    },
    /// Write a byte of the note to EEPROM. Motors must be off.
    WriteNote {
        /// Number of the byte, 0 to 63.
        index: u8,
        /// The byte.
        byte: u8,
    },
}

/// Length of the note: bytes that the host keeps on the board in [`NOTE_COPIES`] copies, one after the other. The board
/// does not use them.
pub const NOTE_LENGTH: u8 = 20;

/// Copies of the note. The host writes the older one, so that a loss of power leaves the other.
pub const NOTE_COPIES: u8 = 2;

/// Largest number of set-points in a schedule.
pub const MAX_SET_POINTS: u8 = 8;

/// Longest open-loop drive, ms.
pub const MAX_DRIVE_MS: u16 = 2000;

/// Fastest turn to a position.
pub const MAX_TURN_SPEED: CentiRpm = CentiRpm(1500);

/// A set-point: speeds and phase from a tick of the schedule on.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[cfg_attr(target_arch = "avr", repr(C), serde(remote = "Self"))]
pub struct SetPoint {
    /// Ticks from the start of the schedule.
    #[serde(with = "crate::fixed::u32")]
    pub tick: u32,
    /// Target speeds of flagella 1 and 2 from then on, each within [`CentiRpm::LIMIT`].
    pub speeds: [CentiRpm; 2],
    /// Magnitudes of the duties of motors 1 and 2 if the board has no encoders ([`SpeedFrom::Duty`](crate::SpeedFrom::Duty));
    /// the duties have the signs of the speeds.
    pub duties: [u8; 2],
    /// Number of the phase in the telemetry from then on, chosen by the host; not 0.
    pub phase: u8,
}
