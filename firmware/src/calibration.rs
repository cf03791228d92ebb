//! The gyroscope's bias: the mean of its readings while the robot is at rest. In counts, sensor axes.

use protocol::Calibration;
use protocol::units::{GyroRange, SensorCounts};

use crate::attitude::inverse_sqrt;
use crate::round_to_i16;

/// The largest standard deviation of a sensor at rest, °/s. The MPU6050's own noise is 0.05 °/s behind a filter of 92 Hz
/// (data sheet PS-MPU-6000A, table 6.1); in a hand it reads several °/s.
const STILL_NOISE_DPS: f32 = 0.5;

/// The largest bias of a sensor at rest, °/s: the data sheet's zero-rate output. A larger mean is a steady rotation.
const STILL_BIAS_DPS: f32 = 20.0;

/// A calibration in progress.
#[derive(Debug)]
pub struct GyroAverage {
    ticks_left: u16,
    samples: u16,
    axes: [AxisSums; 3],
}

#[derive(Clone, Copy, Debug, Default)]
struct AxisSums {
    /// The first reading, subtracted from all others, because sums of small numbers lose no digits.
    first: i16,
    sum: i32,
    square_sum: f32,
}

impl GyroAverage {
    /// Returns an average over the next `ticks`, at most 12,000.
    pub fn new(ticks: u16) -> Self {
        Self { ticks_left: ticks, samples: 0, axes: Default::default() }
    }

    /// Advances one tick, with its reading if there was one.
    pub fn update(&mut self, gyro: Option<[SensorCounts; 3]>) {
        if let Some(gyro) = gyro {
            for (axis, counts) in self.axes.iter_mut().zip(gyro) {
                if self.samples == 0 {
                    axis.first = counts.0;
                }
                let offset = i32::from(counts.0) - i32::from(axis.first);
                axis.sum += offset;
                let offset = offset as f32;
                axis.square_sum += offset * offset;
            }
            self.samples += 1;
        }
        self.ticks_left = self.ticks_left.saturating_sub(1);
    }

    /// Returns whether the calibration is over.
    pub fn is_over(&self) -> bool {
        self.ticks_left == 0
    }

    /// Returns the result so far.
    pub fn result(&self, range: GyroRange) -> Calibration {
        if self.samples == 0 {
            return Calibration::default();
        }
        let counts_per_dps = range.counts_per_dps();
        let mut result = Calibration { still: true, samples: self.samples, ..Calibration::default() };
        for (axis, bias) in self.axes.iter().zip(&mut result.bias) {
            let (mean, deviation) = axis.mean_and_deviation(f32::from(self.samples));
            *bias = mean;
            result.noise = result.noise.max(round_to_i16(deviation, 0).unsigned_abs());
            if mean.abs() > STILL_BIAS_DPS * counts_per_dps || deviation > STILL_NOISE_DPS * counts_per_dps {
                result.still = false;
            }
        }
        result
    }
}

impl AxisSums {
    fn mean_and_deviation(&self, samples: f32) -> (f32, f32) {
        let mean = self.sum as f32 / samples;
        let variance = self.square_sum / samples - mean * mean;
        let deviation = if variance > 0.0 { variance * inverse_sqrt(variance) } else { 0.0 };
        (f32::from(self.first) + mean, deviation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(readings: impl IntoIterator<Item = [i16; 3]>, range: GyroRange) -> Calibration {
        let mut average = GyroAverage::new(12_000);
        for reading in readings {
            average.update(Some(reading.map(SensorCounts)));
        }
        average.result(range)
    }

    /// Returns repeatable noise with this standard deviation, counts.
    fn noise(index: u32, deviation: f64) -> f64 {
        let uniform = f64::from(index.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24) - 0.5;
        uniform * deviation * 12f64.sqrt()
    }

    #[test]
    fn the_mean_of_a_minute_is_found_to_a_hundredth_of_a_count() {
        let readings: Vec<_> =
            (0..12_000).map(|i| [594.0, 6.2, -19_000.0].map(|mean| (mean + noise(i, 16.0)).round() as i16)).collect();
        let result = run(readings.iter().copied(), GyroRange::Dps250);
        for axis in 0..3 {
            let mean = readings.iter().map(|reading| f64::from(reading[axis])).sum::<f64>() / 12_000.0;
            assert!((f64::from(result.bias[axis]) - mean).abs() < 0.01);
        }
        assert_eq!((result.samples, result.noise), (12_000, 16));
    }

    #[test]
    fn at_rest_is_still_and_a_hand_is_not() {
        let still = |deviation, range| run((0..400).map(|i| [100 + noise(i, deviation) as i16, 0, 0]), range).still;
        assert!(still(16.0, GyroRange::Dps250));
        assert!(!still(80.0, GyroRange::Dps250));
        // The same counts are eight times the rate at ±2000 °/s.
        assert!(!still(16.0, GyroRange::Dps2000));
        let without_noise = |rate| run((0..400).map(|_| [0, rate, 0]), GyroRange::Dps250).still;
        assert!(without_noise(2620) && without_noise(-2620), "20 °/s may be the zero-rate output");
        assert!(!without_noise(2621) && !without_noise(-2621), "more is a turn");
    }

    #[test]
    fn it_ends_on_time_whatever_the_sensor_does() {
        let mut average = GyroAverage::new(200);
        let mut ticks = 0;
        while !average.is_over() && ticks < 1000 {
            ticks += 1;
            average.update((ticks % 2 == 0).then_some([SensorCounts(5); 3]));
        }
        assert_eq!(ticks, 200);
        let result = average.result(GyroRange::Dps250);
        assert_eq!((result.samples, result.bias, result.noise), (100, [5.0; 3], 0));
        assert_eq!(GyroAverage::new(100).result(GyroRange::Dps250), Calibration::default());
    }

    #[test]
    fn extremes_saturate() {
        let result = run((0..12_000).map(|i| [if i % 2 == 0 { i16::MAX } else { i16::MIN }, 0, 0]), GyroRange::Dps250);
        assert!(!result.still && result.noise > 30_000);
        assert!((result.bias[0] + 0.5).abs() < 0.1);
    }
}
