//! Drives a motor open-loop and measures the response of both encoders and the gyroscope.

use crate::link::Link;
use crate::run::error::RecordError;
use crate::run::stream;
use protocol::units::Duty;
use protocol::{Command, Fault, MAX_DRIVE_MS, State, TICK_HZ, Telemetry};
use std::sync::atomic::AtomicBool;
use study::statistics::Line;

/// Time before a drive that provides reference readings, s.
const BEFORE_S: f64 = 0.1;

/// The motors count as at rest after this time without motion of either encoder, s.
const REST_S: f64 = 0.15;

/// Longest wait for the motors to come to rest, s.
const REST_TIMEOUT_S: f64 = 3.0;

/// Window length, s. A steady motion moves the encoder in every window.
const WINDOW_S: f64 = 0.1;

/// Smallest number of changes of an encoder's position that counts as alternation, rather than trembling.
const ALTERNATIONS: u32 = 10;

/// A board whose motors can be driven open-loop.
pub trait Drive {
    /// Drives one motor (0 or 1) and lets it come to rest. Returns the frames shortly before and during the drive.
    ///
    /// # Errors
    /// [`RecordError`] if the link fails, the board has a fault, or the user interrupts.
    fn drive(&mut self, motor: usize, duty: i16, duration_ms: u16) -> Result<Driven, RecordError>;
}

/// The frames of a drive.
#[derive(Clone, Debug, Default)]
pub struct Driven {
    /// Frames at rest before the drive.
    pub before: Vec<Telemetry>,
    /// Frames during the drive.
    pub during: Vec<Telemetry>,
}

/// The real or emulated board.
pub struct Board<'a> {
    /// The link to it.
    pub link: &'a Link,
    /// Set when the user interrupts the program.
    pub interrupted: &'a AtomicBool,
}

impl Drive for Board<'_> {
    fn drive(&mut self, motor: usize, duty: i16, duration_ms: u16) -> Result<Driven, RecordError> {
        stream::with_motors(self.link, || self.frames_of(motor, duty, duration_ms.min(MAX_DRIVE_MS)))
    }
}

impl Board<'_> {
    fn frames_of(&self, motor: usize, duty: i16, duration_ms: u16) -> Result<Driven, RecordError> {
        let mut driven = Driven::default();
        while driven.before.len() < frames(BEFORE_S) {
            driven.before.push(self.frame()?);
        }
        let mut duties = [Duty(0); 2];
        duties[motor] = Duty(duty);
        self.link.command(Command::Drive { duty: duties, duration_ms })?;
        let longest = frames(f64::from(duration_ms) * 1e-3) * 2 + usize::from(TICK_HZ);
        let mut resting = 0;
        let mut position = None;
        for count in 0.. {
            let frame = self.frame()?;
            if frame.state == State::Driving {
                driven.during.push(frame);
            } else if !driven.during.is_empty() || count > longest {
                resting = if position == Some(frame.encoder) { resting + 1 } else { 0 };
                position = Some(frame.encoder);
                if resting >= frames(REST_S) || count > longest + frames(REST_TIMEOUT_S) {
                    break;
                }
            }
        }
        Ok(driven)
    }

    fn frame(&self) -> Result<Telemetry, RecordError> {
        let frame = stream::next_frame(self.link, self.interrupted)?;
        if frame.fault == Fault::None { Ok(frame) } else { Err(RecordError::Faulted(frame.fault)) }
    }
}

fn frames(seconds: f64) -> usize {
    (seconds * f64::from(TICK_HZ)) as usize
}

/// The response to a drive.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Response {
    /// Encoders 1 and 2.
    pub encoders: [Travel; 2],
    /// Mean of the gyroscope during the drive minus the mean before it, counts, sensor axes.
    pub gyro: [f64; 3],
    /// Number of edges too close together to be motion.
    pub glitches: u16,
}

/// The motion of an encoder in a drive.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Travel {
    /// Net counts.
    pub counts: i32,
    /// Number of frames in which the position changed.
    pub changes: u32,
    /// Whether it moved continuously after the start, in one direction.
    pub is_steady: bool,
    /// Mean speed in the second half, counts per second.
    pub rate: f64,
}

impl Response {
    /// Evaluates a drive.
    pub fn of(driven: &Driven) -> Self {
        let during = &driven.during;
        let glitches = match (driven.before.first(), during.last()) {
            (Some(first), Some(last)) => last.glitches.0.wrapping_sub(first.glitches.0),
            _ => 0,
        };
        let (before, then) = (mean_gyro(&driven.before), mean_gyro(during));
        let encoders = [0, 1].map(|motor| Travel::of(during, motor));
        Self { encoders, gyro: [0, 1, 2].map(|axis| then[axis] - before[axis]), glitches }
    }
}

impl Travel {
    fn of(frames_: &[Telemetry], motor: usize) -> Self {
        let positions: Vec<i32> = frames_.iter().map(|frame| frame.encoder[motor].0).collect();
        let (Some(first), Some(last)) = (positions.first(), positions.last()) else { return Self::default() };
        let counts = last.wrapping_sub(*first);
        // The first window contains the start.
        let window = frames(WINDOW_S);
        let steps = positions.chunks(window).map(|window| window[0]).skip(1).collect::<Vec<_>>();
        let is_steady = steps.len() >= 3
            && steps.windows(2).all(|pair| {
                let step = pair[1].wrapping_sub(pair[0]);
                step != 0 && step.signum() == counts.signum()
            });
        Self {
            counts,
            changes: positions.windows(2).filter(|pair| pair[0] != pair[1]).count() as u32,
            is_steady,
            rate: slope(&positions[positions.len() / 2..]) * f64::from(TICK_HZ),
        }
    }

    /// Returns whether the position goes back and forth: one channel has edges, and the other channel, which gives the
    /// direction, does not change.
    pub fn alternates(&self) -> bool {
        self.changes >= ALTERNATIONS && self.counts.unsigned_abs() <= self.changes / 4
    }

    /// Returns whether the encoder has edges.
    pub fn is_alive(&self) -> bool {
        self.is_steady || self.alternates()
    }
}

/// Returns the least-squares slope of the positions, counts per frame. The board may count the latest edges only in the
/// next frame, so the difference between the first and the last position could be wrong by up to seven counts.
fn slope(positions: &[i32]) -> f64 {
    let moved = |position: &i32| f64::from(position.wrapping_sub(positions[0]));
    let points = positions.iter().enumerate().map(|(frame, position)| (frame as f64, moved(position)));
    if positions.len() > 1 { Line::through(points).slope } else { 0.0 }
}

fn mean_gyro(frames: &[Telemetry]) -> [f64; 3] {
    [0, 1, 2]
        .map(|axis| frames.iter().map(|frame| f64::from(frame.gyro[axis].0)).sum::<f64>() / frames.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::units::EncoderCounts;

    fn travel(positions: impl Iterator<Item = i32>) -> Travel {
        let frames: Vec<_> =
            positions.map(|at| Telemetry { encoder: [EncoderCounts(at); 2], ..Telemetry::default() }).collect();
        Travel::of(&frames, 1)
    }

    #[test]
    fn steady_motion_is_told_from_trembling_and_from_a_lost_direction() {
        let turning = travel((0..100).map(|frame| i32::MAX.wrapping_add(frame * 3)));
        assert!(turning.is_steady && !turning.alternates());
        assert_eq!((turning.counts, turning.rate), (297, 600.0));
        let slow = travel((0..100).map(|frame| -frame / 15));
        assert!(slow.is_steady && slow.counts == -6);
        let alternating = travel((0..100).map(|frame| frame % 2));
        assert!(alternating.alternates() && !alternating.is_steady && alternating.is_alive());
        for still in [travel((0..100).map(|frame| frame / 90)), travel((0..100).map(|_| 7)), travel(0..0)] {
            assert!(!still.is_alive(), "{still:?}");
        }
        let jerk = travel((0..100).map(|frame| (frame / 2).min(20)));
        assert!(!jerk.is_steady, "it moved at first and then stuck");
    }
}
