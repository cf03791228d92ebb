//! What sets a part apart from an ideal sensor: its bias, and how the bias drifts. Drawn by a seed.
//!
//! | | drawn with a standard deviation of | why |
//! | --- | --- | --- |
//! | gyroscope, bias | 2 °/s | the data sheet allows ±20; usual parts are better |
//! | its change with temperature | 0.03 °/s a degree | a tenth of what the data sheet's ±20 °/s over -40 to 85 °C amounts to |
//! | its random walk | 1e-4 °/s/√s | a lying MPU6050 (`tests/data/mpu6050/still-655s.csv`) |
//! | accelerometer, bias | 15 mg | the data sheet allows ±50 (z: ±80); the part of that recording has some 40 |
//! | its change with temperature | 0.4 mg a degree | half of what the data sheet's ±35 mg over 0 to 70 °C amounts to |
//! | its own warming | 1.5 °C, and never down | assumed, with a time constant of 150 s from power on |
//!
//! Draws beyond three deviations are cut. Scale factors and axes are exact: the part of a lab that has put it on a turntable.
//! The data sheet allows 3 % and 2 %, which a part can be given.

use super::noise::Noise;

const GYRO_BIAS_DPS: f64 = 2.0;
const GYRO_DRIFT_DPS_PER_C: f64 = 0.03;
const GYRO_WALK_DPS: f64 = 1e-4;
const ACCEL_BIAS_G: f64 = 0.015;
const ACCEL_DRIFT_G_PER_C: f64 = 0.4e-3;
const WARMING_C: f64 = 1.5;
const WARMING_S: f64 = 150.0;

/// Temperature at which the biases are as drawn, and of a body that says nothing of its own, °C.
pub const ROOM_C: f64 = 25.0;

/// A part.
#[derive(Clone, Debug)]
pub struct Part {
    /// Bias of the gyroscope at [`ROOM_C`], °/s.
    pub gyro_bias_dps: [f64; 3],
    /// Its change with temperature.
    pub gyro_drift_dps_per_c: [f64; 3],
    /// Bias of the accelerometer at [`ROOM_C`], g.
    pub accel_bias_g: [f64; 3],
    /// Its change with temperature.
    pub accel_drift_g_per_c: [f64; 3],
    /// How much warmer than its base it becomes, °C.
    pub warming_c: f64,
    /// By which fraction both sensors read too much.
    pub scale: f64,
    /// Which fraction of the next axis (y for x, z for y, x for z) each axis of both sensors reads with its own.
    pub askew: f64,
    /// How far the gyroscope's bias has walked, °/s.
    walked_dps: [f64; 3],
    walked_until_s: f64,
}

impl Part {
    /// The part that these numbers give.
    pub fn drawn(noise: &mut Noise) -> Self {
        let mut draw = |spread: f64| spread * noise.normal().clamp(-3.0, 3.0);
        let mut three = |spread: f64| std::array::from_fn(|_| draw(spread));
        Self {
            gyro_bias_dps: three(GYRO_BIAS_DPS),
            accel_bias_g: three(ACCEL_BIAS_G),
            gyro_drift_dps_per_c: three(GYRO_DRIFT_DPS_PER_C),
            accel_drift_g_per_c: three(ACCEL_DRIFT_G_PER_C),
            warming_c: draw(WARMING_C).abs(),
            scale: 0.0,
            askew: 0.0,
            walked_dps: [0.0; 3],
            walked_until_s: 0.0,
        }
    }

    /// One that adds nothing.
    pub fn ideal() -> Self {
        Self {
            gyro_bias_dps: [0.0; 3],
            gyro_drift_dps_per_c: [0.0; 3],
            accel_bias_g: [0.0; 3],
            accel_drift_g_per_c: [0.0; 3],
            warming_c: 0.0,
            scale: 0.0,
            askew: 0.0,
            walked_dps: [0.0; 3],
            walked_until_s: 0.0,
        }
    }

    /// Its temperature at a time since power on, on a base of `base_c`, °C.
    pub fn temperature_c(&self, time_s: f64, base_c: f64) -> f64 {
        base_c + self.warming_c * (1.0 - (-time_s / WARMING_S).exp())
    }

    /// Returns what its axes read of a rate or force, without bias.
    pub fn distort(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        [x + self.askew * y, y + self.askew * z, z + self.askew * x].map(|value| value * (1.0 + self.scale))
    }

    /// Returns its bias of the rates, °/s, and of the forces, g, at a time and temperature. Times do not go back.
    pub fn bias(&mut self, time_s: f64, temperature_c: f64, noise: &mut Noise) -> ([f64; 3], [f64; 3]) {
        let passed = (time_s - self.walked_until_s).max(0.0);
        self.walked_until_s = time_s;
        let warmer = temperature_c - ROOM_C;
        for walked in &mut self.walked_dps {
            *walked += GYRO_WALK_DPS * passed.sqrt() * noise.normal();
        }
        let gyro = |i: usize| self.gyro_bias_dps[i] + self.gyro_drift_dps_per_c[i] * warmer + self.walked_dps[i];
        let accel = |i: usize| self.accel_bias_g[i] + self.accel_drift_g_per_c[i] * warmer;
        (std::array::from_fn(gyro), std::array::from_fn(accel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_drifts_with_temperature_and_walks_as_it_says() {
        let (mut walks, mut noise) = (0.0, Noise::new(5));
        for _ in 0..300 {
            let mut part = Part { warming_c: 1.0, gyro_drift_dps_per_c: [0.1, 0.0, 0.0], ..Part::ideal() };
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
}
