//! The board's end of the link: requests in, answers and telemetry out, and the deadline that the host has to meet. The
//! rules are those of the crate `protocol`.

use heapless::spsc::Producer;
use protocol::frame::Accumulator;
use protocol::units::{Count, Micros};
use protocol::{Command, Refusal, Reply, Request, TICK_HZ, Telemetry};

use crate::wire::{self, Writer};

/// Bytes that wait to be sent: one frame of telemetry and the longest answer. One place of a queue stays empty.
pub const OUTBOX: usize = 128;

/// Where bytes to send go; the serial port's interrupt takes them from there.
pub type Outbox<'a> = Producer<'a, u8, OUTBOX>;

/// The board's end of the link.
pub struct Link {
    accumulator: Accumulator,
    /// When the last intact frame came.
    heard: Micros,
    bad_frames: u16,
    /// The number of the last request, and the answer it got.
    last: Option<(u8, Answer)>,
    /// Ticks from frame to frame of the stream; 0 where there is none.
    interval: u8,
    ticks_to_frame: u8,
    seq: u16,
    unsent: u16,
}

/// The answer to a request, as far as a repetition needs it.
#[derive(Clone, Copy)]
enum Answer {
    /// Not yet given, or given by reading something out, which can be done again.
    Open,
    Done,
    Refused(Refusal),
    Pong(Micros),
}

impl Link {
    /// A silent one.
    pub const fn new() -> Self {
        Self {
            accumulator: Accumulator::new(),
            heard: Micros(0),
            bad_frames: 0,
            last: None,
            interval: 0,
            ticks_to_frame: 0,
            seq: 0,
            unsent: 0,
        }
    }

    /// Takes a byte from the host, and answers the request that it ends. `arrived` is when that was.
    #[inline(never)]
    pub fn receive(&mut self, byte: u8, arrived: Micros) -> Option<Request> {
        match self.accumulator.push_for_payload(byte)? {
            Ok(payload) => {
                // Also an intact frame of another protocol tells that the host is alive.
                self.heard = arrived;
                wire::read_request(payload)
            }
            Err(_) => {
                self.bad_frames = self.bad_frames.wrapping_add(1);
                None
            }
        }
    }

    /// The answer to repeat, where `request` is the one before once more; `None` where it is to be carried out, which is
    /// then remembered.
    pub fn repetition(&mut self, request: &Request) -> Option<Reply> {
        // A host that starts anew may begin with the number that the one before ended with.
        if request.command != Command::Hello
            && let Some((seq, answer)) = self.last
            && seq == request.seq
        {
            return match answer {
                Answer::Open => None,
                Answer::Done => Some(Reply::Done),
                Answer::Refused(refusal) => Some(Reply::Refused(refusal)),
                Answer::Pong(time) => Some(Reply::Pong(time)),
            };
        }
        self.last = Some((request.seq, Answer::Open));
        None
    }

    /// Answers the request numbered `to`. An answer for which there is no room is not sent: the host will ask again.
    #[inline(never)]
    pub fn answer(&mut self, to: u8, reply: &Reply, outbox: &mut Outbox) {
        if let Some((seq, answer)) = &mut self.last
            && *seq == to
        {
            *answer = match reply {
                Reply::Done => Answer::Done,
                Reply::Refused(refusal) => Answer::Refused(*refusal),
                Reply::Pong(time) => Answer::Pong(*time),
                Reply::Info(_) | Reply::Settings(_) | Reply::Calibration(_) => Answer::Open,
            };
        }
        let mut writer = Writer::default();
        writer.reply(to, reply);
        send(writer.finish(), outbox);
    }

    /// Whether the host has been silent for longer than `deadline_ms`.
    pub fn is_silent(&self, now: Micros, deadline_ms: u16) -> bool {
        now.since(self.heard) > u32::from(deadline_ms) * 1000
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

    /// Counts a tick. Whether a frame of the stream is due in it.
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

    /// Sends a frame of the stream; the counts that the link keeps are filled in here.
    #[inline(never)]
    pub fn stream(&mut self, telemetry: &mut Telemetry, outbox: &mut Outbox) {
        telemetry.seq = Count(self.seq);
        telemetry.unsent = Count(self.unsent);
        telemetry.bad_frames = Count(self.bad_frames);
        self.seq = self.seq.wrapping_add(1);
        let mut writer = Writer::default();
        writer.telemetry(telemetry);
        if !send(writer.finish(), outbox) {
            self.unsent = self.unsent.wrapping_add(1);
        }
    }
}

impl Default for Link {
    fn default() -> Self {
        Self::new()
    }
}

/// Puts a whole frame into the outbox, or nothing of it. Whether there was room.
#[inline(never)]
fn send(frame: &[u8], outbox: &mut Outbox) -> bool {
    let fits = frame.len() <= outbox.capacity() - outbox.len();
    if fits {
        for byte in frame {
            outbox.enqueue(*byte).ok();
        }
    }
    fits
}
