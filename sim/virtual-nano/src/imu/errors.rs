//! The errors of a sensor: none, drawn from a seed, or from a file.
//!
//! For rates (°/s) and specific forces (g) in its own axes, a sensor with these errors reads:
//!
//! ```text
//! rate_read[i]  = (1 + gyro_scale[i]) rate[i]   + Σ gyro_cross[i][j] rate[j]   + Σ gyro_g_dps[i][j] force[j] + bias + noise
//! force_read[i] = (1 + accel_scale[i]) force[i] + Σ accel_cross[i][j] force[j]                               + bias + noise
//! ```
//!
//! Its axes are the body's, turned by `mounting_deg`. A bias is the sum of the bias at 25 °C, its change with
//! temperature and, for the gyroscope, a random walk and flicker. Three errors of the data sheet (PS-MPU-6000A-00,
//! revision 3.4, sections 6.1 and 6.2) are left out: nonlinearity, the change of scales with temperature, and the
//! influence of the supply.

use super::noise::Noise;
use super::scale::{ACCEL_NOISE_G, GYRO_NOISE_DPS};

/// The errors of a sensor and of the board's clock. Meanings and units are the same as for the keys of a `sensor_file`.
#[derive(Clone, PartialEq, Debug, Default)]
#[expect(missing_docs, reason = "`sensor_file` says what each of them is")]
pub struct Errors {
    pub gyro_scale: [f64; 3],
    pub gyro_cross: [[f64; 3]; 3],
    pub gyro_g_dps: [[f64; 3]; 3],
    pub gyro_bias_dps: [f64; 3],
    pub gyro_drift_dps_per_c: [f64; 3],
    pub gyro_noise_dps_per_rt_hz: f64,
    pub gyro_walk_dps_per_rt_s: f64,
    pub gyro_flicker_dps: [f64; 3],
    pub accel_scale: [f64; 3],
    pub accel_cross: [[f64; 3]; 3],
    pub accel_bias_g: [f64; 3],
    pub accel_drift_g_per_c: [f64; 3],
    pub accel_noise_g_per_rt_hz: f64,
    pub mounting_deg: [f64; 3],
    pub warming_c: f64,
    pub thermometer_lag_s: f64,
    pub sample_clock_error: f64,
    pub board_clock_error: f64,
}

/// Numbers for the draws of [`Errors::ideal`].
mod ideal {
    /// Bias of the gyroscope, °/s: the data sheet allows ±20; usual parts are better.
    pub const GYRO_BIAS_DPS: f64 = 2.0;
    /// Its change, °/s a degree: a tenth of the data sheet's ±20 °/s between 25 and -40 °C.
    pub const GYRO_DRIFT_DPS_PER_C: f64 = 0.03;
    /// Random walk, °/s/√s: an MPU6050 at rest (`tests/data/mpu6050/still-655s.csv`).
    pub const GYRO_WALK_DPS: f64 = 1e-4;
    /// Bias of the accelerometer, g: the data sheet allows ±0.05 (z: ±0.08); the recorded part has about 0.04.
    pub const ACCEL_BIAS_G: f64 = 0.015;
    /// Its change, g a degree: half of the limit below.
    pub const ACCEL_DRIFT_G_PER_C: f64 = 0.4e-3;
    /// Limit of that change: the data sheet's ±35 mg for x and y over the 45 °C from 25 to 70 °C. It allows more for z.
    pub const ACCEL_DRIFT_LIMIT_G_PER_C: f64 = 0.035 / 45.0;
    /// Warming by its own power, °C: assumed.
    pub const WARMING_C: f64 = 1.5;
}

/// Limits of [`Errors::typical`], from the data sheet unless noted.
mod typical {
    pub const GYRO_SCALE: f64 = 0.03;
    pub const GYRO_CROSS: f64 = 0.02;
    pub const GYRO_G_DPS: f64 = 0.1;
    pub const ACCEL_SCALE: f64 = 0.03;
    pub const ACCEL_CROSS: f64 = 0.02;
    /// The sensor's own oscillator, a gyroscope's (section 7.15).
    pub const SAMPLE_CLOCK: f64 = 0.01;
    /// The ceramic resonator of a usual Nano.
    pub const BOARD_CLOCK: f64 = 0.005;
    /// Assumed: a module that was glued in by eye, °.
    pub const MOUNTING_DEG: f64 = 2.0;
    /// Flicker, °/s: 1.5 times the flicker of axis x in `tests/data/mpu6050/still-655s.csv`, whose other axes show none.
    pub const FLICKER_DPS: f64 = 0.006;
    /// Assumed, s: the bias follows the structure, which the chip's thermometer does not touch.
    pub const THERMOMETER_LAG_S: f64 = 20.0;
}

impl Errors {
    /// Returns the white noise of the data sheet alone.
    pub fn white() -> Self {
        Self { gyro_noise_dps_per_rt_hz: GYRO_NOISE_DPS, accel_noise_g_per_rt_hz: ACCEL_NOISE_G, ..Self::default() }
    }

    /// Returns the errors of a part calibrated on a turntable: scales, axes and clocks are exact; biases are drawn from
    /// normal distributions, truncated at three standard deviations, or at the data sheet's limit if that is less.
    pub fn ideal(seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let mut draw = |spread: f64| spread * noise.normal().clamp(-3.0, 3.0);
        let mut three = |spread: f64| std::array::from_fn(|_| draw(spread));
        let limit = ideal::ACCEL_DRIFT_LIMIT_G_PER_C;
        Self {
            gyro_bias_dps: three(ideal::GYRO_BIAS_DPS),
            accel_bias_g: three(ideal::ACCEL_BIAS_G),
            gyro_drift_dps_per_c: three(ideal::GYRO_DRIFT_DPS_PER_C),
            accel_drift_g_per_c: three(ideal::ACCEL_DRIFT_G_PER_C).map(|drift: f64| drift.clamp(-limit, limit)),
            gyro_walk_dps_per_rt_s: ideal::GYRO_WALK_DPS,
            warming_c: draw(ideal::WARMING_C).abs(),
            ..Self::white()
        }
    }

    /// Returns the errors of a part that is used as bought: the biases of [`Errors::ideal`] with the same seed, and all
    /// other errors uniform within the limits of the data sheet.
    pub fn typical(seed: u64) -> Self {
        // A separate sequence, so that the biases stay those of the ideal part.
        let mut noise = Noise::new(seed ^ 0x5459_5049_4341_4C00);
        let mut draw = |limit: f64| limit * (2.0 * noise.uniform() - 1.0);
        let mut three = |limit: f64| std::array::from_fn(|_| draw(limit));
        let (gyro_scale, accel_scale) = (three(typical::GYRO_SCALE), three(typical::ACCEL_SCALE));
        let mounting_deg = three(typical::MOUNTING_DEG);
        let mut matrix = |limit: f64| [(); 3].map(|()| three(limit));
        let [gyro_cross, accel_cross] = [typical::GYRO_CROSS, typical::ACCEL_CROSS].map(|limit| {
            let mut shares = matrix(limit);
            (0..3).for_each(|i| shares[i][i] = 0.0);
            shares
        });
        let gyro_g_dps = matrix(typical::GYRO_G_DPS);
        let [sample_clock_error, board_clock_error] = [typical::SAMPLE_CLOCK, typical::BOARD_CLOCK].map(&mut draw);
        let mut gyro_flicker_dps = [0.0; 3];
        gyro_flicker_dps[(3.0 * noise.uniform()) as usize] = typical::FLICKER_DPS * noise.uniform();
        let thermometer_lag_s = typical::THERMOMETER_LAG_S * noise.uniform();
        Self {
            gyro_scale,
            gyro_cross,
            gyro_g_dps,
            gyro_flicker_dps,
            accel_scale,
            accel_cross,
            mounting_deg,
            thermometer_lag_s,
            sample_clock_error,
            board_clock_error,
            ..Self::ideal(seed)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEEDS: u64 = 4000;

    /// Checks that numbers fill ±limit evenly.
    fn is_uniform(what: &str, numbers: &[f64], limit: f64) {
        let count = numbers.len() as f64;
        let mean = numbers.iter().sum::<f64>() / count;
        let deviation = (numbers.iter().map(|x| x * x).sum::<f64>() / count).sqrt();
        let largest = numbers.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        assert!(largest <= limit && largest > 0.99 * limit, "{what}: {largest} of {limit}");
        assert!(mean.abs() < 0.04 * limit, "{what}: mean {mean} of {limit}");
        assert!((deviation * 3f64.sqrt() / limit - 1.0).abs() < 0.03, "{what}: deviation {deviation} of {limit}");
    }

    /// Limits as the data sheet prints them, not as the code above has them.
    #[test]
    fn a_typical_part_fills_the_limits_of_the_data_sheet() {
        let parts: Vec<Errors> = (0..SEEDS).map(Errors::typical).collect();
        let all = |of: &dyn Fn(&Errors) -> f64| parts.iter().map(of).collect::<Vec<f64>>();
        for i in 0..3 {
            is_uniform("gyroscope's scale", &all(&|e| e.gyro_scale[i]), 3e-2);
            is_uniform("accelerometer's scale", &all(&|e| e.accel_scale[i]), 3e-2);
            is_uniform("mounting", &all(&|e| e.mounting_deg[i]), 2.0);
            for j in 0..3 {
                is_uniform("sensitivity to gravity", &all(&|e| e.gyro_g_dps[i][j]), 0.1);
                if i == j {
                    assert!(parts.iter().all(|e| e.gyro_cross[i][i] == 0.0 && e.accel_cross[i][i] == 0.0));
                } else {
                    is_uniform("gyroscope's axes", &all(&|e| e.gyro_cross[i][j]), 2e-2);
                    is_uniform("accelerometer's axes", &all(&|e| e.accel_cross[i][j]), 2e-2);
                }
            }
        }
        is_uniform("sensor's oscillator", &all(&|e| e.sample_clock_error), 1e-2);
        is_uniform("board's clock", &all(&|e| e.board_clock_error), 5e-3);
        assert!(parts.iter().all(|e| (0.0..20.0).contains(&e.thermometer_lag_s)));
    }

    #[test]
    fn no_two_numbers_of_typical_parts_go_together() {
        let numbers = |errors: Errors| -> Vec<f64> {
            let rows = [errors.gyro_cross, errors.accel_cross, errors.gyro_g_dps].concat();
            let rows = rows.into_iter().chain([errors.gyro_scale, errors.accel_scale, errors.mounting_deg]);
            let clocks = [errors.sample_clock_error, errors.board_clock_error];
            rows.flatten().chain(clocks).chain(errors.gyro_bias_dps).filter(|x| *x != 0.0).collect()
        };
        let parts: Vec<Vec<f64>> = (0..SEEDS).map(|seed| numbers(Errors::typical(seed))).collect();
        let count = parts[0].len();
        assert_eq!(count, 6 + 6 + 9 + 3 * 3 + 2 + 3);
        for i in 0..count {
            for j in 0..i {
                let sum = |of: &dyn Fn(&[f64]) -> f64| parts.iter().map(|part| of(part)).sum::<f64>();
                let correlation = sum(&|p| p[i] * p[j]) / (sum(&|p| p[i] * p[i]) * sum(&|p| p[j] * p[j])).sqrt();
                assert!(correlation.abs() < 0.07, "numbers {i} and {j}: {correlation}");
            }
        }
    }

    #[test]
    fn one_axis_of_a_typical_part_flickers() {
        let mut count = [0; 3];
        for seed in 0..SEEDS {
            let floors = Errors::typical(seed).gyro_flicker_dps;
            let axis = floors.iter().position(|floor| *floor > 0.0).unwrap();
            assert!(floors.iter().sum::<f64>() == floors[axis] && floors[axis] < 0.006, "{floors:?}");
            count[axis] += 1;
        }
        assert!(count.iter().all(|axis| (axis - 1333i32).abs() < 130), "{count:?}");
    }

    #[test]
    fn biases_are_within_the_data_sheet_and_those_of_the_ideal_part() {
        for seed in 0..SEEDS {
            let (typical, ideal) = (Errors::typical(seed), Errors::ideal(seed));
            assert_eq!((typical.gyro_bias_dps, typical.accel_bias_g), (ideal.gyro_bias_dps, ideal.accel_bias_g));
            assert_eq!(typical.accel_drift_g_per_c, ideal.accel_drift_g_per_c);
            assert!(ideal.gyro_bias_dps.iter().all(|bias| bias.abs() <= 20.0));
            assert!(ideal.gyro_drift_dps_per_c.iter().all(|drift| drift.abs() * 60.0 <= 20.0));
            assert!(ideal.accel_bias_g.iter().all(|bias| bias.abs() <= 0.05));
            assert!(ideal.accel_drift_g_per_c.iter().all(|drift| drift.abs() * 45.0 <= 0.0350001));
            let exact = Errors { gyro_walk_dps_per_rt_s: ideal.gyro_walk_dps_per_rt_s, ..Errors::white() };
            let without_bias = Errors {
                gyro_bias_dps: [0.0; 3],
                gyro_drift_dps_per_c: [0.0; 3],
                accel_bias_g: [0.0; 3],
                accel_drift_g_per_c: [0.0; 3],
                warming_c: 0.0,
                ..ideal
            };
            assert_eq!(without_bias, exact);
        }
        assert_eq!(Errors::typical(7), Errors::typical(7));
        assert_ne!(Errors::typical(7), Errors::typical(8));
    }
}
