//! The board's end of the link: requests in, answers and telemetry out, and the host's deadline. The crate `protocol` has
//! the rules.

use protocol::frame::{self, Accumulator, MAX_FRAME};
use protocol::units::{Count, Micros};
use protocol::{Command, MessageRef, Refusal, Request, TICK_HZ, Telemetry};

/// Size of the outbox: a frame of telemetry and the longest answer, or two frames.
pub const OUTBOX: u8 = 144;

/// Lengths of the longest answer to some requests.
const SETTINGS: u8 = 62;
const INFO: u8 = 40;
const PONG: u8 = 11;

/// Bytes to send, up to [`OUTBOX`] - 1; the serial port takes them.
pub trait Outbox {
    /// Returns the number of free bytes.
    fn room(&self) -> u8;

    /// Adds bytes, for which there is room.
    fn add(&mut self, bytes: &[u8]);
}

/// The board's end of the link, without a stream at first.
#[derive(Default)]
pub struct Link {
    accumulator: Accumulator,
    /// When the last intact frame came.
    heard: Micros,
    bad_frames: u16,
    /// The number of the last request, and its answer.
    last: Option<(u8, Answer)>,
    /// Ticks from frame to frame of the stream; 0 without a stream.
    interval: u8,
    ticks_to_frame: u8,
    seq: u16,
    unsent: u16,
}

/// An answer; the content of a long one is read when it is sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Answer {
    /// [`protocol::Reply::Done`]
    Done,
    /// [`protocol::Reply::Refused`]
    Refused(Refusal),
    /// [`protocol::Reply::Pong`]
    Pong(Micros),
    /// [`protocol::Reply::Info`]
    Info,
    /// [`protocol::Reply::Settings`]
    Settings,
    /// [`protocol::Reply::Calibration`]
    Calibration,
    /// [`protocol::Reply::FaultRecord`] of the entry with this index.
    FaultRecord(u8),
    /// The answer follows later.
    Later,
}

impl From<Result<(), Refusal>> for Answer {
    fn from(outcome: Result<(), Refusal>) -> Self {
        match outcome {
            Ok(()) => Self::Done,
            Err(refusal) => Self::Refused(refusal),
        }
    }
}

impl Link {
    /// Returns the buffer of a frame, for use before the host's first byte.
    pub fn accumulator(&mut self) -> &mut Accumulator {
        &mut self.accumulator
    }

    /// Takes a byte from the host; returns the payload of the frame that it ends. `arrived` is the time of the byte.
    pub fn receive(&mut self, byte: u8, arrived: Micros) -> Option<&[u8]> {
        match self.accumulator.push_for_payload(byte)? {
            Ok(payload) => {
                // An intact frame of another protocol also shows that the host is alive.
                self.heard = arrived;
                Some(payload)
            }
            Err(_) => {
                self.bad_frames = self.bad_frames.wrapping_add(1);
                None
            }
        }
    }

    /// Returns the previous answer if `request` repeats the previous request.
    pub fn repetition(&self, request: &Request) -> Option<Answer> {
        // A new host may begin with the last number of the host before.
        self.last
            .filter(|(seq, answer)| {
                *seq == request.seq && *answer != Answer::Later && request.command != Command::Hello
            })
            .map(|(_, answer)| answer)
    }

    /// Remembers the answer to the request numbered `seq`.
    pub fn remember(&mut self, seq: u8, answer: Answer) {
        self.last = Some((seq, answer));
    }

    /// Remembers a late answer if no other request has come since.
    pub fn remember_late(&mut self, seq: u8, answer: Answer) {
        if self.last == Some((seq, Answer::Later)) {
            self.last = Some((seq, answer));
        }
    }

    /// Returns whether the answer to `command` fits into the outbox. The next frame of telemetry has room in any case: requests
    /// are answered between ticks, and the line takes most of the outbox before a tick ends.
    pub fn has_room(&self, command: &Command, outbox: &impl Outbox) -> bool {
        let answer = match command {
            Command::ReadSettings => SETTINGS,
            Command::Hello | Command::ReadCalibration | Command::ReadFault { .. } => INFO,
            _ => PONG,
        };
        outbox.room() >= answer
    }

    /// Sends an answer. Without room it is dropped: the host repeats the request.
    pub fn send(message: &MessageRef, outbox: &mut impl Outbox) {
        enqueue(message, outbox);
    }

    /// Returns whether the host has been silent for longer than `deadline_us`.
    pub fn is_silent(&self, now: Micros, deadline_us: u32) -> bool {
        now.since(self.heard) > deadline_us
    }

    /// Starts a stream of `rate_hz` frames per second, or ends it with 0.
    ///
    /// # Errors
    /// [`Refusal::OutOfRange`] unless the rate divides [`TICK_HZ`].
    pub fn set_stream(&mut self, rate_hz: u8) -> Result<(), Refusal> {
        self.interval = match rate_hz {
            0 => 0,
            rate if TICK_HZ.is_multiple_of(rate) => TICK_HZ / rate,
            _ => return Err(Refusal::OutOfRange),
        };
        self.ticks_to_frame = 1;
        Ok(())
    }

    /// Advances one tick; returns whether a frame is due.
    pub fn is_frame_due(&mut self) -> bool {
        if self.interval == 0 {
            return false;
        }
        self.ticks_to_frame -= 1;
        let due = self.ticks_to_frame == 0;
        if due {
            self.ticks_to_frame = self.interval;
        }
        due
    }

    /// Sends a frame of the stream, with the link's counts filled in.
    #[inline(never)]
    pub fn stream(&mut self, telemetry: &mut Telemetry, outbox: &mut impl Outbox) {
        telemetry.seq = Count(self.seq);
        telemetry.unsent = Count(self.unsent);
        telemetry.bad_frames = Count(self.bad_frames);
        self.seq = self.seq.wrapping_add(1);
        if !enqueue(&MessageRef::Telemetry(telemetry), outbox) {
            self.unsent = self.unsent.wrapping_add(1);
        }
    }
}

/// Puts a message into the outbox if all of its frame fits; returns whether it did.
#[inline(never)]
fn enqueue(message: &MessageRef, outbox: &mut impl Outbox) -> bool {
    let mut buffer = [0; MAX_FRAME];
    let Ok(frame) = frame::encode(message, &mut buffer) else { return false };
    let fits = frame.len() <= usize::from(outbox.room());
    if fits {
        outbox.add(frame);
    }
    fits
}
