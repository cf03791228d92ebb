//! Sensors: ideal ones, and ones whose errors lie within the data sheet.

use super::random::Random;
use biflag_log::MeasuredSensorMeta;
use host::sensor::{Estimate, Sensor};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// A part: limits of PS-MPU-6000A revision 3.4, sections 6.1 and 6.2, and of a Nano's resonator.
#[derive(Clone, Debug)]
pub struct Part {
    pub(super) gyro: Matrix3<f64>,
    pub(super) gyro_g_dps: Matrix3<f64>,
    pub(super) accel: Matrix3<f64>,
    pub(super) accel_offset_g: Vector3<f64>,
    pub(super) mounting: UnitQuaternion<f64>,
    pub(super) bias_dps_per_c: Vector3<f64>,
    pub(super) warming_c: f64,
    pub(super) clock: f64,
    pub(super) flicker_dps: f64,
    /// The axis of the gyroscope that flickers.
    pub(super) flicker: Vector3<f64>,
}

impl Part {
    /// Returns a sensor with noise alone.
    pub fn ideal() -> Self {
        Self {
            gyro: Matrix3::identity(),
            gyro_g_dps: Matrix3::zeros(),
            accel: Matrix3::identity(),
            accel_offset_g: Vector3::zeros(),
            mounting: UnitQuaternion::identity(),
            bias_dps_per_c: Vector3::zeros(),
            warming_c: 0.0,
            clock: 0.0,
            flicker_dps: 0.0,
            flicker: Vector3::z(),
        }
    }

    /// Draws a sensor.
    pub fn typical(random: &mut Random) -> Self {
        let mut matrix = |diagonal: f64, others: f64| {
            Matrix3::identity() + Matrix3::from_fn(|i, j| random.within(if i == j { diagonal } else { others }))
        };
        let (gyro, accel) = (matrix(0.03, 0.02), matrix(0.03, 0.02));
        Self {
            gyro,
            accel,
            gyro_g_dps: Matrix3::from_fn(|_, _| random.within(0.1)),
            accel_offset_g: Vector3::new(random.within(0.05), random.within(0.05), random.within(0.08)),
            mounting: UnitQuaternion::from_scaled_axis(random.three(2f64.to_radians())),
            // A tenth of what ±20 °/s over -40 to 85 °C amounts to.
            bias_dps_per_c: Vector3::from_fn(|_, _| 0.03 * random.normal()),
            warming_c: (1.5 * random.normal()).abs(),
            clock: random.within(0.005),
            flicker_dps: 0.0015,
            flicker: Vector3::ith((3.0 * random.uniform()) as usize, 1.0),
        }
    }

    /// Returns the record of a sensor's file that measurements of this part give: each error within its scatter of the truth.
    pub fn measured(&self, random: &mut Random) -> MeasuredSensorMeta {
        let mut near = |value: f64, u: f64| Estimate { value: value + u * random.normal(), u };
        let mut sensor = Sensor::of_data_sheet();
        let [_, _, yaw] = <[f64; 3]>::from(self.mounting.scaled_axis().map(f64::to_degrees));
        for i in 0..3 {
            sensor.gyro_scale[i] = near(self.gyro[(i, i)] - 1.0, 0.001);
            sensor.accel_scale[i] = near(self.accel[(i, i)] - 1.0, 0.001);
            for j in 0..3 {
                sensor.gyro_g_dps[i][j] = near(self.gyro_g_dps[(i, j)], 0.003);
                if i != j {
                    sensor.gyro_cross[i][j] = near(self.gyro[(i, j)], 0.002);
                    sensor.accel_cross[i][j] = near(self.accel[(i, j)], 0.002);
                }
            }
        }
        sensor.mounting_deg[2] = near(yaw, 0.2);
        file_of(&sensor)
    }
}

fn file_of(sensor: &Sensor) -> MeasuredSensorMeta {
    let mut text = "board_id = 0\ndate = \"2026-11-24\"\ngyro_axes = [\"x\", \"y\", \"z\"]\n\
                    accel_axes = [\"x\", \"y\", \"z\"]\n"
        .to_owned();
    let names = ["x", "y", "z"];
    let line = |key: &str, Estimate { value, u }: Estimate| format!("{key} = {{ value = {value:.9}, u = {u:.9} }}\n");
    for (name, values) in [("gyro_scale", &sensor.gyro_scale), ("accel_scale", &sensor.accel_scale)] {
        text += &format!("[{name}]\n");
        (0..3).for_each(|i| text += &line(names[i], values[i]));
    }
    for (name, values, is_whole) in [
        ("gyro_cross", &sensor.gyro_cross, false),
        ("gyro_g_dps", &sensor.gyro_g_dps, true),
        ("accel_cross", &sensor.accel_cross, false),
    ] {
        text += &format!("[{name}]\n");
        let pairs = (0..9).map(|k| (k / 3, k % 3)).filter(|(i, j)| is_whole || i != j);
        pairs.for_each(|(i, j)| text += &line(&format!("{}{}", names[i], names[j]), values[i][j]));
    }
    text += &format!("[mounting_deg]\n{}", line("z", sensor.mounting_deg[2]));
    MeasuredSensorMeta { name: "sensor.toml".to_owned(), text }
}
