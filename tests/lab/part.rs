//! A sensor with errors within its data sheet, PS-MPU-6000A revision 3.4, sections 6.1 and 6.2, on a board with a Nano's
//! resonator; and what it reads.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Interval of the board's readings by its own clock, s.
pub const TICK_S: f64 = 0.005;

/// A generator of random numbers: SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        let (radius, angle) = ((-2.0 * (1.0 - self.uniform()).ln()).sqrt(), std::f64::consts::TAU * self.uniform());
        radius * angle.cos()
    }

    /// Returns a number within ±`limit`.
    pub fn within(&mut self, limit: f64) -> f64 {
        limit * (2.0 * self.uniform() - 1.0)
    }

    /// Returns `limit` or `-limit`.
    pub fn at(&mut self, limit: f64) -> f64 {
        if self.uniform() < 0.5 { limit } else { -limit }
    }

    pub fn normals(&mut self, deviation: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| deviation * self.normal())
    }
}

/// A part.
#[derive(Clone)]
pub struct Part {
    pub gyro: Matrix3<f64>,
    pub gyro_g_dps: Matrix3<f64>,
    pub gyro_bias_dps: Vector3<f64>,
    pub gyro_drift_dps_per_c: Vector3<f64>,
    pub accel: Matrix3<f64>,
    pub accel_offset_g: Vector3<f64>,
    pub accel_drift_g_per_c: Vector3<f64>,
    /// From the sensor's axes to the body's.
    pub mounting: UnitQuaternion<f64>,
    pub warming_c: f64,
    pub clock: f64,
    /// Deviation of each of the walks that make up flicker, about each axis, °/s.
    pub flicker_dps: Vector3<f64>,
}

impl Part {
    /// A part without errors but noise, a bias and its walk.
    pub fn ideal(random: &mut Random) -> Self {
        Self {
            gyro: Matrix3::identity(),
            gyro_g_dps: Matrix3::zeros(),
            gyro_bias_dps: random.normals(2.0),
            gyro_drift_dps_per_c: Vector3::zeros(),
            accel: Matrix3::identity(),
            accel_offset_g: Vector3::zeros(),
            accel_drift_g_per_c: Vector3::zeros(),
            mounting: UnitQuaternion::identity(),
            warming_c: 0.0,
            clock: 0.0,
            flicker_dps: Vector3::zeros(),
        }
    }

    /// A part as sold. `draw` returns an error within a limit.
    pub fn sold(random: &mut Random, mut draw: impl FnMut(&mut Random, f64) -> f64) -> Self {
        let ideal = Self::ideal(random);
        let mut vector = |limits: [f64; 3]| Vector3::from(limits.map(|limit| draw(random, limit)));
        let mut matrix = |diagonal: f64, others: f64| {
            let limits = [[diagonal, others, others], [others, diagonal, others], [others, others, diagonal]];
            Matrix3::from_columns(&limits.map(&mut vector))
        };
        let (gyro, accel) = (Matrix3::identity() + matrix(0.03, 0.02), Matrix3::identity() + matrix(0.03, 0.02));
        let gyro_g_dps = matrix(0.1, 0.1);
        let accel_offset_g = vector([0.05, 0.05, 0.08]);
        // Over the 45 degrees from 25 to 70 °C.
        let accel_drift_g_per_c = vector([0.035 / 45.0, 0.035 / 45.0, 0.060 / 45.0]);
        let mounting = UnitQuaternion::from_scaled_axis(vector([2f64.to_radians(); 3]));
        let clock = draw(random, 0.005);
        // Axis x of `tests/data/mpu6050/still-655s.csv` has a floor of 0.004 °/s, its others have none that shows. The floor
        // is about four fifths of the deviation of each of these walks.
        let floor_dps = 0.006 * random.uniform();
        let flicker_dps = Vector3::ith((3.0 * random.uniform()) as usize, floor_dps / 0.8);
        Self {
            gyro,
            gyro_g_dps,
            // A tenth of what ±20 °/s over -40 to 85 °C amounts to.
            gyro_drift_dps_per_c: random.normals(0.03),
            accel,
            accel_offset_g,
            accel_drift_g_per_c,
            mounting,
            warming_c: (1.5 * random.normal()).abs(),
            clock,
            flicker_dps,
            ..ideal
        }
    }
}

/// What a part reads.
pub struct Reading {
    pub rate_dps: Vector3<f64>,
    pub force_g: Vector3<f64>,
    pub temperature_c: f64,
}

/// A part from power-on.
pub struct Powered<'a> {
    pub part: &'a Part,
    pub random: &'a mut Random,
    ticks: usize,
    walked_dps: Vector3<f64>,
    flicker: [Vector3<f64>; 4],
}

impl<'a> Powered<'a> {
    pub fn new(part: &'a Part, random: &'a mut Random) -> Self {
        let mut walk = || Vector3::from_fn(|i, _| part.flicker_dps[i] * random.normal());
        let flicker = [walk(), walk(), walk(), walk()];
        Self { part, random, ticks: 0, walked_dps: Vector3::zeros(), flicker }
    }

    /// Returns the time of the next reading since power-on, s.
    pub fn next_s(&self) -> f64 {
        (self.ticks + 1) as f64 * self.tick_s()
    }

    /// Returns the interval of the readings, s. The board's clock counts it as [`TICK_S`].
    pub fn tick_s(&self) -> f64 {
        TICK_S / (1.0 + self.part.clock)
    }

    /// Returns the next reading, of a body that turned from one attitude to another since the last one.
    pub fn read(&mut self, before: UnitQuaternion<f64>, now: UnitQuaternion<f64>) -> Reading {
        let (part, tick_s) = (self.part, self.tick_s());
        self.ticks += 1;
        let time_s = self.ticks as f64 * tick_s;
        let warm = |time_s: f64| part.warming_c * (1.0 - (-time_s / 150.0).exp());
        self.walked_dps += self.random.normals(1e-4 * tick_s.sqrt());
        for (k, walk) in self.flicker.iter_mut().enumerate() {
            // Correlation times of 4, 16, 64 and 256 s.
            let share = tick_s / 4f64.powi(k as i32 + 1);
            *walk += self.random.normals((2.0 * share).sqrt()).component_mul(&part.flicker_dps) - share * *walk;
        }
        let to_sensor = part.mounting.inverse();
        let (rate, up) = ((before.inverse() * now).scaled_axis() / tick_s, to_sensor * (now.inverse() * Vector3::z()));
        let bias = part.gyro_bias_dps
            + part.gyro_drift_dps_per_c * warm(time_s)
            + self.walked_dps
            + self.flicker.iter().sum::<Vector3<f64>>();
        // 0.005 °/s/√Hz and 400 µg/√Hz, one-sided, up to 100 Hz.
        let rate_dps = part.gyro * (to_sensor * rate).map(f64::to_degrees) + part.gyro_g_dps * up + bias;
        let rate_dps = (rate_dps + self.random.normals(0.05)).map(|rate| (rate * 131.0).round() / 131.0);
        let offset_g = part.accel_offset_g + part.accel_drift_g_per_c * warm(time_s);
        let force_g = part.accel * up + offset_g + self.random.normals(0.004);
        // The thermometer lags, and has a noise of its own.
        let temperature_c = 25.0 + warm((time_s - 3.0).max(0.0)) + 0.08 * self.random.normal();
        Reading { rate_dps, force_g, temperature_c }
    }
}
