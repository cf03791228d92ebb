//! A motor's encoder: separates edges by motion from noise, and computes the speed of the flagellum from the times of
//! the edges.
//!
//! Every edge of channel 1 interrupts, and channel 2 gives its direction. A spike on the line causes two edges within
//! [`SPIKE_US`], which cancel each other: the second edge undoes the count and the time of the first. If the spike
//! follows a true edge, its beginning undoes that edge, and its end takes the place of the edge. Longer pulses count in
//! both directions.
//!
//! With 602 counts per revolution, one count in a tick of 5 ms is 20 rpm: counting edges per tick would resolve 20 rpm.
//! The time between edges resolves a thousandth. It is measured between edges to the same level of channel 1, because the
//! poles of the encoder's magnet differ in length. While no edge comes, the speed is at most one count in the time since
//! the last one, so that it falls towards zero when edges stop, and is zero after [`STANDSTILL_US`].
//!
//! Units: positions in counts, times in µs, speeds in hundredths of rpm.

use protocol::units::{CentiRpm, Micros};

use crate::round_to_i16;

/// Time without an edge after which the speed is zero, µs: below 0.1 rpm with the published encoders.
pub const STANDSTILL_US: u32 = 1_000_000;

/// Time within which two edges are a spike, µs. The interrupt sees the end of a spike when it has handled its beginning
/// and, at worst, an edge of the other encoder, 25 µs each; at full voltage the published motor's edges are 770 µs apart. Not longer than necessary, because an
/// edge with a spike close to it may be timed that late.
pub const SPIKE_US: u32 = 60;

/// Age below which an edge may be the beginning of a spike, µs, as the tick reads the clock after the edges. The next tick
/// takes it.
const SETTLED_US: u32 = 2 * SPIKE_US;

/// Number of interrupts of an encoder between two ticks above which they are noise: the motor at full voltage causes 7.
pub const MAX_INTERRUPTS: u8 = 24;

/// Largest relative difference of a magnet pole's length from the mean.
const LONG_POLE: f32 = 1.25;

/// An edge of channel 1.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Edge {
    /// Position after it; wraps.
    pub count: i16,
    /// Its time.
    pub time: Micros,
}

/// The edges of an encoder, as its interrupt feeds them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Edges {
    /// The last edge, and the one before it, which has the other level.
    last: Edge,
    before: Edge,
    /// Level of channel 1.
    level: bool,
    /// Edges that are motion, and edges that are not. Both wrap.
    accepted: u8,
    rejected: u8,
    /// Since the last tick.
    interrupts: u8,
}

impl Edges {
    /// Returns the edges of an encoder that has had none.
    pub const fn new() -> Self {
        const NONE: Edge = Edge { count: 0, time: Micros(0) };
        Self { last: NONE, before: NONE, level: false, accepted: 0, rejected: 0, interrupts: 0 }
    }

    /// Sets the level of channel 1 from which edges count.
    pub fn start(&mut self, channel_1: bool) {
        self.level = channel_1;
    }

    /// Takes the levels of both channels after an edge of channel 1. Returns whether the encoder is noisy: its interrupt
    /// must then be off until the next tick.
    #[inline(always)]
    pub fn feed(&mut self, channel_1: bool, channel_2: bool, time: Micros) -> bool {
        if channel_1 == self.level {
            self.rejected = self.rejected.wrapping_add(1);
        } else {
            self.level = channel_1;
            if time.since(self.last.time) < SPIKE_US {
                self.last = self.before;
                self.accepted = self.accepted.wrapping_sub(1);
                self.rejected = self.rejected.wrapping_add(2);
            } else {
                self.before = self.last;
                self.last.time = time;
                self.last.count = self.last.count.wrapping_add(if channel_1 != channel_2 { 1 } else { -1 });
                self.accepted = self.accepted.wrapping_add(1);
            }
        }
        self.interrupts = self.interrupts.wrapping_add(1);
        self.is_noisy()
    }

    /// Begins the next tick.
    pub fn begin_tick(&mut self) {
        self.interrupts = 0;
    }

    /// Returns whether there were more interrupts in the tick than motion makes.
    pub fn is_noisy(&self) -> bool {
        self.interrupts > MAX_INTERRUPTS
    }
}

/// The motion of an encoder in a tick.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Motion {
    /// Speed.
    pub speed: CentiRpm,
    /// Change of the position, counts.
    pub counts: i8,
    /// Edges that are motion, in either direction; -1 if one of an earlier tick was none.
    pub edges: i8,
    /// Edges that are not.
    pub glitches: u8,
}

/// One encoder, updated once per tick.
#[derive(Debug)]
pub struct Encoder {
    /// The edges up to the last tick.
    seen: Edges,
    /// Whether no edge has come for [`STANDSTILL_US`].
    still: bool,
    /// At the last edge, in hundredths of rpm.
    speed: f32,
    /// The motion in the last tick.
    told: CentiRpm,
    /// Whether the edges of the last tick are counted in this one.
    deferred: bool,
}

impl Default for Encoder {
    fn default() -> Self {
        Self { seen: Edges::new(), still: true, speed: 0.0, told: CentiRpm(0), deferred: false }
    }
}

impl Encoder {
    /// Updates the speed with the edges up to `now`. `scale` is [`centi_rpm_scale`] of the encoder.
    #[inline(never)]
    pub fn update(&mut self, edges: &Edges, now: Micros, scale: f32) -> Motion {
        let last = edges.last;
        // Not twice in a row: an edge before each tick is motion, and its counts would pile up.
        if now.since(last.time) < SETTLED_US && !self.deferred {
            self.deferred = true;
            return Motion { speed: self.told, ..Motion::default() };
        }
        self.deferred = false;
        // The last edge of earlier ticks to the same level.
        let reference = if edges.level == self.seen.level { self.seen.last } else { self.seen.before };
        let mut motion = Motion {
            counts: last.count.wrapping_sub(self.seen.last.count) as i8,
            edges: edges.accepted.wrapping_sub(self.seen.accepted) as i8,
            glitches: edges.rejected.wrapping_sub(self.seen.rejected),
            ..Motion::default()
        };
        self.seen = *edges;
        if self.still {
            self.seen.before = last;
        }

        // Equal times are those of an edge that was there before the last tick, and is the last one again.
        let moved = motion.edges != 0 && last.time != reference.time;
        let (counts, since) = if moved {
            (last.count.wrapping_sub(reference.count), last.time.since(reference.time))
        } else {
            (1, now.since(last.time))
        };
        if self.still {
            // The first edge begins the measurement.
            self.speed = 0.0;
            self.told = CentiRpm(0);
            self.still = !moved;
            return motion;
        }
        if !moved && since >= STANDSTILL_US {
            self.still = true;
            self.told = CentiRpm(0);
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
        self.told = CentiRpm(round_to_i16(speed, 0));
        motion.speed = self.told;
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
