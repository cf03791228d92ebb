//! The protocol between the robot's Arduino Nano and the host.
//!
//! ```
//! use protocol::frame::{Accumulator, MAX_FRAME, encode};
//! use protocol::units::CentiRpm;
//! use protocol::{Command, Request};
//!
//! // The host asks for speeds of 50 and -12.5 rpm ...
//! let request = Request { seq: 7, command: Command::SetSpeeds([CentiRpm(5000), CentiRpm(-1250)]) };
//! let mut buffer = [0; MAX_FRAME];
//! let frame = encode(&request, &mut buffer)?;
//!
//! // ... and the board receives them byte by byte, in this case after a byte of noise.
//! let mut inbox = Accumulator::default();
//! assert!(inbox.push::<Request>(0xA5).is_none());
//! assert!(inbox.push::<Request>(0).expect("a delimiter").is_err());
//! let received = frame.iter().find_map(|byte| inbox.push::<Request>(*byte));
//! assert_eq!(received, Some(Ok(request)));
//! # Ok::<(), protocol::frame::FrameError>(())
//! ```
//!
//! # Messages
//!
//! The host sends [`Request`]s, each with a [`Command`]; the board answers every request with one [`Reply`] and streams
//! [`Telemetry`] on its own. Bytes on the wire, with framing ([`frame`]):
//!
//! | host to board | bytes | board answers | bytes |
//! | --- | --- | --- | --- |
//! | [`Command::Hello`] | 6 | [`Reply::Info`] | 40 |
//! | [`Command::SetSpeeds`] | 10 | [`Reply::Done`] | 7 |
//! | [`Command::Stop`] | 6 | [`Reply::Done`] | 7 |
//! | [`Command::Stream`] | 7 | [`Reply::Done`] | 7 |
//! | [`Command::CalibrateGyro`] | 8 | [`Reply::Done`] at once, the result later | 7 |
//! | [`Command::ReadCalibration`] | 6 | [`Reply::Calibration`] | 24 |
//! | [`Command::ReadSettings`] | 6 | [`Reply::Settings`] | 62 |
//! | [`Command::WriteSettings`] | 61 | [`Reply::Done`] | 7 |
//! | [`Command::SaveSettings`] | 6 | [`Reply::Done`] | 7 |
//! | [`Command::Ping`] | 6 | [`Reply::Pong`] | 11 |
//! | [`Command::ClearFault`] | 6 | [`Reply::Done`] | 7 |
//! | [`Command::SetPoint`] | 18 | [`Reply::Done`] | 7 |
//! | [`Command::StartSchedule`] | 11 | [`Reply::Done`] | 7 |
//! | [`Command::Drive`] | 12 | [`Reply::Done`] | 7 |
//! | [`Command::ReadFault`] | 7 | [`Reply::FaultRecord`] | 24 |
//! | [`Command::TurnTo`] | 16 | [`Reply::Done`] at once | 7 |
//! | [`Command::Align`] | 6 | [`Reply::Done`] | 7 |
//! | [`Command::ReadNote`] | 7 | [`Reply::Pong`] | 11 |
//! | [`Command::WriteNote`] | 8 | [`Reply::Done`] | 7 |
//! | any, refused | | [`Reply::Refused`] | 8 |
//! | | | [`Telemetry`], streamed | 71 |
//!
//! # Rules
//!
//! - A trial is a schedule: the host sends its set-points ([`Command::SetPoint`]) and starts it
//!   ([`Command::StartSchedule`]); the board changes the speeds at the ticks of the schedule, reports its phases in the
//!   telemetry, and stops the motors by itself at the end.
//! - The line runs at [`BAUD`], 8N1. Opening the port resets a Nano; its bootloader answers for up to two seconds.
//! - Every intact frame from the host restarts the motors' deadline ([`Settings::deadline_ms`]). If it expires while a motor
//!   turns or will turn in the schedule, the board stops both motors and latches [`Fault::LinkLost`].
//! - The board carries out a request only if the answer fits into its outbox. It drops other requests entirely; they
//!   still count for the deadline.
//! - Every request is idempotent. A request with the sequence number of the one before gets the same answer again, without
//!   a second effect, so a host that received no answer may repeat the request.
//! - A fault stops the motors, is in every telemetry frame, and lasts until [`Command::ClearFault`].
//! - The first bytes of a handshake never change (see [`Message`]), so that the two sides learn each other's version even
//!   if it differs.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

mod command;
mod fault;
mod fixed;
pub mod frame;
mod memory;
mod reply;
mod settings;
mod telemetry;
pub mod units;

pub use command::{Command, MAX_DRIVE_MS, MAX_SET_POINTS, MAX_TURN_SPEED, NOTE_COPIES, NOTE_LENGTH, Request, SetPoint};
pub use fault::{FAULT_RECORDS, Fault, FaultRecord, MIN_SUPPLY_MV};
pub use reply::{Calibration, GENUINE_IMU_ID, Info, Refusal, Reply, ResetCause};
pub use settings::{Bridge, Settings, SpeedFrom};
pub use telemetry::{State, Telemetry};

#[cfg(not(target_arch = "avr"))]
use serde::Deserialize;
use serde::Serialize;

/// Version of this protocol. It rises with every change of the bytes on the wire, which the tests' golden file reveals.
pub const VERSION: u8 = 4;

/// The first four bytes of the SHA-256 of the formats of all messages (`tests/wire/schema.txt`). Both sides compare it in
/// the handshake, because two builds of one version can differ while the protocol is being changed.
pub const SCHEMA: [u8; 4] = [0x69, 0x0f, 0xd0, 0x1d];

/// Speed of the line, bit/s: exact with the Nano's 16 MHz crystal.
pub const BAUD: u32 = 500_000;

/// Ticks of the board's control loop per second; the highest rate of telemetry.
pub const TICK_HZ: u8 = 200;

/// The messages of the board.
///
/// An answer to [`Command::Hello`] begins, in every version of this protocol, with the bytes 0 (an answer), the number
/// of the request, 0 (an [`Info`]) and the version.
#[cfg_attr(not(target_arch = "avr"), derive(Deserialize))]
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
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

/// A borrowed [`Message`]: the same bytes, without a copy on the board's stack.
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
