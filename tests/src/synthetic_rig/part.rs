//! Sensors with errors within the data sheet, PS-MPU-6000A revision 3.4, sections 6.1 and 6.2, on a board with a Nano's
//! resonator; and their readings.

use super::TICK_S;
use super::random::Random;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// The kind of parts to draw.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Lot {
    /// No errors but noise, a bias and its walk.
    Ideal,
    /// Errors equally likely within their limits.
    Typical,
    /// All errors at their limits, with signs at random.
    Edge,
}

/// A part.
#[derive(Clone, Debug)]
pub struct Part {
    pub(super) lot: Lot,
    gyro: Matrix3<f64>,
    gyro_g_dps: Matrix3<f64>,
    gyro_bias_dps: Vector3<f64>,
    gyro_drift_dps_per_c: Vector3<f64>,
    accel: Matrix3<f64>,
    accel_offset_g: Vector3<f64>,
    accel_drift_g_per_c: Vector3<f64>,
    /// From the sensor's axes to the body's.
    mounting: UnitQuaternion<f64>,
    warming_c: f64,
    /// The axis of the gyroscope that flickers.
    flicker: usize,
    /// Standard deviation of each of the walks that make up the flicker, °/s.
    flicker_dps: f64,
    /// Relative error of the board's clock; positive if it is fast.
    pub(super) clock: f64,
}

impl Part {
    /// Returns an ideal part but for one error: its table and key in the file of a sensor, and its value.
    pub fn with(table: &str, key: &str, value: f64) -> Self {
        let mut part = Self::of(Lot::Ideal, &mut Random(1));
        let axes: Vec<usize> = key.bytes().map(|axis| usize::from(axis - b'x')).collect();
        let (i, j) = (axes[0], *axes.last().expect("an axis"));
        match table {
            "gyro_scale" | "gyro_cross" => part.gyro[(i, j)] += value,
            "gyro_g_dps" => part.gyro_g_dps[(i, j)] += value,
            "accel_scale" | "accel_cross" => part.accel[(i, j)] += value,
            "mounting_deg" => part.mounting = UnitQuaternion::from_scaled_axis(Vector3::ith(i, value.to_radians())),
            other => panic!("no error of a part: {other}"),
        }
        part
    }

    /// Draws a part.
    pub fn of(lot: Lot, random: &mut Random) -> Self {
        let mut draw = |limit: f64| match lot {
            Lot::Ideal => 0.0,
            Lot::Typical => random.within(limit),
            Lot::Edge => random.at(limit),
        };
        let mut matrix =
            |diagonal: f64, others: f64| Matrix3::from_fn(|i, j| draw(if i == j { diagonal } else { others }));
        let (gyro, accel) = (Matrix3::identity() + matrix(0.03, 0.02), Matrix3::identity() + matrix(0.03, 0.02));
        let gyro_g_dps = matrix(0.1, 0.1);
        let mut vector = |limits: [f64; 3]| Vector3::from(limits.map(&mut draw));
        let accel_offset_g = vector([0.05, 0.05, 0.08]);
        // Over the 45 degrees from 25 to 70 °C.
        let accel_drift_g_per_c = vector([0.035 / 45.0, 0.035 / 45.0, 0.060 / 45.0]);
        let mounting = UnitQuaternion::from_scaled_axis(vector([2f64.to_radians(); 3]));
        let clock = draw(0.005);
        let sold = if lot == Lot::Ideal { 0.0 } else { 1.0 };
        Self {
            lot,
            gyro,
            gyro_g_dps,
            gyro_bias_dps: random.normals(2.0),
            // A tenth of the slope of ±20 °/s over -40 to 85 °C.
            gyro_drift_dps_per_c: random.normals(0.03 * sold),
            accel,
            accel_offset_g,
            accel_drift_g_per_c,
            mounting,
            warming_c: (1.5 * sold * random.normal()).abs(),
            flicker: (3.0 * random.uniform()) as usize,
            // Axis x of `tests/data/mpu6050/still-655s.csv` has a floor of 0.004 °/s, the other axes have no visible one. The
            // floor is about four fifths of the deviation of each walk.
            flicker_dps: 0.006 / 0.8 * sold * random.uniform(),
            clock,
        }
    }
}

/// A reading of a part.
pub(super) struct Reading {
    pub rate_dps: Vector3<f64>,
    pub force_g: Vector3<f64>,
    pub temperature_c: f64,
}

/// A part from power-on.
pub(super) struct Powered<'a> {
    pub part: &'a Part,
    pub random: &'a mut Random,
    ticks: usize,
    walked_dps: Vector3<f64>,
    flicker_dps: [f64; 4],
}

impl<'a> Powered<'a> {
    pub fn new(part: &'a Part, random: &'a mut Random) -> Self {
        let flicker_dps = std::array::from_fn(|_| part.flicker_dps * random.normal());
        Self { part, random, ticks: 0, walked_dps: Vector3::zeros(), flicker_dps }
    }

    /// Returns the time of the last reading since power-on, s.
    pub fn time_s(&self) -> f64 {
        self.ticks as f64 * self.tick_s()
    }

    /// Returns the interval of the readings, s. The board's clock counts it as [`TICK_S`].
    pub fn tick_s(&self) -> f64 {
        TICK_S / (1.0 + self.part.clock)
    }

    /// Returns the next reading, of a body that turned from one attitude to another since the last one.
    pub fn read(&mut self, before: UnitQuaternion<f64>, now: UnitQuaternion<f64>) -> Reading {
        self.ticks += 1;
        let (part, tick_s, time_s) = (self.part, self.tick_s(), self.time_s());
        let warm = |time_s: f64| part.warming_c * (1.0 - (-time_s / 150.0).exp());
        self.walked_dps += self.random.normals(1e-4 * tick_s.sqrt());
        for (k, walk) in self.flicker_dps.iter_mut().enumerate() {
            // Correlation times of 4, 16, 64 and 256 s.
            let share = tick_s / 4f64.powi(k as i32 + 1);
            *walk += part.flicker_dps * (2.0 * share).sqrt() * self.random.normal() - share * *walk;
        }
        let to_sensor = part.mounting.inverse();
        let (rate, up) = ((before.inverse() * now).scaled_axis() / tick_s, to_sensor * (now.inverse() * Vector3::z()));
        let flicker = Vector3::ith(part.flicker, self.flicker_dps.iter().sum());
        let bias = part.gyro_bias_dps + part.gyro_drift_dps_per_c * warm(time_s) + self.walked_dps + flicker;
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
