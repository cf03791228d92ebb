//! The input of the sensor: the movement of a hand, a recording, or the movement of the simulated robot.

use super::errors::Errors;
use super::hand::{Grip, Hand};
use super::noise::Noise;
use super::part::{Part, ROOM_C, Signal};
use super::recording::{Recording, Sample};
use super::scale::{LowPass, Range, celsius, counts, temperature_counts};
use crate::plant::{Movement, Plant};
use std::f64::consts::TAU;

/// One sample in counts, as the data registers have it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Readout {
    /// Acceleration.
    pub accel: [i16; 3],
    /// Rate of turn.
    pub gyro: [i16; 3],
    /// Temperature.
    pub temperature: i16,
}

enum Kind {
    Hand(Hand),
    Turntable(Turntable),
    Plant(Box<Plant>),
    Recording {
        recording: Recording,
        /// The board's time at which the playback began; `None` while it waits.
        started_s: Option<f64>,
        play: bool,
    },
}

/// The input of the sensor, with the sensor's own bias and noise unless a recording has them.
pub struct Source {
    kind: Kind,
    noise: Noise,
    /// The part, with its deviations from an ideal sensor.
    pub part: Part,
    /// An additional turn about z, °/s.
    pub spin_dps: f64,
    /// An additional turn about all axes at once, °/s.
    pub shaken_dps: f64,
}

/// A table that turns about the vertical, with the sensor fixed to it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Turntable {
    /// The vertical in the sensor's axes, of length 1.
    pub up: [f64; 3],
    /// Speed, counter-clockwise seen from above, °/s.
    pub dps: f64,
    /// Frequency of turning back and forth, Hz, with a speed of at most `dps`. At 0 it turns at that speed.
    pub swing_hz: f64,
    /// The board's time at which it starts to turn, s.
    pub start_s: f64,
}

impl Turntable {
    fn movement(&self, time_s: f64) -> Movement {
        let swing = (TAU * self.swing_hz * (time_s - self.start_s)).cos();
        let dps = if time_s >= self.start_s { self.dps * swing } else { 0.0 };
        Movement { rate_dps: self.up.map(|part| part * dps), specific_force_g: self.up, temperature_c: ROOM_C }
    }
}

impl Source {
    fn new(kind: Kind, errors: Errors, seed: u64) -> Self {
        // A separate sequence: otherwise the first noise would repeat the random numbers of the errors.
        let noise = Noise::new(seed ^ 0x4E4F_4953_4500_0000);
        Self { kind, noise, part: Part::new(errors), spin_dps: 0.0, shaken_dps: 0.0 }
    }

    /// Returns a sensor that lies still, z up, at its final temperature, with biases from the seed.
    pub fn still(seed: u64) -> Self {
        Self::hand(Grip::default(), Errors { warming_c: 0.0, ..Errors::ideal(seed) }, seed)
    }

    /// Returns a sensor that lies still, z up, until a hand turns it. The seed gives the noise and the hand's errors.
    pub fn hand(grip: Grip, errors: Errors, seed: u64) -> Self {
        Self::new(Kind::Hand(Hand::new(grip, seed)), errors, seed)
    }

    /// Returns a sensor on a turntable, with noise as its only error.
    pub fn turntable(table: Turntable, seed: u64) -> Self {
        Self::new(Kind::Turntable(table), Errors::white(), seed)
    }

    /// Returns a sensor on a simulated robot. The seed gives the noise.
    pub fn plant(plant: Plant, errors: Errors, seed: u64) -> Self {
        Self::new(Kind::Plant(Box::new(plant)), errors, seed)
    }

    /// Holds the sensor at the start of the recording until [`Self::play`].
    pub fn recording(recording: Recording, seed: u64) -> Self {
        Self::new(Kind::Recording { recording, started_s: None, play: false }, Errors::white(), seed)
    }

    /// Starts the recording with the next sample. Returns its duration in s, `None` without a recording.
    pub fn play(&mut self) -> Option<f64> {
        let Kind::Recording { recording, started_s, play } = &mut self.kind else { return None };
        *started_s = None;
        *play = true;
        Some(recording.duration_s())
    }

    /// Holds the sensor at the start of the recording until [`Self::play`].
    pub fn rewind(&mut self) {
        if let Kind::Recording { started_s, play, .. } = &mut self.kind {
            (*started_s, *play) = (None, false);
        }
    }

    /// Returns the hand that holds the sensor, if one does.
    pub fn hand_mut(&mut self) -> Option<&mut Hand> {
        let Kind::Hand(hand) = &mut self.kind else { return None };
        Some(hand)
    }

    /// Returns whether a hand moves the sensor at a time, or will move it later.
    pub fn is_moving(&self, time_s: f64) -> bool {
        matches!(&self.kind, Kind::Hand(hand) if hand.is_moving(time_s))
    }

    /// Returns the simulated robot that the sensor sits on, if it does.
    pub fn plant_mut(&mut self) -> Option<&mut Plant> {
        let Kind::Plant(plant) = &mut self.kind else { return None };
        Some(plant)
    }

    /// Returns the simulated robot that the sensor sits on, if it does.
    pub fn plant_ref(&self) -> Option<&Plant> {
        let Kind::Plant(plant) = &self.kind else { return None };
        Some(plant)
    }

    /// Returns the sample at this time of the board, with these settings of the part.
    pub fn read(&mut self, time_s: f64, gyro: Range, accel: Range, low_pass: LowPass) -> Readout {
        let Self { kind, noise, part, spin_dps, shaken_dps } = self;
        let (signal, is_noisy) = match kind {
            Kind::Hand(hand) => (part.measure(&hand.movement(time_s - low_pass.delay_s), time_s, noise), true),
            Kind::Turntable(table) => (part.measure(&table.movement(time_s), time_s, noise), true),
            Kind::Plant(plant) => (part.measure(&plant.movement(time_s - low_pass.delay_s), time_s, noise), true),
            Kind::Recording { recording, started_s, play } => {
                if *play && started_s.is_none() {
                    *started_s = Some(time_s);
                }
                // A recording brings its own noise; at rest the sensor has the data sheet's.
                let (sample, is_noisy) = match started_s.map(|start| time_s - start) {
                    None => (recording.rest_before(), true),
                    Some(elapsed) if elapsed > recording.duration_s() => (recording.rest_after(), true),
                    Some(elapsed) => (recording.at(elapsed), false),
                };
                (recorded(recording, &sample), is_noisy)
            }
        };
        let (gyro_noise, accel_noise) =
            if is_noisy { part.white(time_s, low_pass, noise) } else { ([0.0; 3], [0.0; 3]) };
        let [x, y, z] = signal.rate_dps;
        let add = |values: [f64; 3], noise: [f64; 3]| std::array::from_fn(|i| values[i] + noise[i]);
        let rate_dps: [f64; 3] = add([x, y, z + *spin_dps].map(|dps| dps + *shaken_dps), gyro_noise);
        let force_g: [f64; 3] = add(signal.force_g, accel_noise);
        Readout {
            accel: force_g.map(|g| counts(g * accel.counts_per_unit)),
            gyro: rate_dps.map(|dps| counts(dps * gyro.counts_per_unit)),
            temperature: counts(temperature_counts(signal.temperature_c)),
        }
    }
}

fn recorded(recording: &Recording, sample: &Sample) -> Signal {
    Signal {
        rate_dps: sample.gyro.map(|x| x / recording.gyro_range.counts_per_unit),
        force_g: sample.accel.map(|x| x / recording.accel_range.counts_per_unit),
        temperature_c: celsius(sample.temperature),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu::scale::{ACCEL, GYRO, LOW_PASS};
    use std::path::Path;

    fn data(name: &str) -> Recording {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/mpu6050/");
        Recording::read(&Path::new(folder).join(name)).unwrap()
    }

    #[test]
    fn a_recording_passes_unchanged_at_its_own_ranges() {
        let mut source = Source::recording(data("rotate-z-720.csv"), 1);
        let read = |source: &mut Source, time| source.read(time, GYRO[0], ACCEL[2], LOW_PASS[3]);
        let waiting = read(&mut source, 5.0);
        assert_ne!(waiting, read(&mut source, 5.005), "frozen while it waits");
        assert!((source.play().unwrap() - 23.985).abs() < 1e-3);
        let first = read(&mut source, 6.0);
        assert_eq!((first.accel, first.gyro), ([50, -547, -4086], [964, -1054, -1147]));
        assert_eq!(read(&mut source, 6.00571).gyro, [1404, -1535, -1104]);
        let after: Vec<i16> = (0..100).map(|i| read(&mut source, 31.0 + 0.005 * f64::from(i)).gyro[0]).collect();
        assert!(after.iter().any(|x| *x != after[0]), "frozen after its end");
        source.rewind();
        let again = read(&mut source, 33.0).accel;
        assert!((0..3).all(|i| (again[i] - waiting.accel[i]).abs() < 100), "{again:?}, not {waiting:?}");
    }

    #[test]
    fn other_ranges_scale_and_saturate() {
        let mut source = Source::recording(data("rotate-z-720.csv"), 1);
        source.play();
        let scaled = source.read(0.0, GYRO[1], ACCEL[0], LOW_PASS[3]);
        assert_eq!((scaled.accel, scaled.gyro), ([200, -2188, -16344], [482, -527, -574]));
        assert_eq!(counts(1e6), i16::MAX);
        assert_eq!(counts(-1e6), i16::MIN);
    }

    /// The walk of the integrated readings, as counts and at the rate of the firmware's ticks, against the data sheet.
    #[test]
    fn the_integrated_rate_walks_as_the_data_sheets_density_says() {
        const RATE_HZ: usize = 200;
        for low_pass in [2, 3, 4] {
            let mut source =
                Source::turntable(Turntable { up: [0.0, 0.0, 1.0], dps: 0.0, swing_hz: 0.0, start_s: 0.0 }, 5);
            let (mut rate_squares, mut force_squares, mut seconds) = (0.0, 0.0, 0.0);
            let mut sample = 0;
            let mut turned_in_a_second = || {
                let (mut angle, mut speed) = ([0.0; 3], [0.0; 3]);
                for _ in 0..RATE_HZ {
                    let time_s = sample as f64 / RATE_HZ as f64;
                    sample += 1;
                    let Readout { gyro, accel, .. } = source.read(time_s, GYRO[0], ACCEL[0], LOW_PASS[low_pass]);
                    for i in 0..3 {
                        angle[i] += f64::from(gyro[i]) / 131.0 / RATE_HZ as f64;
                        speed[i] += (f64::from(accel[i]) / 16384.0 - f64::from(i == 2)) / RATE_HZ as f64;
                    }
                }
                (angle, speed)
            };
            for _ in 0..1000 {
                let (angle, speed) = turned_in_a_second();
                rate_squares += angle.iter().map(|x| x * x).sum::<f64>();
                force_squares += speed.iter().map(|x| x * x).sum::<f64>();
                seconds += 3.0;
            }
            // One-sided density / √2 is the walk in a root of a second.
            let density = |squares: f64| (2.0 * squares / seconds).sqrt();
            let (gyro, accel) = (density(rate_squares), density(force_squares));
            println!("filter {low_pass}: {gyro:.6} deg/s/sqrt(Hz), {accel:.2e} g/sqrt(Hz)");
            assert!((gyro / 0.005 - 1.0).abs() < 0.06, "filter {low_pass}: {gyro}");
            assert!((accel / 400e-6 - 1.0).abs() < 0.06, "filter {low_pass}: {accel}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_noise() {
        let read = |seed| {
            let mut source = Source::still(seed);
            [0.0, 0.01, 0.02].map(|time| source.read(time, GYRO[0], ACCEL[0], LOW_PASS[3]))
        };
        assert_eq!(read(4), read(4));
        assert_ne!(read(4), read(5));
    }

    #[test]
    fn a_turntable_turns_about_the_vertical() {
        let table = Turntable { up: [0.6, 0.0, 0.8], dps: 100.0, swing_hz: 0.0, start_s: 1.0 };
        let mut source = Source::turntable(table, 1);
        let mut read = |time_s| source.read(time_s, GYRO[0], ACCEL[0], LOW_PASS[6]);
        assert!(read(0.9).gyro.iter().all(|x| x.abs() < 10));
        let Readout { gyro, accel, .. } = read(1.0);
        for i in 0..3 {
            assert!((f64::from(gyro[i]) - table.up[i] * 13100.0).abs() < 10.0, "{gyro:?}");
            assert!((f64::from(accel[i]) - table.up[i] * 16384.0).abs() < 80.0, "{accel:?}");
        }
    }

    #[test]
    fn scale_axes_and_range_of_a_bad_part_show() {
        let mut source =
            Source::turntable(Turntable { up: [0.0, 0.0, 1.0], dps: 100.0, swing_hz: 0.0, start_s: 0.0 }, 1);
        let mut read = |change: &dyn Fn(&mut Source)| {
            change(&mut source);
            source.read(0.0, GYRO[0], ACCEL[0], LOW_PASS[6]).gyro.map(f64::from)
        };
        let scaled = read(&|source| source.part.scale = 0.03);
        assert!((scaled[2] - 13493.0).abs() < 10.0, "{scaled:?}");
        let askew = read(&|source| (source.part.scale, source.part.askew) = (0.0, 0.02));
        assert!((askew[1] - 262.0).abs() < 10.0 && (askew[2] - 13100.0).abs() < 10.0, "{askew:?}");
        assert_eq!(read(&|source| source.spin_dps = -400.0)[2], f64::from(i16::MIN));
    }
}
