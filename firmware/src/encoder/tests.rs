use super::*;
use std::ops::Range;

const TICK_US: u32 = 5000;
const COUNTS_PER_TURN: f64 = 602.22;

/// Returns the filter's clock at a time in µs.
fn clock(us: u32) -> u16 {
    us.wrapping_mul(2) as u16
}

/// Feeds an edge of channel 1, with the level of channel 2 at it and later.
fn feed(filter: &mut Filter, channel_1: bool, channel_2: bool, us: u32) -> bool {
    filter.feed(channel_1, channel_2, clock(us), || channel_2)
}

fn take(filter: &mut Filter, us: u32) -> Edges {
    filter.take(Micros(us), clock(us), 0)
}

/// A shaft with its encoder and the line of channel 1.
struct Shaft {
    /// In counts.
    position: f64,
    /// By how much the poles differ from their mean.
    uneven: f64,
    /// Whether a spike inverts channel 1.
    spike: bool,
    line: bool,
    filter: Filter,
}

impl Shaft {
    fn new(uneven: f64) -> Self {
        Self { position: 0.5, uneven, spike: false, line: false, filter: Filter::new() }
    }

    fn is_high(&self, position: f64) -> bool {
        // `rem_euclid` would take most of the test's time.
        position - 2.0 * (0.5 * position).floor() >= 1.0 - self.uneven
    }

    /// Calls the interrupt if the level of channel 1 has changed.
    fn look(&mut self, now: u32) {
        let level = self.is_high(self.position) != self.spike;
        if level != self.line {
            self.line = level;
            let channel_2 = self.is_high(self.position - 0.5);
            feed(&mut self.filter, level, channel_2, now);
        }
    }

    /// Returns the edges between the start and here.
    fn truth(&self) -> i16 {
        let low = self.position.div_euclid(2.0) * 2.0;
        (low + f64::from(u8::from(self.is_high(self.position)))) as i16
    }
}

fn counts_per_us(rpm: f64) -> f64 {
    rpm * COUNTS_PER_TURN / 60e6
}

/// Turns an encoder at a speed given over time; calls `check` every tick with time, speed and measured speed.
fn turn_uneven(uneven: f64, ticks: u32, rpm_at: impl Fn(f64) -> f64, mut check: impl FnMut(f64, f64, f64)) {
    let scale = centi_rpm_scale(COUNTS_PER_TURN as f32);
    let mut encoder = Encoder::default();
    let mut shaft = Shaft::new(uneven);
    let mut position = 0;
    for tick in 1..=ticks {
        for us in (tick - 1) * TICK_US..tick * TICK_US {
            shaft.position += counts_per_us(rpm_at(f64::from(us) * 1e-6));
            shaft.look(us);
        }
        let edges = take(&mut shaft.filter, tick * TICK_US);
        let motion = encoder.update(&edges, Micros(tick * TICK_US), scale);
        position += i16::from(motion.counts);
        assert_eq!(position + i16::from(shaft.filter.step), shaft.truth());
        assert_eq!(motion.glitches, 0);
        let t = f64::from(tick * TICK_US) * 1e-6;
        check(t, rpm_at(t), motion.speed.rpm());
    }
}

fn turn(ticks: u32, rpm_at: impl Fn(f64) -> f64, check: impl FnMut(f64, f64, f64)) {
    turn_uneven(0.0, ticks, rpm_at, check);
}

#[test]
fn constant_speeds_are_measured_to_a_thousandth() {
    for uneven in [0.0, 0.2, -0.2] {
        for rpm in [-90.0, -20.0, -3.0, 0.5, 7.0, 11.7, 19.0, 26.0, 41.3, 90.0] {
            turn_uneven(
                uneven,
                600,
                |_| rpm,
                |t, _, measured| {
                    if t > 1.0 {
                        assert!(
                            (measured - rpm).abs() < 0.02 + 0.002 * rpm.abs(),
                            "{measured} for {rpm} at {t} s with poles {uneven}"
                        );
                    }
                },
            );
        }
    }
}

#[test]
fn a_changing_speed_is_followed_within_two_edges() {
    // Where it reverses, at 180 rpm/s, the next edge takes 33 ms, in which the speed changes by 6 rpm.
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
                let one_count = 60.0 / COUNTS_PER_TURN / (silence - 0.002);
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
    let scale = centi_rpm_scale(COUNTS_PER_TURN as f32);
    let mut encoder = Encoder::default();
    let mut filter = Filter::new();
    feed(&mut filter, true, false, 1000);
    let mut update = |filter: &mut Filter, us| encoder.update(&take(filter, us), Micros(us), scale);
    update(&mut filter, 5000);
    let mut now = 5000u32;
    for _ in 0..(1u64 << 32) / 500_000 + 10 {
        now = now.wrapping_add(500_000);
        update(&mut filter, now);
    }
    assert_eq!(update(&mut filter, now), Motion::default());
    feed(&mut filter, false, true, now.wrapping_add(100));
    let motion = update(&mut filter, now.wrapping_add(5000));
    assert!(motion.speed.0 <= 10 && (motion.counts, motion.edges) == (1, 1), "{motion:?}");
    feed(&mut filter, true, false, now.wrapping_add(10_100));
    let motion = update(&mut filter, now.wrapping_add(15_000));
    assert!((motion.speed.rpm() - 9.96).abs() < 0.01, "from the second edge on: {motion:?}");
}

/// A motor starts again before its rest counts as a standstill.
#[test]
fn the_second_edge_after_a_rest_tells_the_speed() {
    for uneven in [0.0_f64, 0.2, -0.2] {
        // Where the motor rests, as a part of the way between edges.
        for part in [0.0, 0.25, 0.5, 0.75] {
            let begin = |rpm: f64| part / (1e6 * counts_per_us(rpm));
            second_edge_tells_the_speed(uneven, 30.0, (400, 0.5 + begin(30.0)..1.2), uneven.abs());
            // Less than one edge a tick. Over a pole that is shorter by a fifth the speed is higher by a quarter.
            let within = uneven.abs() / (1.0 - uneven.abs());
            second_edge_tells_the_speed(uneven, -7.3, (300, 0.3 + begin(7.3)..1.1), within);
        }
    }
}

/// Checks the speed after the second edge. `within`: the largest error over one pole, as a share of the speed.
fn second_edge_tells_the_speed(uneven: f64, rpm: f64, (ticks, rest): (u32, Range<f64>), within: f64) {
    let mut edges = 0.0;
    turn_uneven(
        uneven,
        ticks,
        |t| if rest.contains(&t) { 0.0 } else { rpm },
        |t, _, measured| {
            edges = if t <= rest.end { 0.0 } else { counts_per_us(rpm.abs()) * 1e6 * (t - rest.end) };
            // From the third edge on over two poles.
            let within = if edges < 4.0 { within + 0.01 } else { 0.01 };
            let off = (measured - rpm).abs();
            assert!(edges < 2.5 || off < rpm.abs() * within, "{measured} rpm after {edges} edges, not {rpm}");
        },
    );
    let least = if rpm.abs() < 10.0 { 25.0 } else { 100.0 };
    assert!(edges > least);
}

#[test]
fn an_edge_back_and_forth_is_no_motion() {
    let scale = centi_rpm_scale(COUNTS_PER_TURN as f32);
    let (mut encoder, mut filter, mut position) = (Encoder::default(), Filter::new(), 0);
    for tick in 0..200 {
        // Channel 2 is dead: each edge of channel 1 goes back on the one before.
        feed(&mut filter, tick % 2 == 0, false, tick * TICK_US + 4000);
        let motion = encoder.update(&take(&mut filter, (tick + 1) * TICK_US), Micros((tick + 1) * TICK_US), scale);
        position += motion.counts;
        assert!((0..=1).contains(&position) && motion.edges == 1);
        assert!(tick < 2 || motion.speed == CentiRpm(0), "{motion:?}");
    }
}

/// Returns the edges that the filter finds for one to high at 10,000 µs and one to low at 12,000 µs, with a spike of 3 µs.
fn spike_at(start: u32, seen: bool, offset: u32) -> Edges {
    let mut filter = Filter::new();
    let mut line = false;
    for us in 0..15_000 {
        let level = (10_000..12_000).contains(&us);
        let spike = (start..start + 3).contains(&us);
        if spike && !seen {
            // The interrupt comes so late that it finds the earlier level.
            feed(&mut filter, level, us >= 11_000, offset.wrapping_add(us));
        } else if (level != spike) != line {
            line = level != spike;
            feed(&mut filter, line, us >= 11_000, offset.wrapping_add(us));
        }
    }
    take(&mut filter, offset.wrapping_add(15_000))
}

#[test]
fn a_spike_changes_neither_the_count_nor_the_time() {
    for offset in [1_000_000, 0u32.wrapping_sub(10_020), 0u32.wrapping_sub(12_050)] {
        for start in (9000..13_000).chain([5000, 14_000]) {
            let edges = spike_at(start, true, offset);
            assert_eq!((edges.last.count, edges.before.count, edges.number), (2, 1, 2), "{start}");
            for (edge, true_us) in [(edges.before, 10_000), (edges.last, 12_000u32)] {
                let late = edge.time.since(Micros(offset.wrapping_add(true_us))) as i32;
                // A spike that overlaps a true edge moves it, and so does a spike so close that either may be the edge.
                assert!(late == 0 || late.abs() <= 6 && start.abs_diff(true_us) <= 6, "{late} µs, {start}");
            }
            assert!(edges.glitches == 2 || [9997, 10_000, 11_997, 12_000].contains(&start), "{start}");
        }
    }
}

#[test]
fn an_interrupt_that_finds_the_level_unchanged_is_rejected() {
    for start in [5000, 9997, 10_000, 10_500, 11_998, 12_000, 13_000] {
        let edges = spike_at(start, false, 0);
        assert_eq!((edges.last.count, edges.number), (2, 2), "{start}");
        assert!((2..=3).contains(&edges.glitches), "{} at {start}", edges.glitches);
    }
}

#[test]
fn the_position_is_right_at_full_speed_among_300_spikes_a_second() {
    for (rpm, uneven) in [(130.0, 0.2), (-130.0, -0.2), (30.0, 0.0), (0.0, 0.0)] {
        let mut shaft = Shaft::new(uneven);
        let mut random = 1u32;
        let (mut left, mut glitches, mut position) = (0u32, 0u32, 0i16);
        for us in 0..5_000_000u32 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if left == 0 && random >> 8 < (1 << 24) / 3333 {
                left = 3;
            }
            shaft.spike = left > 0;
            left = left.saturating_sub(1);
            shaft.position += counts_per_us(rpm);
            // The clock wraps meanwhile.
            let now = us.wrapping_sub(2_000_000);
            shaft.look(now);
            if us % TICK_US == 0 {
                let edges = take(&mut shaft.filter, now);
                assert!(!edges.is_noisy, "{}", edges.glitches);
                glitches += u32::from(edges.glitches);
                if edges.number > 0 {
                    position = edges.last.count;
                }
                // Between spikes.
                let step = i16::from(shaft.filter.step);
                assert!(shaft.spike || position + step == shaft.truth(), "{rpm} rpm at {us} µs");
            }
        }
        assert!((2700..3300).contains(&glitches), "{glitches} edges of 1500 spikes");
    }
}

/// Returns an encoder after 20 edges of 2.5 ms, 39.85 rpm, and its update at a time in µs.
fn turning() -> (Filter, impl FnMut(&mut Filter, u32) -> Motion) {
    let (mut encoder, mut filter) = (Encoder::default(), Filter::new());
    let mut update = move |filter: &mut Filter, now| {
        encoder.update(&take(filter, now), Micros(now), centi_rpm_scale(COUNTS_PER_TURN as f32))
    };
    for edge in 1..=20 {
        feed(&mut filter, edge % 2 == 1, edge % 2 == 0, 2500 * edge);
        update(&mut filter, 2500 * edge + 2000);
    }
    (filter, update)
}

#[test]
fn a_tick_within_a_spike_does_not_take_it() {
    let (mut filter, mut update) = turning();
    let before = update(&mut filter, 52_100);
    assert!((before.speed.rpm() - 39.85).abs() < 0.01);
    // In two ticks, one after the other.
    for begin in [52_200, 52_300] {
        feed(&mut filter, true, false, begin);
        let within = update(&mut filter, begin + 8);
        feed(&mut filter, false, false, begin + 12);
        let after = update(&mut filter, begin + 90);
        assert_eq!((within, after), (before, Motion { glitches: 2, ..before }));
    }
}

#[test]
fn a_spike_on_channel_2_at_an_edge_of_channel_1_does_not_turn_the_direction() {
    for forward in [true, false] {
        let mut filter = Filter::new();
        let (mut edges, mut glitches) = (0, 0);
        for edge in 1..=200u32 {
            let (channel_1, channel_2) = (edge % 2 == 1, (edge % 2 == 0) == forward);
            let is_spike = edge % 7 == 0;
            let mut is_later = false;
            filter.feed(channel_1, channel_2 != is_spike, clock(2500 * edge), || {
                is_later = true;
                channel_2
            });
            assert_eq!(is_later, is_spike || edge == 1, "{edge}: only a turn has to wait");
            let found = take(&mut filter, 2500 * edge + 100);
            edges = found.last.count;
            glitches += found.glitches;
        }
        assert_eq!((edges, glitches), (if forward { 200 } else { -200 }, 0));
    }
}

#[test]
fn an_edge_whose_channel_2_is_disturbed_is_noticed() {
    let mut filter = Filter::new();
    let mut found = Edges::default();
    let mut glitches = 0;
    for edge in 1..=200u32 {
        let channel_2 = (edge % 2 == 0) != (edge % 10 == 0);
        feed(&mut filter, edge % 2 == 1, channel_2, 2500 * edge);
        found = take(&mut filter, 2500 * edge + 100);
        glitches += found.glitches;
    }
    assert_eq!((found.last.count, glitches), (200 - 2 * 20, 19), "the last one is not turned back yet");
    // A shaft that turns round does so once.
    for edge in 201..=300u32 {
        feed(&mut filter, edge % 2 == 1, edge % 2 == 1, 2500 * edge);
        assert_eq!(take(&mut filter, 2500 * edge + 100).glitches, 0, "edge {edge}");
    }
}

#[test]
fn edges_closer_than_60_us_are_a_spike() {
    for (apart, motion) in [(59, (0, 2)), (60, (2, 0))] {
        let mut filter = Filter::new();
        feed(&mut filter, true, false, 10_000);
        feed(&mut filter, false, true, 10_000 + apart);
        let edges = take(&mut filter, 11_000);
        assert_eq!((edges.number, edges.glitches), motion, "{apart} µs");
    }
}

#[test]
fn an_edge_is_taken_when_it_can_no_longer_be_a_spike() {
    for (age, number) in [(0, 0), (59, 0), (60, 1)] {
        let mut filter = Filter::new();
        feed(&mut filter, true, false, 10_000);
        assert_eq!(take(&mut filter, 10_000 + age).number, number, "{age} µs old");
    }
}

#[test]
fn edges_count_from_the_level_at_the_start() {
    let mut filter = Filter::new();
    filter.start(true);
    feed(&mut filter, true, false, 10_000);
    let edges = take(&mut filter, 15_000);
    assert_eq!((edges.number, edges.glitches), (0, 1));
    feed(&mut filter, false, false, 20_000);
    let edges = take(&mut filter, 25_000);
    assert_eq!((edges.number, edges.last), (1, Edge { count: -1, time: Micros(20_000) }));
}

#[test]
fn more_spikes_than_the_limit_are_noise_until_the_next_tick() {
    let mut filter = Filter::new();
    for tick in 0..3 {
        for edge in 1..=60u32 {
            let noisy = feed(&mut filter, edge % 2 == 1, false, tick * TICK_US + 5 * edge);
            assert_eq!(noisy, edge > u32::from(MAX_GLITCHES) + 1, "{edge}");
        }
        assert!(take(&mut filter, (tick + 1) * TICK_US).is_noisy);
        assert!(!take(&mut filter, (tick + 1) * TICK_US).is_noisy);
    }
}

#[test]
fn as_many_spikes_as_the_limit_are_counted() {
    for (edges, is_noisy) in [(MAX_GLITCHES, false), (MAX_GLITCHES + 2, true)] {
        let mut filter = Filter::new();
        for edge in 1..=u32::from(edges) {
            feed(&mut filter, edge % 2 == 1, false, 5 * edge);
        }
        let taken = take(&mut filter, TICK_US);
        assert_eq!((taken.glitches, taken.is_noisy), (edges, is_noisy));
    }
}

#[test]
fn a_speed_too_high_for_its_number_saturates() {
    let (mut encoder, mut filter) = (Encoder::default(), Filter::new());
    for edge in 1..=3 {
        feed(&mut filter, edge % 2 == 1, edge % 2 == 1, 400 * edge);
        let now = 400 * edge + 200;
        let motion = encoder.update(&take(&mut filter, now), Micros(now), centi_rpm_scale(1.0));
        assert_eq!(motion.speed, CentiRpm(if edge == 1 { 0 } else { -i16::MAX }));
    }
}

#[test]
fn spikes_in_step_with_the_pwm_are_counted_and_are_no_noise_up_to_four_for_each_of_its_edges() {
    let mut filter = Filter::new();
    for (spikes, is_noisy) in [(40, false), (80, false), (81, true), (0, false)] {
        let edges = filter.take(Micros(TICK_US), clock(TICK_US), spikes);
        assert_eq!((edges.glitches, edges.is_noisy), (spikes, is_noisy));
    }
}
