//! A part: the readings of a sensor with given [`Errors`]. The caller provides the random numbers.

use super::errors::Errors;
use super::noise::Noise;
use super::scale::LowPass;
use super::spectrum::{Flicker, LowPassed};
use crate::plant::Movement;
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Time constant of the warming by its own power after power-up, s: assumed.
const WARMING_S: f64 = 150.0;

/// Reference temperature of the biases, and default temperature of a body, °C.
pub const ROOM_C: f64 = 25.0;

/// A part.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Its errors.
    pub errors: Errors,
    /// From the sensor's axes to the body's.
    mounting: Rotation3<f64>,
    /// Fraction by which both sensors read too much in addition to their errors: a fault.
    pub scale: f64,
    /// Fraction of the next axis (y for x, z for y, x for z) that each axis of both sensors also reads: a fault.
    pub askew: f64,
    /// Random walk of the gyroscope's bias so far, °/s.
    walked_dps: [f64; 3],
    walked_until_s: f64,
    flicker: [Flicker; 3],
    /// Last reading of the thermometer, °C, and its time; `None` before the first reading.
    thermometer: Option<(f64, f64)>,
    gyro_noise: [LowPassed; 3],
    accel_noise: [LowPassed; 3],
}

/// A sensor's measurement before its resolution and range take effect.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Signal {
    /// Rate of turn, °/s.
    pub rate_dps: [f64; 3],
    /// Specific force, g.
    pub force_g: [f64; 3],
    /// Reading of the thermometer, °C.
    pub temperature_c: f64,
}

impl Part {
    /// Returns a part that has just got power.
    pub fn new(errors: Errors) -> Self {
        let mounting = Rotation3::new(Vector3::from(errors.mounting_deg).map(f64::to_radians));
        Self { errors, mounting, ..Self::default() }
    }

    /// Returns its measurement of a movement of the body, in its own axes, without white noise. Times must not
    /// decrease.
    pub fn measure(&mut self, movement: &Movement, time_s: f64, noise: &mut Noise) -> Signal {
        let temperature_c = self.temperature_c(time_s, movement.temperature_c);
        let (gyro_bias, accel_bias) = self.bias(time_s, temperature_c, noise);
        let (rate_dps, force_g) = self.distort(movement.rate_dps, movement.specific_force_g);
        let add = |values: [f64; 3], bias: [f64; 3]| std::array::from_fn(|i| values[i] + bias[i]);
        Signal {
            rate_dps: add(rate_dps, gyro_bias),
            force_g: add(force_g, accel_bias),
            temperature_c: self.thermometer_c(time_s, temperature_c),
        }
    }

    /// Returns its white noise, °/s and g, behind its low-pass filter. Times must not decrease.
    pub fn white(&mut self, time_s: f64, low_pass: LowPass, noise: &mut Noise) -> ([f64; 3], [f64; 3]) {
        let Errors { gyro_noise_dps_per_rt_hz, accel_noise_g_per_rt_hz, .. } = self.errors;
        let gyro = self.gyro_noise.each_mut().map(|axis| axis.at(time_s, low_pass.gyro_hz, noise));
        let accel = self.accel_noise.each_mut().map(|axis| axis.at(time_s, low_pass.accel_hz, noise));
        (gyro.map(|x| gyro_noise_dps_per_rt_hz * x), accel.map(|x| accel_noise_g_per_rt_hz * x))
    }

    /// Returns its temperature at a time since power on, on a base of `base_c`, °C.
    fn temperature_c(&self, time_s: f64, base_c: f64) -> f64 {
        base_c + self.errors.warming_c * (1.0 - (-time_s / WARMING_S).exp())
    }

    /// Returns the reading of its thermometer if its temperature has been `temperature_c` since the last reading.
    fn thermometer_c(&mut self, time_s: f64, temperature_c: f64) -> f64 {
        let shown_c = match self.thermometer {
            Some((shown_c, before_s)) if self.errors.thermometer_lag_s > 0.0 => {
                let elapsed_s = (time_s - before_s).max(0.0);
                temperature_c + (shown_c - temperature_c) * (-elapsed_s / self.errors.thermometer_lag_s).exp()
            }
            _ => temperature_c,
        };
        self.thermometer = Some((shown_c, time_s));
        shown_c
    }

    /// Returns the readings of its axes for a rate (°/s) and force (g) in body axes, without bias.
    fn distort(&self, rate_dps: [f64; 3], force_g: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let errors = &self.errors;
        let rate = self.mounting.inverse_transform_vector(&rate_dps.into());
        let force = self.mounting.inverse_transform_vector(&force_g.into());
        let rate_read = response(&errors.gyro_scale, &errors.gyro_cross) * rate + matrix(&errors.gyro_g_dps) * force;
        let force_read = response(&errors.accel_scale, &errors.accel_cross) * force;
        (self.spoil(rate_read.into()), self.spoil(force_read.into()))
    }

    /// Adds the effects of faults.
    fn spoil(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x + self.askew * y, y + self.askew * z, z + self.askew * x].map(|value| value * (1.0 + self.scale))
    }

    /// Returns its bias of the rates, °/s, and of the forces, g, at a time and temperature. Times must not decrease.
    fn bias(&mut self, time_s: f64, temperature_c: f64, noise: &mut Noise) -> ([f64; 3], [f64; 3]) {
        let Self { errors, walked_dps, flicker, .. } = self;
        let passed = (time_s - self.walked_until_s).max(0.0);
        self.walked_until_s = time_s;
        let warmer = temperature_c - ROOM_C;
        for walked in walked_dps.iter_mut() {
            *walked += errors.gyro_walk_dps_per_rt_s * passed.sqrt() * noise.normal();
        }
        let mut gyro: [f64; 3] =
            std::array::from_fn(|i| errors.gyro_bias_dps[i] + errors.gyro_drift_dps_per_c[i] * warmer + walked_dps[i]);
        for ((bias, flicker), floor_dps) in gyro.iter_mut().zip(flicker).zip(errors.gyro_flicker_dps) {
            if floor_dps > 0.0 {
                *bias += floor_dps * flicker.at(time_s, noise);
            }
        }
        let accel = |i: usize| errors.accel_bias_g[i] + errors.accel_drift_g_per_c[i] * warmer;
        (gyro, std::array::from_fn(accel))
    }
}

/// Returns the matrix with these rows.
fn matrix(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j])
}

/// Returns the matrix from true values to readings.
fn response(scale: &[f64; 3], cross: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(*scale).add_scalar(1.0)) + matrix(cross)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_drifts_with_temperature_and_walks_as_it_says() {
        let (mut walks, mut noise) = (0.0, Noise::new(5));
        for _ in 0..300 {
            let mut part = Part::new(Errors {
                warming_c: 1.0,
                gyro_drift_dps_per_c: [0.1, 0.0, 0.0],
                gyro_walk_dps_per_rt_s: 1e-4,
                ..Errors::white()
            });
            assert!((part.temperature_c(150.0, 20.0) - 20.632).abs() < 1e-3);
            let mut gyro = [0.0; 3];
            for i in 1..=100 {
                (gyro, _) = part.bias(f64::from(i), ROOM_C + 2.0, &mut noise);
            }
            assert!((gyro[0] - 0.2).abs() < 0.006, "{gyro:?}");
            walks += gyro[1].powi(2);
        }
        // 1e-4 °/s/√s over 100 s.
        assert!(((walks / 300.0).sqrt() / 1e-3 - 1.0).abs() < 0.15, "{walks}");
    }

    /// Every error alone, against its own definition, with numbers that no axis shares.
    #[test]
    fn each_error_has_its_place_in_the_readings() {
        let (rate, force) = ([10.0, -200.0, 3000.0], [0.1, -0.7, 0.4]);
        let movement = Movement { rate_dps: rate, specific_force_g: force, temperature_c: ROOM_C };
        let measure = |errors: Errors| Part::new(errors).measure(&movement, 0.0, &mut Noise::new(1));
        let near = |read: [f64; 3], expected: [f64; 3]| {
            (0..3).for_each(|i| assert!((read[i] - expected[i]).abs() < 1e-9, "{read:?}, not {expected:?}"));
        };
        let ideal = measure(Errors::white());
        assert_eq!((ideal.rate_dps, ideal.force_g, ideal.temperature_c), (rate, force, ROOM_C));
        let with = |change: fn(&mut Errors)| {
            let mut errors = Errors::white();
            change(&mut errors);
            measure(errors)
        };
        let read = with(|e| e.gyro_scale = [0.01, 0.02, -0.03]);
        near(read.rate_dps, [10.1, -204.0, 2910.0]);
        near(read.force_g, force);
        let read = with(|e| e.gyro_cross = [[0.0, 0.02, 0.01], [0.03, 0.0, 0.0], [0.0, -0.02, 0.0]]);
        near(read.rate_dps, [10.0 - 4.0 + 30.0, -200.0 + 0.3, 3000.0 + 4.0]);
        let read = with(|e| e.gyro_g_dps = [[0.1, 0.0, 0.0], [0.0, 0.0, -0.1], [0.0, 0.05, 0.02]]);
        near(read.rate_dps, [10.01, -200.04, 3000.0 - 0.035 + 0.008]);
        let read = with(|e| e.accel_scale = [-0.03, 0.01, 0.02]);
        near(read.force_g, [0.097, -0.707, 0.408]);
        near(read.rate_dps, rate);
        let read = with(|e| e.accel_cross = [[0.0, 0.0, 0.02], [-0.01, 0.0, 0.0], [0.0, 0.02, 0.0]]);
        near(read.force_g, [0.108, -0.701, 0.386]);
        let read = with(|e| (e.gyro_bias_dps, e.accel_bias_g) = ([1.0, 2.0, 3.0], [0.01, 0.02, 0.03]));
        near(read.rate_dps, [11.0, -198.0, 3003.0]);
        near(read.force_g, [0.11, -0.68, 0.43]);
        // The sensor's x axis is the body's y axis, its y axis the body's -x.
        let read = with(|e| e.mounting_deg = [0.0, 0.0, 90.0]);
        near(read.rate_dps, [-200.0, -10.0, 3000.0]);
        near(read.force_g, [-0.7, -0.1, 0.4]);
    }

    #[test]
    fn the_thermometer_lags_behind_what_drives_the_bias() {
        let errors = Errors { thermometer_lag_s: 10.0, gyro_drift_dps_per_c: [1.0, 0.0, 0.0], ..Errors::white() };
        let (mut part, mut noise) = (Part::new(errors), Noise::new(1));
        let mut at = |time_s: f64, temperature_c| {
            part.measure(&Movement { temperature_c, ..Movement::default() }, time_s, &mut noise)
        };
        assert_eq!(at(0.0, ROOM_C).temperature_c, ROOM_C);
        let mut read = None;
        for i in 1..=1000 {
            read = Some(at(f64::from(i) * 0.01, ROOM_C + 2.0));
        }
        let read = read.unwrap();
        assert!((read.temperature_c - ROOM_C - 2.0 * 0.632).abs() < 1e-3, "{read:?}");
        assert!((read.rate_dps[0] - 2.0).abs() < 1e-9, "{read:?}");
    }

    #[test]
    fn white_and_flicker_noise_are_of_the_axes_that_have_them() {
        let errors = Errors {
            gyro_noise_dps_per_rt_hz: 0.01,
            accel_noise_g_per_rt_hz: 1e-3,
            gyro_flicker_dps: [0.0, 0.05, 0.0],
            ..Errors::white()
        };
        let (mut part, mut noise) = (Part::new(errors), Noise::new(1));
        let low_pass = crate::imu::scale::LOW_PASS[3];
        let (mut gyro, mut accel, mut flicker) = (0.0, 0.0, [0.0; 3]);
        for i in 0..20_000 {
            let time_s = f64::from(i) * 0.005;
            let (rates, forces) = part.white(time_s, low_pass, &mut noise);
            gyro += rates[0] * rates[0];
            accel += forces[2] * forces[2];
            flicker = part.measure(&Movement::default(), time_s, &mut noise).rate_dps;
        }
        let [gyro, accel] = [gyro, accel].map(|sum: f64| (sum / 2e4).sqrt());
        assert!((gyro / (0.01 * (1.1107f64 * 42.0).sqrt()) - 1.0).abs() < 0.03, "{gyro}");
        assert!((accel / (1e-3 * (1.1107f64 * 44.0).sqrt()) - 1.0).abs() < 0.03, "{accel}");
        assert!(flicker[0] == 0.0 && flicker[2] == 0.0 && flicker[1] != 0.0, "{flicker:?}");
    }
}
