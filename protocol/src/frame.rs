//! Framing: postcard, then a CRC, then COBS.
//!
//! ```text
//! ┌──────────────── COBS ────────────────┐
//! │ postcard bytes │ CRC-16/X-25, LE     │ 0x00
//! └──────────────────────────────────────┘
//! ```
//!
//! A zero byte ends a frame and occurs nowhere else, so a receiver that starts anywhere, or has lost bytes, is
//! synchronised again after at most one frame. The CRC (polynomial 0x1021 reflected, start and final XOR 0xFFFF)
//! detects every burst of up to 16 bits and misses one in 65536 of other errors.
//!
//! A frame is shorter than 255 bytes, so that COBS is one chain of distances from zero to zero and works in place: on
//! the board this takes a third of the time of a CRC and a COBS encoder that work byte by byte.

use serde::{Deserialize, Serialize};

/// The longest frame, delimiter included; the length of every buffer that holds one.
pub const MAX_FRAME: usize = 80;

/// Why bytes are not a valid frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FrameError {
    /// More than [`MAX_FRAME`] bytes without a delimiter.
    TooLong,
    /// Not COBS, or too short to hold a CRC.
    Cobs,
    /// The CRC does not match: bytes were damaged or lost.
    Crc,
    /// An intact frame with a message that this version does not know. If it is a handshake (see [`crate::Message`]), it
    /// holds the sender's version of the protocol.
    UnknownMessage(Option<u8>),
}

impl core::fmt::Display for FrameError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::TooLong => f.write_str("no delimiter within the longest frame"),
            Self::Cobs => f.write_str("not COBS"),
            Self::Crc => f.write_str("CRC mismatch"),
            Self::UnknownMessage(None) => f.write_str("not a message of this protocol"),
            Self::UnknownMessage(Some(version)) => write!(f, "a handshake of protocol version {version}"),
        }
    }
}

impl core::error::Error for FrameError {}

/// Writes `message` as a frame, delimiter included, to the start of `buffer`; returns the frame.
///
/// # Errors
/// [`FrameError::TooLong`] if `buffer` is too short; [`MAX_FRAME`] bytes are enough for every message.
// Not inlined: with the buffer on the caller's stack, every access to the encoder would take five more instructions on the
// board, where access by the stack pointer reaches 63 bytes.
#[inline(never)]
pub fn encode<'a, T: Serialize>(message: &T, buffer: &'a mut [u8]) -> Result<&'a mut [u8], FrameError> {
    let payload = buffer.get_mut(1..).ok_or(FrameError::TooLong)?;
    let length = postcard::to_slice(message, payload).map_err(|_| FrameError::TooLong)?.len();
    seal(buffer, length)
}

/// Frames the `length` bytes of payload that start at `buffer[1]`; returns the frame.
///
/// # Errors
/// [`FrameError::TooLong`] if `buffer` has no room for the frame, or the frame is longer than 255 bytes.
pub fn seal(buffer: &mut [u8], length: usize) -> Result<&mut [u8], FrameError> {
    let frame = buffer.get_mut(..length + OVERHEAD).filter(|frame| frame.len() < 256).ok_or(FrameError::TooLong)?;
    let [first, payload @ .., low, high, delimiter] = frame else { return Err(FrameError::TooLong) };
    [*low, *high] = crc16(payload).to_le_bytes();
    [*first, *delimiter] = [0, 0];
    // From the end: each zero becomes its distance to the zero after it, and the last one stays.
    let mut distance = 0;
    for byte in frame.iter_mut().rev() {
        if *byte == 0 {
            *byte = distance;
            distance = 0;
        }
        distance += 1;
    }
    Ok(frame)
}

/// Decodes a frame, without its delimiter, in place and checks its CRC; returns the payload.
fn open(frame: &mut [u8]) -> Result<&[u8], FrameError> {
    // From the start: each distance becomes the zero that it stands for, and the last one points just past the frame.
    let mut distance = 1u8;
    for byte in frame.iter_mut() {
        distance -= 1;
        if *byte == 0 {
            return Err(FrameError::Cobs);
        }
        if distance == 0 {
            distance = core::mem::take(byte);
        }
    }
    match frame {
        [_, payload @ .., low, high] if distance == 1 => {
            let crc = u16::from_le_bytes([*low, *high]);
            if crc16(payload) == crc { Ok(payload) } else { Err(FrameError::Crc) }
        }
        _ => Err(FrameError::Cobs),
    }
}

/// Reads the message in a frame, without its delimiter. The content of `frame` is lost.
///
/// # Errors
/// [`FrameError`].
pub fn decode<'a, T: Deserialize<'a>>(frame: &'a mut [u8]) -> Result<T, FrameError> {
    open(frame).and_then(read)
}

/// Reads the message in a frame's payload.
///
/// # Errors
/// [`FrameError::UnknownMessage`].
#[inline(never)]
pub fn read<'a, T: Deserialize<'a>>(payload: &'a [u8]) -> Result<T, FrameError> {
    match postcard::take_from_bytes(payload) {
        Ok((message, [])) => Ok(message),
        _ => Err(FrameError::UnknownMessage(crate::version_of(payload))),
    }
}

/// Collects received bytes into frames.
#[derive(Debug, Default)]
pub struct Accumulator {
    buffer: heapless::Vec<u8, MAX_FRAME>,
    overflowed: bool,
    /// Whether the buffer holds a frame that has ended.
    ended: bool,
}

impl Accumulator {
    /// Returns an empty accumulator.
    pub const fn new() -> Self {
        Self { buffer: heapless::Vec::new(), overflowed: false, ended: false }
    }

    /// Takes one byte. A delimiter ends a frame, and its message is returned. Empty frames are ignored, so that a sender
    /// may begin with a delimiter.
    pub fn push<'a, T: Deserialize<'a>>(&'a mut self, byte: u8) -> Option<Result<T, FrameError>> {
        self.push_for_payload(byte).map(|payload| payload.and_then(read))
    }

    /// Takes one byte like [`Accumulator::push`], but returns the frame's payload undecoded, for a receiver that must notice
    /// an intact frame even if it is not a message of this version.
    pub fn push_for_payload(&mut self, byte: u8) -> Option<Result<&[u8], FrameError>> {
        if self.ended {
            self.ended = false;
            self.buffer.clear();
        }
        if byte != 0 {
            self.overflowed |= self.buffer.push(byte).is_err();
            return None;
        }
        self.ended = true;
        if core::mem::take(&mut self.overflowed) {
            return Some(Err(FrameError::TooLong));
        }
        (!self.buffer.is_empty()).then(|| open(&mut self.buffer))
    }

    /// Returns the number of bytes of the unfinished frame.
    pub fn pending(&self) -> usize {
        if self.ended { 0 } else { self.buffer.len() }
    }
}

/// Bytes of a frame besides its payload: the first distance of COBS, the CRC, the delimiter.
const OVERHEAD: usize = 4;

/// Returns the CRC-16/X-25 of `bytes`. A table of 512 bytes would take a quarter of the board's SRAM. The computation
/// is in bytes, which takes half as long on the board as in words.
#[inline(never)]
pub fn crc16(bytes: &[u8]) -> u16 {
    let [mut low, mut high] = [0xFF; 2];
    for byte in bytes {
        let mut byte = byte ^ low;
        byte ^= byte << 4;
        low = high ^ byte >> 4 ^ byte << 3;
        high = byte ^ byte >> 5;
    }
    !u16::from_le_bytes([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crc_is_x25() {
        assert_eq!(crc16(b"123456789"), 0x906E);
    }

    #[test]
    fn an_overlong_frame_is_reported_once_and_the_next_one_is_read() {
        let mut accumulator = Accumulator::new();
        for _ in 0..200 {
            assert!(accumulator.push::<crate::Request>(7).is_none());
        }
        assert_eq!(accumulator.push::<crate::Request>(0), Some(Err(FrameError::TooLong)));
        let request = crate::Request { seq: 9, command: crate::Command::Stop };
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&request, &mut buffer).unwrap();
        let read: Vec<_> = frame.iter().filter_map(|byte| accumulator.push::<crate::Request>(*byte)).collect();
        assert_eq!(read, [Ok(request)]);
    }

    #[test]
    fn trailing_bytes_make_a_message_unknown() {
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&(1u8, 2u8, 3u8), &mut buffer).unwrap();
        let end = frame.len() - 1;
        assert_eq!(decode::<(u8, u8)>(&mut frame[..end]), Err(FrameError::UnknownMessage(None)));
    }

    #[test]
    fn frames_are_at_most_255_bytes() {
        for (length, fits) in [(0, true), (1, true), (251, true), (252, false), (296, false)] {
            let mut buffer = [7; 300];
            let frame = seal(&mut buffer, length).map(|frame| frame.len());
            assert_eq!(frame, if fits { Ok(length + OVERHEAD) } else { Err(FrameError::TooLong) });
            if fits {
                assert_eq!(
                    open(&mut buffer[..length + OVERHEAD - 1]).map(|payload| payload == vec![7; length]),
                    Ok(true)
                );
            }
        }
        assert_eq!(seal(&mut [7; 9], 6).map(|_| ()), Err(FrameError::TooLong), "no room in the buffer");
    }

    #[test]
    fn the_bytes_of_an_unfinished_frame_are_pending() {
        let mut accumulator = Accumulator::new();
        let pending = [7, 7, 7, 0, 7, 0, 0, 7, 7].map(|byte| {
            let _ = accumulator.push_for_payload(byte);
            accumulator.pending()
        });
        assert_eq!(pending, [1, 2, 3, 0, 1, 0, 0, 1, 2]);
    }

    #[test]
    fn errors_say_what_is_wrong() {
        let says = |error: FrameError, words: &str| assert!(error.to_string().contains(words), "{error}");
        says(FrameError::TooLong, "delimiter");
        says(FrameError::Cobs, "COBS");
        says(FrameError::Crc, "CRC");
        says(FrameError::UnknownMessage(None), "not a message");
        says(FrameError::UnknownMessage(Some(7)), "version 7");
    }
}
