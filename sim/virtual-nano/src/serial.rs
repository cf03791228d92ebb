//! The line between the chip and the host: bytes in both directions, with losses and damage on the way.
//!
//! Frames end with a zero byte (see `protocol::frame`), so that whole ones can be lost or damaged on request and counted
//! exactly.

use crate::imu::noise::Noise;
use crate::usb::Usb;
use std::collections::VecDeque;

/// Counts of bytes and frames on the line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct LineCount {
    /// Bytes that went on to the host.
    pub bytes_sent: u64,
    /// Whole frames that went on to the host, damaged ones included.
    pub frames_sent: u64,
    /// Whole frames lost on request.
    pub frames_dropped: u64,
    /// Whole frames damaged on request.
    pub frames_corrupted: u64,
    /// Bytes that arrived at the chip.
    pub bytes_received: u64,
}

/// The line.
#[derive(Debug, Default)]
pub struct Serial {
    to_chip: VecDeque<u8>,
    /// The USB bridge.
    pub usb: Usb,
    to_drop: u64,
    to_corrupt: u64,
    /// Share of the stream's frames that are lost at random.
    pub lost: f64,
    /// Fate of the frame under way.
    fate: Fate,
    /// Bytes of the frame under way.
    length: u64,
    /// Whether the two ends run at different speeds, so that bytes are misread.
    pub garbled: bool,
    noise: Noise,
    /// Counts since the start.
    pub count: LineCount,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
enum Fate {
    #[default]
    Arrives,
    Lost,
    /// A bit of this byte is flipped.
    Damaged {
        at: u64,
    },
}

impl Serial {
    /// Returns a quiet line. The seed decides where frames are damaged.
    pub fn new(seed: u64) -> Self {
        Self { noise: Noise::new(seed), ..Self::default() }
    }

    /// Sends bytes from the host.
    pub fn send(&mut self, bytes: &[u8]) {
        self.to_chip.extend(bytes);
    }

    /// Returns the number of the host's bytes that have not reached the chip.
    pub fn waiting(&self) -> usize {
        self.to_chip.len()
    }

    /// Takes the bytes that have arrived at the host since the last call, at the time `now_s`.
    pub fn take(&mut self, now_s: f64) -> Vec<u8> {
        self.usb.take(now_s)
    }

    /// Drops the next `frames` whole frames of the stream on their way to the host. Replies arrive.
    pub fn drop_frames(&mut self, frames: u64) {
        self.to_drop += frames;
    }

    /// Damages a byte in each of the next `frames` frames of the stream that are not lost.
    pub fn corrupt_frames(&mut self, frames: u64) {
        self.to_corrupt += frames;
    }

    /// Passes on a byte from the chip.
    pub fn from_chip(&mut self, byte: u8) {
        if self.garbled {
            let nonsense = self.noise.next_u64() as u8;
            self.pass(nonsense);
            return;
        }
        if byte == 0 {
            self.end_frame();
            return;
        }
        if self.length == 0 {
            self.begin_frame(byte);
        }
        self.length += 1;
        match self.fate {
            Fate::Arrives => self.pass(byte),
            Fate::Lost => {}
            Fate::Damaged { at } if self.length == at => {
                let flipped = byte ^ 1 << (self.noise.next_u64() % 8);
                // A new zero would split the frame in two.
                self.pass(if flipped == 0 { byte ^ 0xFF } else { flipped });
            }
            Fate::Damaged { .. } => self.pass(byte),
        }
    }

    /// Returns the byte that arrives at the chip now.
    pub fn to_chip(&mut self) -> Option<u8> {
        let byte = self.to_chip.pop_front()?;
        self.count.bytes_received += 1;
        Some(if self.garbled { self.noise.next_u64() as u8 } else { byte })
    }

    fn begin_frame(&mut self, first: u8) {
        // COBS begins with the distance to the first zero, and a reply's payload begins with a zero.
        let is_answer = first == 1;
        self.fate = if is_answer {
            Fate::Arrives
        } else if self.to_drop > 0 || (self.lost > 0.0 && self.noise.uniform() < self.lost) {
            Fate::Lost
        } else if self.to_corrupt > 0 {
            // The shortest frame has five bytes before its delimiter.
            Fate::Damaged { at: 1 + self.noise.next_u64() % 5 }
        } else {
            Fate::Arrives
        };
    }

    fn end_frame(&mut self) {
        let is_frame = std::mem::take(&mut self.length) > 0;
        match std::mem::replace(&mut self.fate, Fate::Arrives) {
            Fate::Lost => {
                self.to_drop = self.to_drop.saturating_sub(1);
                self.count.frames_dropped += 1;
                return;
            }
            Fate::Damaged { .. } => {
                self.to_corrupt -= 1;
                self.count.frames_corrupted += 1;
            }
            Fate::Arrives => {}
        }
        self.count.frames_sent += u64::from(is_frame);
        self.pass(0);
    }

    fn pass(&mut self, byte: u8) {
        self.count.bytes_sent += 1;
        self.usb.push(byte);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pass(serial: &mut Serial, bytes: &[u8]) -> Vec<u8> {
        for byte in bytes {
            serial.from_chip(*byte);
        }
        serial.take(0.0)
    }

    #[test]
    fn whole_frames_are_lost_from_the_next_one_on() {
        let mut serial = Serial::new(1);
        assert_eq!(pass(&mut serial, &[0, 1, 2]), [0, 1, 2]);
        serial.drop_frames(1);
        assert_eq!(pass(&mut serial, &[3, 0, 4, 5, 0, 0, 6, 0]), [3, 0, 0, 6, 0]);
        let LineCount { frames_sent, frames_dropped, .. } = serial.count;
        assert_eq!((frames_sent, frames_dropped), (2, 1));
    }

    #[test]
    fn answers_are_not_lost_with_the_stream() {
        let mut serial = Serial::new(1);
        serial.drop_frames(1);
        let answer = [1, 5, 1, 47, 211, 0];
        assert_eq!(pass(&mut serial, &answer), answer);
        assert!(pass(&mut serial, &[7, 1, 9, 0]).is_empty());
    }

    #[test]
    fn a_damaged_frame_differs_and_keeps_its_length() {
        for seed in 0..500 {
            let mut serial = Serial::new(seed);
            serial.corrupt_frames(1);
            let frame = [2, 2, 3, 128, 255, 9, 0];
            let damaged = pass(&mut serial, &frame);
            assert_ne!(damaged, frame);
            assert_eq!(damaged.iter().position(|byte| *byte == 0), Some(6), "{damaged:?}");
            assert_eq!(pass(&mut serial, &frame), frame);
            assert_eq!(serial.count.frames_corrupted, 1);
        }
    }
}
