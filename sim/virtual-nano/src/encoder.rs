//! A motor's encoder: two Hall sensors at a magnet on the motor's shaft, their two lines, and disturbances of the
//! lines.
//!
//! The sensors pull their lines low and otherwise release them (open drain), so that a line is high only through the
//! pull-up in the chip. Assumed: the board at the motor has no resistors of its own.

use crate::imu::noise::Noise;

/// Edges of both channels in a period: one pair of the magnet's poles.
const PERIOD: f64 = 4.0;

/// Duration of a spike, s. Assumed: longer than the input's synchroniser needs, and shorter than an interrupt.
const SPIKE_S: f64 = 3e-6;

/// Events are handled at whole cycles, always after their exact time.
const ONE_CYCLE_S: f64 = 1.0 / crate::mcu::FREQUENCY_HZ as f64;

/// A disturbance of a line.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
#[expect(missing_docs, reason = "the variants say what their fields are")]
pub enum Disturbance {
    /// Nothing.
    #[default]
    None,
    /// The wire is cut: the pull-up alone gives the level.
    Open,
    /// Spikes of 3 µs that invert the line, at random times.
    Spikes { rate_hz: f64 },
    /// A square wave in place of the sensor's signal.
    Tone { hz: f64 },
}

/// A line.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    disturbance: Disturbance,
    /// Begin of the present or next spike, s.
    spike_s: f64,
}

/// An encoder.
#[derive(Clone, Debug)]
pub struct Encoder {
    lines: [Line; 2],
    /// Whether there is no encoder: nothing is at its pins.
    pub absent: bool,
    /// Whether C1 and C2 are connected to each other's pins.
    pub swapped: bool,
    /// Fraction by which a north pole is longer than half a period.
    pub uneven: f64,
    noise: Noise,
}

impl Encoder {
    /// Returns an encoder without faults. The seed decides the times of spikes.
    pub fn new(seed: u64) -> Self {
        Self { lines: [Line::default(); 2], absent: false, swapped: false, uneven: 0.0, noise: Noise::new(seed) }
    }

    /// Disturbs the line of a channel (0 or 1) from a time (s) on.
    pub fn disturb(&mut self, channel: usize, disturbance: Disturbance, time_s: f64) {
        self.lines[channel] = Line { disturbance, spike_s: time_s - SPIKE_S };
        self.plan_spikes(time_s);
    }

    /// Returns the levels at the pins of C1 and C2 at a time (s), with the shaft at `counts` and these pull-ups on.
    /// C1 leads while the motor turns forward. Times must not decrease.
    pub fn levels(&mut self, counts: f64, time_s: f64, pull_ups: [bool; 2]) -> [bool; 2] {
        if self.absent {
            return pull_ups;
        }
        self.plan_spikes(time_s);
        let place = counts.rem_euclid(PERIOD);
        let [up1, up2, down1, down2] = self.edges();
        // C2 falls in the next period.
        let mut released = [place >= up1 && place < down1, place >= up2 || place < down2 - PERIOD];
        if self.swapped {
            released.swap(0, 1);
        }
        std::array::from_fn(|i| {
            let line = &self.lines[i];
            pull_ups[i]
                && match line.disturbance {
                    Disturbance::None => released[i],
                    Disturbance::Open => true,
                    Disturbance::Spikes { .. } => {
                        released[i] != (line.spike_s..line.spike_s + SPIKE_S).contains(&time_s)
                    }
                    Disturbance::Tone { hz } => half_periods(hz, time_s) % 2.0 == 1.0,
                }
        })
    }

    /// Returns the time until a level may change if the speed stays (counts a second), at most `limit_s`.
    pub fn next_event_s(&self, counts: f64, rate: f64, time_s: f64, limit_s: f64) -> f64 {
        let mut next = limit_s;
        if self.absent {
            return next;
        }
        if rate != 0.0 {
            let place = counts.rem_euclid(PERIOD);
            let ahead = |edge: f64| {
                let distance = ((edge - place) * rate.signum()).rem_euclid(PERIOD);
                // At an edge the level of higher counts holds.
                if distance == 0.0 && rate > 0.0 { PERIOD } else { distance }
            };
            next = self.edges().into_iter().map(ahead).fold(PERIOD, f64::min).min(next * rate.abs()) / rate.abs();
        }
        for line in &self.lines {
            let event_s = match line.disturbance {
                Disturbance::None | Disturbance::Open => continue,
                Disturbance::Spikes { .. } if time_s < line.spike_s => line.spike_s,
                Disturbance::Spikes { .. } => line.spike_s + SPIKE_S,
                Disturbance::Tone { hz } => (half_periods(hz, time_s) + 1.0) / (2.0 * hz),
            };
            next = next.min(event_s - time_s);
        }
        next.max(ONE_CYCLE_S)
    }

    /// Returns the counts within a period at which C1 rises, C2 rises, C1 falls and C2 falls.
    fn edges(&self) -> [f64; 4] {
        let pole = 0.5 * PERIOD * (1.0 + self.uneven);
        [1.0, 2.0, 1.0 + pole, 2.0 + pole]
    }

    fn plan_spikes(&mut self, time_s: f64) {
        for line in &mut self.lines {
            let Disturbance::Spikes { rate_hz } = line.disturbance else { continue };
            while time_s >= line.spike_s + SPIKE_S {
                line.spike_s += SPIKE_S - (1.0 - self.noise.uniform()).ln() / rate_hz;
            }
        }
    }
}

fn half_periods(hz: f64, time_s: f64) -> f64 {
    // A time that misses an edge by rounding alone counts as past it.
    (time_s * 2.0 * hz + 1e-6).floor()
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [bool; 2] = [true, true];

    /// Turns at `rate` counts a second for a second. Returns the times at which either pin changed, by channel.
    fn edges(encoder: &mut Encoder, rate: f64) -> [Vec<f64>; 2] {
        let (mut time_s, mut edges) = (0.0, [Vec::new(), Vec::new()]);
        let mut before = encoder.levels(0.5, 0.0, UP);
        while time_s < 1.0 {
            time_s += encoder.next_event_s(0.5 + rate * time_s, rate, time_s, 0.5e-3);
            let now = encoder.levels(0.5 + rate * time_s, time_s, UP);
            (0..2).filter(|i| now[*i] != before[*i]).for_each(|i| edges[i].push(time_s));
            before = now;
        }
        edges
    }

    #[test]
    fn both_channels_have_an_edge_every_other_count() {
        for rate in [1000.0, -1000.0] {
            let edges = edges(&mut Encoder::new(1), rate);
            for channel in &edges {
                assert_eq!(channel.len(), 500);
                assert!(channel.windows(2).all(|pair| (pair[1] - pair[0] - 2e-3).abs() < 1e-6));
            }
            // The channel that leads has its first edge after half a count.
            let lead = (edges[1][0] - edges[0][0]) * rate.signum();
            assert!((lead.abs() - 1e-3).abs() < 1e-6);
        }
    }

    #[test]
    fn forwards_the_first_channel_leads() {
        let mut encoder = Encoder::new(1);
        let mut levels = |counts: f64| encoder.levels(counts, 0.0, UP);
        assert_eq!([0.5, 1.5, 2.5, 3.5, 4.5].map(&mut levels).map(|[c1, _]| c1), [false, true, true, false, false]);
        assert_eq!([0.5, 1.5, 2.5, 3.5, 4.5].map(&mut levels).map(|[_, c2]| c2), [false, false, true, true, false]);
        encoder.swapped = true;
        assert_eq!(encoder.levels(1.5, 0.0, UP), [false, true]);
    }

    #[test]
    fn uneven_poles_change_the_intervals_and_not_the_number() {
        let mut encoder = Encoder::new(1);
        encoder.uneven = 0.2;
        for channel in edges(&mut encoder, 1000.0) {
            assert_eq!(channel.len(), 500);
            let mut intervals: Vec<f64> = channel.windows(2).map(|pair| pair[1] - pair[0]).collect();
            intervals.sort_by(f64::total_cmp);
            assert!((intervals[0] - 1.6e-3).abs() < 1e-6 && (intervals[498] - 2.4e-3).abs() < 1e-6);
        }
    }

    #[test]
    fn spikes_and_tones_have_their_rate() {
        let mut encoder = Encoder::new(1);
        encoder.disturb(0, Disturbance::Spikes { rate_hz: 200.0 }, 0.0);
        encoder.disturb(1, Disturbance::Tone { hz: 100_000.0 }, 0.0);
        let [spikes, tone] = edges(&mut encoder, 0.0);
        assert!((330..470).contains(&spikes.len()), "{} edges of spikes", spikes.len());
        assert!(spikes.chunks_exact(2).all(|pair| (pair[1] - pair[0] - SPIKE_S).abs() < 0.2e-6));
        assert!(tone.len().abs_diff(200_000) < 3, "{} edges of 100 kHz", tone.len());
    }

    #[test]
    fn an_open_line_is_what_its_pull_up_makes_it() {
        let mut encoder = Encoder::new(1);
        assert_eq!(encoder.levels(2.5, 0.0, [false, true]), [false, true]);
        encoder.disturb(1, Disturbance::Open, 0.0);
        assert_eq!(encoder.levels(0.5, 0.0, [true, true]), [false, true]);
        assert_eq!(encoder.levels(0.5, 0.0, [true, false]), [false, false]);
    }
}
