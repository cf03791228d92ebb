//! What the sensor measures: lying still, a recording, or the movement of the simulated robot.

use super::noise::Noise;
use super::part::{Part, ROOM_C};
use super::recording::{Recording, Sample};
use crate::plant::{Movement, Plant};
use protocol::units::{AccelRange, GyroRange, LOW_PASS, TemperatureCounts};

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
    Still,
    Plant(Box<Plant>),
    Recording {
        recording: Recording,
        /// The board's time at which the playback began; `None` while it waits.
        started_s: Option<f64>,
        play: bool,
    },
}

/// The input of the sensor, with the sensor's own bias and noise where these are not in a recording.
pub struct Source {
    kind: Kind,
    noise: Noise,
    part: Part,
}

/// Gyroscope noise, °/s per root Hz (data sheet PS-MPU-6000A, table 6.1).
const GYRO_NOISE_DPS: f64 = 0.005;
/// Accelerometer noise, g per root Hz (table 6.2).
const ACCEL_NOISE_G: f64 = 400e-6;

impl Source {
    /// Lies still, z up, with the bias that the seed gives.
    pub fn still(seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let mut part = Part::drawn(&mut noise);
        part.warming_c = 0.0;
        Self { kind: Kind::Still, noise, part }
    }

    /// Sits on a simulated robot, with the imperfections that the seed gives. The sensor's axes are the robot's.
    pub fn plant(plant: Plant, seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let part = Part::drawn(&mut noise);
        Self { kind: Kind::Plant(Box::new(plant)), noise, part }
    }

    /// Holds the sensor at the start of the recording until [`Self::play`].
    pub fn recording(recording: Recording, seed: u64) -> Self {
        Self {
            kind: Kind::Recording { recording, started_s: None, play: false },
            noise: Noise::new(seed),
            part: Part::ideal(),
        }
    }

    /// Starts the recording with the next sample. Returns its duration in s, `None` where there is none.
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

    /// Returns the simulated robot that the sensor sits on, if it does.
    pub fn plant_mut(&mut self) -> Option<&mut Plant> {
        match &mut self.kind {
            Kind::Plant(plant) => Some(plant),
            _ => None,
        }
    }

    /// Returns the simulated robot that the sensor sits on, if it does.
    pub fn plant_ref(&self) -> Option<&Plant> {
        match &self.kind {
            Kind::Plant(plant) => Some(plant),
            _ => None,
        }
    }

    /// What sets the sensor apart from an ideal one.
    pub fn part(&self) -> &Part {
        &self.part
    }

    /// The sample at this time of the board's, for these settings of the part.
    pub fn read(&mut self, time_s: f64, gyro: GyroRange, accel: AccelRange, low_pass: u8) -> Readout {
        // The last value is reserved; the part then filters as little as it can.
        let (bandwidth_hz, delay_s) = LOW_PASS.get(usize::from(low_pass)).unwrap_or(&LOW_PASS[0]);
        let gyro_noise = GYRO_NOISE_DPS * bandwidth_hz.sqrt();
        let accel_noise = ACCEL_NOISE_G * bandwidth_hz.sqrt();
        let Self { kind, noise, part } = self;
        let per_dps = f64::from(gyro.counts_per_dps());
        let per_g = f64::from(accel.counts_per_g());
        let mut measure = |movement: Movement| {
            let temperature_c = part.temperature_c(time_s, movement.temperature_c);
            let (gyro_bias, accel_bias) = part.bias(time_s, temperature_c, noise);
            let rate = |i: usize| movement.rate_dps[i] + gyro_bias[i] + gyro_noise * noise.normal();
            let gyro = [0, 1, 2].map(rate).map(|dps| counts(dps * per_dps));
            let force = |i: usize| movement.specific_force_g[i] + accel_bias[i] + accel_noise * noise.normal();
            let accel = [0, 1, 2].map(force).map(|g| counts(g * per_g));
            Readout { accel, gyro, temperature: TemperatureCounts::from_celsius(temperature_c).0 }
        };
        match kind {
            Kind::Still => {
                measure(Movement { specific_force_g: [0.0, 0.0, 1.0], temperature_c: ROOM_C, ..Movement::default() })
            }
            Kind::Plant(plant) => measure(plant.movement(time_s - delay_s)),
            Kind::Recording { recording, started_s, play } => {
                if *play && started_s.is_none() {
                    *started_s = Some(time_s);
                }
                // A recording brings its own noise; at rest the sensor has the data sheet's.
                let at_rest = |sample: Sample, noise: &mut Noise| {
                    let accel_step = accel_noise * f64::from(recording.accel_range.counts_per_g());
                    let gyro_step = gyro_noise * f64::from(recording.gyro_range.counts_per_dps());
                    Sample {
                        accel: sample.accel.map(|x| x + accel_step * noise.normal()),
                        gyro: sample.gyro.map(|x| x + gyro_step * noise.normal()),
                        ..sample
                    }
                };
                let sample = match started_s.map(|start| time_s - start) {
                    None => at_rest(recording.rest_before(), noise),
                    Some(elapsed) if elapsed > recording.duration_s() => at_rest(recording.rest_after(), noise),
                    Some(elapsed) => recording.at(elapsed),
                };
                let gyro_scale = per_dps / f64::from(recording.gyro_range.counts_per_dps());
                let accel_scale = per_g / f64::from(recording.accel_range.counts_per_g());
                Readout {
                    accel: sample.accel.map(|x| counts(x * accel_scale)),
                    gyro: sample.gyro.map(|x| counts(x * gyro_scale)),
                    temperature: counts(sample.temperature),
                }
            }
        }
    }
}

/// Rounds, and saturates as the part does.
fn counts(x: f64) -> i16 {
    x.round() as i16
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn data(name: &str) -> Recording {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/mpu6050/");
        Recording::read(&Path::new(folder).join(name)).unwrap()
    }

    #[test]
    fn a_recording_passes_unchanged_at_its_own_ranges() {
        let mut source = Source::recording(data("rotate-z-720.csv"), 1);
        let read = |source: &mut Source, time| source.read(time, GyroRange::Dps250, AccelRange::G8, 3);
        let waiting = read(&mut source, 5.0);
        assert_ne!(waiting, read(&mut source, 5.005), "frozen while it waits");
        assert!((source.play().unwrap() - 23.985).abs() < 1e-3);
        let first = read(&mut source, 6.0);
        assert_eq!((first.accel, first.gyro), ([50, -547, -4086], [964, -1054, -1147]));
        assert_eq!(read(&mut source, 6.006).gyro, [1404, -1535, -1104]);
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
        let scaled = source.read(0.0, GyroRange::Dps500, AccelRange::G2, 3);
        assert_eq!((scaled.accel, scaled.gyro), ([200, -2188, -16344], [482, -527, -574]));
        assert_eq!(counts(1e6), i16::MAX);
        assert_eq!(counts(-1e6), i16::MIN);
    }

    #[test]
    fn the_same_seed_gives_the_same_noise() {
        let read = |seed| {
            let mut source = Source::still(seed);
            [0.0, 0.01, 0.02].map(|time| source.read(time, GyroRange::Dps250, AccelRange::G2, 3))
        };
        assert_eq!(read(4), read(4));
        assert_ne!(read(4), read(5));
    }
}
