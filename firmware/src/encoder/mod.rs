//! A motor's encoder: separates edges by motion from noise, and computes the speed of the flagellum from the times of
//! the edges.
//!
//! Every edge of channel 1 interrupts, and channel 2 gives its direction. A spike on the line causes two edges within
//! [`SPIKE_US`], which cancel each other, so an edge counts only when no other one has followed within that time.
//! Longer pulses count in both directions. A spike just after a true edge cancels that edge, and its end is a new one
//! to the same level: of the three edges the two closer ones are the spike, and the remaining one gives the time. At an
//! edge that reverses the direction, channel 2 is read again some µs later, because its level may have come from a
//! spike. If there is a spike again, the direction is wrong; the next edge turns it back and is counted as noise, so
//! that the error is noticed.
//!
//! With 602 counts per revolution, one count in a tick of 5 ms is 20 rpm: counting edges per tick would resolve 20 rpm. The
//! time between edges resolves a thousandth of the speed. It is measured between edges to the same level of channel 1,
//! because the poles of the encoder's magnet differ in length, or over one pole if the motion began with it. While no edge
//! comes, the speed is at most one count in the time since the last one, so that it falls towards zero when edges stop, and
//! is zero after [`STANDSTILL_US`].
//!
//! Units: positions in counts, times in µs, speeds in hundredths of rpm.

use protocol::units::{CentiRpm, Micros};

use crate::round_to_i16;

/// Time without an edge after which the speed is zero, µs: below 0.1 rpm with the published encoders.
pub const STANDSTILL_US: u32 = 1_000_000;

/// Time within which two edges are a spike, µs: at full voltage the published motor's edges are 770 µs apart.
pub const SPIKE_US: u16 = 60;

/// An encoder's interrupt is off until the next tick after more than this many edges that are neither motion nor in
/// step with the motors' PWM: two for a spike at each of the 10 edges of one motor's PWM between two ticks.
pub const MAX_GLITCHES: u8 = 20;

/// It is also off after more than this many spikes in step with the motors' PWM: four for each of the 20 edges of the
/// PWM between two ticks.
pub const MAX_PWM_SPIKES: u8 = 80;

/// Counts of a motor's PWM, of 4 µs each, for which the lines may be disturbed after an edge of it: a little more than
/// [`SPIKE_US`].
pub const PWM_SPIKE: u8 = 16;

/// [`SPIKE_US`] in counts of the clock.
const SPIKE: u16 = 2 * SPIKE_US;

/// Largest length of a magnet's pole, relative to the mean.
const LONG_POLE: f32 = 1.25;

/// An edge of channel 1.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Edge {
    /// Position after it; wraps.
    pub count: i16,
    /// Its time.
    pub time: Micros,
}

/// The edges of an encoder that are motion, up to a tick.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Edges {
    /// Their number since the tick before.
    pub number: u8,
    /// The last of them, if there is one.
    pub last: Edge,
    /// The one before it, to the other level, if there are two.
    pub before: Edge,
    /// Number of edges since the tick before that are noise.
    pub glitches: u8,
    /// Whether the encoder is noisy: its interrupt is then off until the next tick.
    pub is_noisy: bool,
}

/// Separates edges by motion from noise; the interrupt of an encoder feeds it. Its times are from a 16-bit clock that
/// counts half µs, because short numbers keep the interrupt fast.
#[derive(Clone, Copy, Debug, Default)]
pub struct Filter {
    /// The newest edge, which may be the beginning of a spike: its time, and the change of the position; 0 if there is none.
    time: u16,
    step: i8,
    /// Level of channel 1.
    level: bool,
    /// Time of the last edge that has cancelled another one, and its distance from that one.
    cancelled: u16,
    distance: u8,
    glitches: u8,
    /// The edges by motion: their number since the tick before, the position after them, the times of the last two, and the
    /// change of the position at the last one.
    number: u8,
    count: i16,
    last: u16,
    before: u16,
    last_step: i8,
    /// Whether the direction changed at the last one.
    turned: bool,
}

impl Filter {
    /// Returns the filter of an encoder that has had no edges.
    pub const fn new() -> Self {
        Self {
            time: 0,
            step: 0,
            level: false,
            cancelled: 0,
            distance: 0,
            glitches: 0,
            number: 0,
            count: 0,
            last: 0,
            before: 0,
            last_step: 0,
            turned: false,
        }
    }

    /// Sets the level of channel 1 from which edges count.
    pub fn start(&mut self, channel_1: bool) {
        self.level = channel_1;
    }

    /// Takes the levels of both channels after an edge of channel 1. If the direction reverses, it calls
    /// `channel_2_later`, which returns the level of channel 2 when a spike is over. Returns whether the encoder is
    /// noisy, as in [`Edges`].
    #[inline(always)]
    pub fn feed(
        &mut self,
        channel_1: bool,
        channel_2: bool,
        time: u16,
        channel_2_later: impl FnOnce() -> bool,
    ) -> bool {
        let mut glitches = 1;
        if channel_1 != self.level {
            self.level = channel_1;
            let mut began = time;
            if self.step == 0 {
                // The clock wraps in 33 ms: the time of an edge so long after a spike may be wrong by a thousandth of
                // that.
                let distance = time.wrapping_sub(self.cancelled);
                if u16::from(self.distance) > distance {
                    began = began.wrapping_sub(distance).wrapping_sub(u16::from(self.distance));
                }
                self.distance = 0;
                glitches = 0;
            } else {
                let distance = time.wrapping_sub(self.time);
                if distance < SPIKE {
                    self.cancelled = time;
                    self.distance = distance as u8;
                    glitches = 2;
                } else {
                    self.settle();
                    glitches = 0;
                }
            }
            self.step = 0;
            if glitches == 0 {
                self.time = began;
                let step_by = |channel_2| if channel_1 != channel_2 { 1 } else { -1 };
                let mut step = step_by(channel_2);
                // Not on a noisy line: that reading takes time.
                if step != self.last_step && self.glitches < MAX_GLITCHES / 4 {
                    step = step_by(channel_2_later());
                }
                self.step = step;
            }
        }
        self.reject(glitches)
    }

    /// Counts edges that are not motion. Returns whether the encoder is noisy.
    #[inline(always)]
    pub fn reject(&mut self, glitches: u8) -> bool {
        self.glitches = self.glitches.wrapping_add(glitches);
        self.glitches > MAX_GLITCHES
    }

    #[inline(always)]
    fn settle(&mut self) {
        self.before = self.last;
        self.last = self.time;
        let turned = self.step != self.last_step;
        if turned && self.turned {
            self.glitches = self.glitches.wrapping_add(1);
        }
        self.turned = turned;
        self.last_step = self.step;
        self.count = self.count.wrapping_add(i16::from(self.step));
        self.number = self.number.wrapping_add(1);
    }

    /// Returns the edges up to `now`, when the clock is at `clock`, and begins the next tick. `pwm_spikes`: number of
    /// spikes in step with the motors' PWM.
    #[inline(never)]
    pub fn take(&mut self, now: Micros, clock: u16, pwm_spikes: u8) -> Edges {
        if self.step != 0 && clock.wrapping_sub(self.time) >= SPIKE {
            self.settle();
            self.step = 0;
        }
        let at = |time: u16| Micros(now.0.wrapping_sub(u32::from(clock.wrapping_sub(time) >> 1)));
        let edges = Edges {
            number: self.number,
            last: Edge { count: self.count, time: at(self.last) },
            before: Edge { count: self.count.wrapping_sub(i16::from(self.last_step)), time: at(self.before) },
            glitches: self.glitches.saturating_add(pwm_spikes),
            is_noisy: self.glitches > MAX_GLITCHES || pwm_spikes > MAX_PWM_SPIKES,
        };
        self.number = 0;
        self.glitches = 0;
        edges
    }
}

/// The motion of an encoder in a tick.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Motion {
    /// Speed.
    pub speed: CentiRpm,
    /// Change of the position, counts.
    pub counts: i8,
    /// Edges that are motion, in either direction.
    pub edges: u8,
    /// Edges that are noise.
    pub glitches: u8,
}

/// One encoder, updated once per tick.
#[derive(Debug)]
pub struct Encoder {
    /// The last edge of earlier ticks, and the one before it.
    last: Edge,
    before: Edge,
    /// Whether no edge has come for [`STANDSTILL_US`].
    still: bool,
    /// The speed at the last edge, hundredths of rpm.
    speed: f32,
}

impl Default for Encoder {
    fn default() -> Self {
        Self { last: Edge::default(), before: Edge::default(), still: true, speed: 0.0 }
    }
}

impl Encoder {
    /// Returns whether no edge has come for [`STANDSTILL_US`].
    pub fn is_still(&self) -> bool {
        self.still
    }

    /// Updates the speed with the edges up to `now`. `scale` is [`centi_rpm_scale`] of the encoder.
    #[inline(never)]
    pub fn update(&mut self, edges: &Edges, now: Micros, scale: f32) -> Motion {
        let mut motion = Motion { edges: edges.number, glitches: edges.glitches, ..Motion::default() };
        let moved = edges.number != 0;
        let (mut counts, mut since) = (1, now.since(self.last.time));
        if moved {
            let Edges { last, mut before, .. } = *edges;
            if edges.number == 1 {
                before = self.last;
            }
            motion.counts = last.count.wrapping_sub(self.last.count) as i8;
            // The last edge of earlier ticks to the same level.
            let reference = if edges.number.is_multiple_of(2) { self.last } else { self.before };
            (counts, since) = (last.count.wrapping_sub(reference.count), last.time.since(reference.time));
            // No two poles differ so much: if the last one took less than half the mean, the motion has begun with it.
            let pole = last.time.since(before.time);
            if counts != 0 && since >> 1 > pole.wrapping_mul(u32::from(counts.unsigned_abs())) {
                (counts, since) = (last.count.wrapping_sub(before.count), pole);
            }
            self.last = last;
            self.before = if self.still { last } else { before };
        }
        if self.still {
            // The first edge begins the measurement.
            self.speed = 0.0;
            self.still = !moved;
            return motion;
        }
        if !moved && since >= STANDSTILL_US {
            self.still = true;
            return motion;
        }
        let mut speed = f32::from(counts) * scale / since.max(1) as f32;
        if moved {
            self.speed = speed;
        } else if self.speed.abs() > LONG_POLE * speed {
            speed = speed.copysign(self.speed);
        } else {
            speed = self.speed;
        }
        motion.speed = CentiRpm(round_to_i16(speed, 0));
        motion
    }
}

/// Returns the hundredths of rpm per count per µs.
pub fn centi_rpm_scale(counts_per_turn: f32) -> f32 {
    const CENTI_RPM_FOR_ONE_TURN_PER_US: f32 = 100.0 * 60.0 * 1e6;
    CENTI_RPM_FOR_ONE_TURN_PER_US / counts_per_turn
}

#[cfg(test)]
mod tests;
