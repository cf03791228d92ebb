//! Damage on the line, by the million: `BIFLAG_DAMAGE=100000000 cargo test --release -p protocol --test wire --
//! --nocapture damage` is the full run.

use crate::messages::samples;
use protocol::frame::{Accumulator, FrameError, decode};
use protocol::{Message, Request};

/// A small generator: the test needs speed and a seed, not quality.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() >> 33) as usize % end
    }
}

fn trials() -> u64 {
    std::env::var("BIFLAG_DAMAGE").ok().and_then(|count| count.parse().ok()).unwrap_or(1_000_000)
}

/// Four in a million is one in 2^16 with room for chance; a frame that passes its CRC must still be a message.
const CRC_BOUND: f64 = 1.0 / 65536.0;

/// Sent frames with one to eight changed, lost or added bytes: nothing panics, and what is accepted although it differs
/// from what was sent is as rare as the CRC promises.
#[test]
fn damaged_frames_are_accepted_no_more_often_than_the_crc_allows() {
    let samples = samples();
    let mut random = Random(0x9E37_79B9_7F4A_7C15);
    let (mut accepted, mut damaged) = (0u64, 0u64);
    let mut work = Vec::with_capacity(128);
    for _ in 0..trials() {
        let (name, frame) = &samples[random.below(samples.len())];
        work.clear();
        work.extend_from_slice(&frame[..frame.len() - 1]);
        for _ in 0..=random.below(8) {
            let at = random.below(work.len());
            match random.below(4) {
                0 if work.len() > 1 => drop(work.remove(at)),
                1 => work.insert(at, random.next() as u8),
                _ => work[at] ^= 1 << random.below(8),
            }
        }
        if work == frame[..frame.len() - 1] {
            continue;
        }
        damaged += 1;
        let is_request = name.starts_with("Command");
        let passed =
            if is_request { decode::<Request>(&mut work).is_ok() } else { decode::<Message>(&mut work).is_ok() };
        accepted += u64::from(passed);
    }
    let rate = accepted as f64 / damaged as f64;
    println!("{damaged} damaged frames, {accepted} accepted: {rate:.2e}, the CRC's bound is {CRC_BOUND:.2e}");
    // Six standard deviations of a Poisson count above the bound.
    let bound = CRC_BOUND * damaged as f64;
    assert!((accepted as f64) < bound + 6.0 * bound.sqrt(), "{accepted} of {damaged}");
}

/// Noise, and frames cut anywhere with noise between them: no panic, and back in step after one frame.
#[test]
fn the_receiver_is_in_step_after_any_noise() {
    let samples = samples();
    let telemetry = &samples.last().expect("there are samples").1;
    let mut random = Random(0xD1B5_4A32_D192_ED03);
    let mut accumulator = Accumulator::new();
    let mut fed = 0u64;
    while fed < trials() {
        let mut line: Vec<u8> = (0..random.below(200)).map(|_| random.next() as u8).collect();
        line.extend_from_slice(&telemetry[random.below(telemetry.len())..]);
        line.extend_from_slice(telemetry);
        fed += line.len() as u64;
        let mut last = None;
        for byte in line {
            last = accumulator.push::<Message>(byte).or(last);
        }
        assert!(matches!(last, Some(Ok(Message::Telemetry(_)))), "{last:?}");
    }
    assert_eq!(accumulator.push::<Message>(0), None::<Result<Message, FrameError>>);
}
