//! The speed of a flagellum from the times of its encoder's edges.
//!
//! With 602 counts per revolution, one count in a tick of 5 ms is 20 rpm: counting edges per tick would resolve 20 rpm.
//! The time between edges resolves a thousandth. While no edge comes, the speed is at most one count in the time since
//! the last one, so that it falls towards zero when edges stop, and is zero after [`STANDSTILL_US`].
//!
//! Units: positions in counts, times in µs, speeds in hundredths of rpm.

use protocol::units::{CentiRpm, EncoderCounts, Micros};

use crate::round_to_i16;

/// Time without an edge after which the speed is zero, µs: below 0.1 rpm with the published encoders.
pub const STANDSTILL_US: u32 = 1_000_000;

/// The edges of an encoder, as its interrupt counts them.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Edges {
    /// Position.
    pub count: i32,
    /// Time of the last edge.
    pub time: Micros,
}

/// One encoder, updated once per tick.
#[derive(Debug, Default)]
pub struct Encoder {
    /// The last edge of the last measurement of the speed.
    last: Edges,
    /// In hundredths of rpm.
    speed: f32,
    moved: bool,
}

impl Encoder {
    /// Updates the speed with the edges up to `now`. `scale` is [`centi_rpm_scale`] of the encoder.
    #[inline(never)]
    pub fn update(&mut self, edges: Edges, now: Micros, scale: f32) {
        let counts = edges.count.wrapping_sub(self.last.count);
        self.moved = counts != 0;
        if self.moved {
            // Only noise makes two edges in the same microsecond; the speed must still be finite.
            let elapsed = edges.time.since(self.last.time).max(1);
            self.speed = counts as f32 * scale / elapsed as f32;
            self.last = edges;
            return;
        }
        let silence = now.since(self.last.time);
        if silence >= STANDSTILL_US {
            self.speed = 0.0;
            // Limit the age of the last edge, or it would look recent after the clock's wrap.
            self.last.time = Micros(now.0.wrapping_sub(STANDSTILL_US));
        } else if self.speed != 0.0 {
            let limit = scale / silence.max(1) as f32;
            if self.speed.abs() > limit {
                self.speed = limit.copysign(self.speed);
            }
        }
    }

    /// Returns the speed.
    pub fn speed(&self) -> CentiRpm {
        CentiRpm(round_to_i16(self.speed, 0))
    }

    /// Returns the position.
    pub fn position(&self) -> EncoderCounts {
        EncoderCounts(self.last.count)
    }

    /// Returns whether there was an edge in the last tick.
    pub fn moved(&self) -> bool {
        self.moved
    }
}

/// Returns the hundredths of rpm per count per µs.
pub fn centi_rpm_scale(counts_per_turn: f32) -> f32 {
    const CENTI_RPM_FOR_ONE_TURN_PER_US: f32 = 100.0 * 60.0 * 1e6;
    CENTI_RPM_FOR_ONE_TURN_PER_US / counts_per_turn
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_US: u32 = 5000;

    /// Turns an encoder at a speed given over time; calls `check` every tick with time, speed and measured speed.
    fn turn(ticks: u32, rpm_at: impl Fn(f64) -> f64, mut check: impl FnMut(f64, f64, f64)) {
        let scale = centi_rpm_scale(602.22);
        let mut encoder = Encoder::default();
        let mut edges = Edges::default();
        let mut turns = 0.0;
        for tick in 1..=ticks {
            for us in (tick - 1) * TICK_US..tick * TICK_US {
                turns += rpm_at(f64::from(us) * 1e-6) / 60e6;
                let count = (turns * 602.22).floor() as i32;
                if count != edges.count {
                    edges = Edges { count, time: Micros(us) };
                }
            }
            encoder.update(edges, Micros(tick * TICK_US), scale);
            let t = f64::from(tick * TICK_US) * 1e-6;
            check(t, rpm_at(t), encoder.speed().rpm());
        }
    }

    #[test]
    fn constant_speeds_are_measured_to_a_thousandth() {
        for rpm in [-90.0, -20.0, -3.0, 0.5, 7.0, 41.3, 90.0] {
            turn(
                2000,
                |_| rpm,
                |t, _, measured| {
                    if t > 1.0 {
                        assert!((measured - rpm).abs() < 0.02 + 0.002 * rpm.abs(), "{measured} for {rpm} at {t} s");
                    }
                },
            );
        }
    }

    #[test]
    fn a_changing_speed_is_followed_within_two_edges() {
        // Where it turns round, at 180 rpm/s, the next edge takes 33 ms, in which the speed changes by 6 rpm.
        turn(
            400,
            |t| 60.0 * (t * 3.0).sin(),
            |t, rpm, measured| {
                assert!((measured - rpm).abs() < 12.0, "{measured} for {rpm} at {t} s");
            },
        );
    }

    #[test]
    fn speed_decays_when_edges_stop_and_reaches_zero() {
        let stop = 0.5;
        turn(
            500,
            |t| if t < stop { 60.0 } else { 0.0 },
            |t, _, measured| {
                let silence = t - stop;
                if silence > 0.006 {
                    let one_count = 60.0 / 602.22 / (silence - 0.002);
                    assert!(measured <= one_count + 0.005, "{measured} rpm {silence} s after the last edge");
                }
                if silence > 1.01 {
                    assert_eq!(measured, 0.0);
                }
            },
        );
    }

    #[test]
    fn the_first_edge_after_a_wrap_of_the_clock_is_no_jump() {
        let scale = centi_rpm_scale(602.22);
        let mut encoder = Encoder::default();
        encoder.update(Edges { count: 1, time: Micros(1000) }, Micros(5000), scale);
        let mut now = 5000u32;
        for _ in 0..(1u64 << 32) / 500_000 + 10 {
            now = now.wrapping_add(500_000);
            encoder.update(Edges { count: 1, time: Micros(1000) }, Micros(now), scale);
        }
        assert_eq!(encoder.speed(), CentiRpm(0));
        let edge = Edges { count: 2, time: Micros(now.wrapping_add(100)) };
        encoder.update(edge, Micros(now.wrapping_add(5000)), scale);
        assert!(encoder.speed().0 <= 10, "{:?}", encoder.speed());
    }

    #[test]
    fn an_edge_back_and_forth_is_no_motion_and_noise_saturates() {
        let scale = centi_rpm_scale(602.22);
        let mut encoder = Encoder::default();
        encoder.update(Edges { count: 0, time: Micros(4000) }, Micros(5000), scale);
        assert_eq!((encoder.speed(), encoder.moved()), (CentiRpm(0), false));
        encoder.update(Edges { count: -2000, time: Micros(9000) }, Micros(10_000), scale);
        assert_eq!(encoder.speed(), CentiRpm(-i16::MAX));
        assert_eq!(encoder.position(), EncoderCounts(-2000));
    }
}
