use super::*;

const TICK_US: u32 = 5000;
const COUNTS_PER_TURN: f64 = 602.22;

/// A shaft with its encoder and the line of channel 1.
struct Shaft {
    /// In counts.
    position: f64,
    /// By how much the poles differ from their mean.
    uneven: f64,
    /// Whether a spike inverts channel 1.
    spike: bool,
    line: bool,
    edges: Edges,
}

impl Shaft {
    fn new(uneven: f64) -> Self {
        Self { position: 0.5, uneven, spike: false, line: false, edges: Edges::new() }
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
            self.edges.feed(level, self.is_high(self.position - 0.5), Micros(now));
        }
    }

    /// Edges between the start and here.
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
        let motion = encoder.update(&shaft.edges, Micros(tick * TICK_US), scale);
        shaft.edges.begin_tick();
        position += i16::from(motion.counts);
        let is_settled = (tick * TICK_US).wrapping_sub(shaft.edges.last.time.0) >= SETTLED_US;
        assert!(position == shaft.truth() || !is_settled && motion.edges == 0, "{position} of {}", shaft.truth());
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
    let mut edges = Edges::new();
    edges.feed(true, false, Micros(1000));
    encoder.update(&edges, Micros(5000), scale);
    let mut now = 5000u32;
    for _ in 0..(1u64 << 32) / 500_000 + 10 {
        now = now.wrapping_add(500_000);
        encoder.update(&edges, Micros(now), scale);
    }
    assert_eq!(encoder.update(&edges, Micros(now), scale), Motion::default());
    edges.feed(false, true, Micros(now.wrapping_add(100)));
    let motion = encoder.update(&edges, Micros(now.wrapping_add(5000)), scale);
    assert!(motion.speed.0 <= 10 && (motion.counts, motion.edges) == (1, 1), "{motion:?}");
    edges.feed(true, false, Micros(now.wrapping_add(10_100)));
    let motion = encoder.update(&edges, Micros(now.wrapping_add(15_000)), scale);
    assert!((motion.speed.rpm() - 9.96).abs() < 0.01, "from the second edge on: {motion:?}");
}

#[test]
fn an_edge_back_and_forth_is_no_motion() {
    let scale = centi_rpm_scale(COUNTS_PER_TURN as f32);
    let (mut encoder, mut edges, mut position) = (Encoder::default(), Edges::new(), 0);
    for tick in 0..200 {
        // Channel 2 is dead: each edge of channel 1 goes back on the one before.
        edges.feed(tick % 2 == 0, false, Micros(tick * TICK_US + 4000));
        let motion = encoder.update(&edges, Micros((tick + 1) * TICK_US), scale);
        position += motion.counts;
        assert!((0..=1).contains(&position) && motion.edges == 1);
        assert!(tick < 2 || motion.speed == CentiRpm(0), "{motion:?}");
    }
}

/// What a spike of 3 µs at this time makes of an edge to high at 10,000 µs and one to low at 12,000 µs.
fn spike_at(start: u32, seen: bool, clock: u32) -> Edges {
    let mut edges = Edges::new();
    edges.last.time = Micros(clock.wrapping_sub(10_000));
    let mut line = false;
    for us in 0..15_000 {
        let level = (10_000..12_000).contains(&us);
        let spike = (start..start + 3).contains(&us);
        if spike && !seen {
            // The interrupt comes so late that it finds the level of before.
            edges.feed(level, us >= 11_000, Micros(clock.wrapping_add(us)));
        } else if (level != spike) != line {
            line = level != spike;
            edges.feed(line, us >= 11_000, Micros(clock.wrapping_add(us)));
        }
    }
    edges
}

#[test]
fn a_spike_changes_neither_the_count_nor_the_time() {
    for clock in [1_000_000, 0u32.wrapping_sub(10_020), 0u32.wrapping_sub(12_050)] {
        for start in (9000..13_000).chain([5000, 14_000]) {
            let edges = spike_at(start, true, clock);
            let late = edges.last.time.since(Micros(clock.wrapping_add(12_000))) as i32;
            assert_eq!((edges.last.count, edges.accepted, edges.level), (2, 2, false), "{start}");
            // One that overlaps a true edge moves it, and so does one right after it.
            let (overlaps, follows) = ((11_997..=12_000).contains(&start), (12_001..12_060).contains(&start));
            assert!(late == 0 || overlaps && late.abs() <= 3 || follows && late < 63, "{late} µs, {start}");
            assert!(edges.rejected == 2 || [9997, 10_000, 11_997, 12_000].contains(&start), "{start}");
        }
    }
}

#[test]
fn an_interrupt_that_finds_the_level_unchanged_is_rejected() {
    for start in [5000, 9997, 10_000, 10_500, 11_998, 12_000, 13_000] {
        let edges = spike_at(start, false, 0);
        assert_eq!((edges.last.count, edges.accepted), (2, 2), "{start}");
        assert!((2..=3).contains(&edges.rejected), "{} at {start}", edges.rejected);
    }
}

#[test]
fn the_position_is_right_at_full_speed_among_300_spikes_a_second() {
    for (rpm, uneven) in [(130.0, 0.2), (-130.0, -0.2), (30.0, 0.0), (0.0, 0.0)] {
        let mut shaft = Shaft::new(uneven);
        let mut random = 1u32;
        let (mut left, mut rejected) = (0u32, 0u32);
        for us in 0..5_000_000u32 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if left == 0 && random >> 8 < (1 << 24) / 3333 {
                left = 3;
            }
            shaft.spike = left > 0;
            left = left.saturating_sub(1);
            let before = shaft.edges.rejected;
            shaft.position += counts_per_us(rpm);
            // The clock wraps meanwhile.
            shaft.look(us.wrapping_sub(2_000_000));
            rejected += u32::from(shaft.edges.rejected.wrapping_sub(before));
            if us % TICK_US == 0 {
                assert!(!shaft.edges.is_noisy(), "{}", shaft.edges.interrupts);
                shaft.edges.begin_tick();
            }
            // Between spikes, and with the last edge settled.
            if !shaft.spike && us % 1000 == 0 {
                assert_eq!(shaft.edges.last.count, shaft.truth(), "{rpm} rpm at {us} µs");
            }
        }
        assert!((2700..3300).contains(&rejected), "{rejected} edges of 1500 spikes");
    }
}

/// An encoder after 20 edges of 2.5 ms, 39.85 rpm, and its update at a time in µs.
fn turning() -> (Edges, impl FnMut(&Edges, u32) -> Motion) {
    let (mut encoder, mut edges) = (Encoder::default(), Edges::new());
    let mut update =
        move |edges: &Edges, now| encoder.update(edges, Micros(now), centi_rpm_scale(COUNTS_PER_TURN as f32));
    for edge in 1..=20 {
        edges.feed(edge % 2 == 1, edge % 2 == 0, Micros(2500 * edge));
        update(&edges, 2500 * edge + 2000);
    }
    (edges, update)
}

#[test]
fn a_tick_within_a_spike_does_not_take_it() {
    let (mut edges, mut update) = turning();
    let before = update(&edges, 52_100);
    edges.feed(true, false, Micros(52_200));
    let within = update(&edges, 52_215);
    edges.feed(false, false, Micros(52_212));
    let after = update(&edges, 52_300);
    assert!((before.speed.rpm() - 39.85).abs() < 0.01);
    assert_eq!((within, after), (before, Motion { glitches: 2, ..before }));
}

#[test]
fn a_spike_within_each_of_two_ticks_is_taken_and_given_back() {
    let (mut edges, mut update) = turning();
    edges.feed(true, false, Micros(52_200));
    assert_eq!(update(&edges, 52_215).counts, 0, "the first one is left to the next tick");
    edges.feed(false, false, Micros(52_212));
    edges.feed(true, false, Micros(52_300));
    let within = update(&edges, 52_310);
    edges.feed(false, false, Micros(52_312));
    let after = update(&edges, 52_450);
    assert_eq!([within, after].map(|motion| (motion.counts, motion.edges, motion.glitches)), [(1, 1, 2), (-1, -1, 2)]);
    assert!((after.speed.rpm() - 39.85).abs() < 2.0, "{after:?}");
}

#[test]
fn edges_closer_than_60_us_are_a_spike() {
    for (apart, motion) in [(59, (0, 0, 2)), (60, (2, 2, 0))] {
        let mut edges = Edges::new();
        edges.feed(true, false, Micros(10_000));
        edges.feed(false, true, Micros(10_000 + apart));
        assert_eq!((edges.last.count, edges.accepted, edges.rejected), motion, "{apart} µs");
    }
}

#[test]
fn an_edge_is_taken_when_it_can_no_longer_be_a_spike() {
    for (age, counts) in [(0, 0), (119, 0), (120, 1)] {
        let (mut encoder, mut edges) = (Encoder::default(), Edges::new());
        edges.feed(true, false, Micros(10_000));
        let scale = centi_rpm_scale(COUNTS_PER_TURN as f32);
        assert_eq!(encoder.update(&edges, Micros(10_000 + age), scale).counts, counts, "{age} µs old");
    }
}

#[test]
fn edges_count_from_the_level_at_the_start() {
    let mut edges = Edges::new();
    edges.start(true);
    edges.feed(true, false, Micros(10_000));
    assert_eq!((edges.accepted, edges.rejected), (0, 1));
    edges.feed(false, false, Micros(20_000));
    assert_eq!((edges.accepted, edges.last.count), (1, -1));
}

#[test]
fn more_edges_than_motion_makes_are_noise_until_the_next_tick() {
    let mut edges = Edges::new();
    for _ in 0..3 {
        for interrupt in 1..=60u8 {
            let noisy = edges.feed(interrupt % 2 == 0, false, Micros(u32::from(interrupt) * 5));
            assert_eq!((noisy, edges.is_noisy()), (interrupt > 24, interrupt > 24));
        }
        edges.begin_tick();
        assert!(!edges.is_noisy());
    }
}

#[test]
fn a_speed_too_high_for_its_number_saturates() {
    let (mut encoder, mut edges) = (Encoder::default(), Edges::new());
    for edge in 1..=3 {
        edges.feed(edge % 2 == 1, edge % 2 == 1, Micros(400 * edge));
        let motion = encoder.update(&edges, Micros(400 * edge + 200), centi_rpm_scale(1.0));
        assert_eq!(motion.speed, CentiRpm(if edge == 1 { 0 } else { -i16::MAX }));
    }
}
