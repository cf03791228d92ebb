//! A synthetic sensor in a hand, with known errors, for all tests of the sensor.

use super::RawReading;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use sim::split_mix;

const DT: f64 = 0.005;

/// A sensor with its errors, attitude and time.
pub struct Hand {
    /// Scale and cross-axis errors of the gyroscope.
    pub gyro: Matrix3<f64>,
    /// Sensitivity of the rates to gravity, °/s/g.
    pub gyro_g_dps: Matrix3<f64>,
    /// Scale and cross-axis errors of the accelerometer.
    pub accel: Matrix3<f64>,
    /// Its offset, g.
    pub offset_g: Vector3<f64>,
    /// Bias of the gyroscope, °/s.
    pub bias_dps: Vector3<f64>,
    /// Drift of the bias, °/s/s.
    pub drift_dps: Vector3<f64>,
    /// Change of the bias with temperature, °/s/°C.
    pub drift_dps_per_c: Vector3<f64>,
    /// Total warming after power-on, °C; two thirds of it within 150 s.
    pub warming_c: f64,
    /// Lag of the thermometer, s.
    pub lag_s: f64,
    /// Standard deviation of a reading, °/s and 10 g.
    pub noise: f64,
    /// Body to world.
    pub attitude: UnitQuaternion<f64>,
    pub time_s: f64,
    pub random: Random,
}

/// Random numbers.
pub struct Random(u64, u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed, 0)
    }

    /// Returns a number between 0 and 1.
    pub fn uniform(&mut self) -> f64 {
        self.1 += 1;
        split_mix::uniform(self.0, self.1)
    }

    /// Returns a normally distributed number (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let [a, b] = [self.uniform(), self.uniform()];
        (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    }
}

impl Hand {
    /// Returns a sensor without errors, z up.
    pub fn new(seed: u64) -> Self {
        Self {
            gyro: Matrix3::zeros(),
            gyro_g_dps: Matrix3::zeros(),
            accel: Matrix3::zeros(),
            offset_g: Vector3::zeros(),
            bias_dps: Vector3::zeros(),
            drift_dps: Vector3::zeros(),
            drift_dps_per_c: Vector3::zeros(),
            warming_c: 0.0,
            lag_s: 0.0,
            noise: 0.05,
            attitude: UnitQuaternion::identity(),
            time_s: 0.0,
            random: Random::new(seed),
        }
    }

    /// Rotates by `world_deg`, a rotation vector in world axes, and returns the readings; zero means rest.
    pub fn moved(&mut self, world_deg: Vector3<f64>, seconds: f64) -> Vec<RawReading> {
        let count = (seconds / DT).round();
        (0..count as usize)
            .map(|step| {
                // The rate of a smooth start and stop.
                let phase = (step as f64 + 0.5) / count;
                let rate_dps = world_deg / (count * DT) * 30.0 * (phase * (1.0 - phase)).powi(2);
                self.attitude = UnitQuaternion::from_scaled_axis(rate_dps.map(f64::to_radians) * DT) * self.attitude;
                self.reading(rate_dps)
            })
            .collect()
    }

    pub fn rest(&mut self, seconds: f64) -> Vec<RawReading> {
        self.moved(Vector3::zeros(), seconds)
    }

    fn reading(&mut self, world_dps: Vector3<f64>) -> RawReading {
        self.time_s += DT;
        let to_body = self.attitude.inverse();
        let (rate, force) = (to_body * world_dps, to_body * Vector3::z());
        let random = &mut self.random;
        let mut noise = || Vector3::from_fn(|_, _| random.normal());
        let warmth = |time_s: f64| self.warming_c * (1.0 - (-time_s.max(0.0) / 150.0).exp());
        let warmer_c = warmth(self.time_s);
        let temperature_c = 25.0 + warmth(self.time_s - self.lag_s);
        let bias_dps = self.bias_dps + self.drift_dps * self.time_s + self.drift_dps_per_c * warmer_c;
        let rate_dps = rate + self.gyro * rate + self.gyro_g_dps * force + bias_dps + self.noise * noise();
        let force_g = force + self.accel * force + self.offset_g + 0.1 * self.noise * noise();
        RawReading { time_s: self.time_s, rate_dps: rate_dps.into(), force_g: force_g.into(), temperature_c }
    }

    /// Returns a number within ±`limit`.
    pub fn within(&mut self, limit: f64) -> f64 {
        limit * (2.0 * self.random.uniform() - 1.0)
    }

    /// Returns a matrix with limits for its diagonal and its other elements.
    pub fn matrix(&mut self, diagonal: f64, beside: f64) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.within(if i == j { diagonal } else { beside }))
    }
}
