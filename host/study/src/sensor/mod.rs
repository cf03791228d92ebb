//! The errors of a sensor with their uncertainties, from the data sheet or measured.
//!
//! Frame: the body axes, after the axes settings of the board. A reading contains
//!
//! ```text
//! rate_read[i]  = (1 + scale[i]) rate[i]  + Σ cross[i][j] rate[j]  + Σ gyro_g[i][j] force[j] + bias[i] + noise
//! force_read[i] = (1 + scale[i]) force[i] + Σ cross[i][j] force[j] + offset[i] + noise
//! ```
//!
//! with j ≠ i in the sums over `cross`, and the specific force in units of the local gravity. [`Sensor`] does not
//! contain biases and offsets, because every trial measures them again at rest. The sensor's axes are turned from the
//! body's by small angles, the mounting: attitude_read = attitude · rotation(mounting).

mod bias_noise;
mod error;
mod file;
mod gravity;
mod least_squares;
pub mod note;
mod parameter;
mod poses;
mod reading;
mod still;
#[cfg(test)]
mod tests;
mod turn;

pub use error::NotMeasured;
pub use file::{AXES, FILE_NAME, MeasuredSensor};
pub use parameter::{GROUPS, Group, PARAMETERS, index};
pub use poses::{PoseStep, PosesResult, PosesWatch};
pub use reading::RawReading;
pub use still::{AxisNoise, StillResult, StillWatch};
pub use turn::{TurnPlan, TurnResult, TurnStep, TurnWatch};

use crate::attitude::BiasNoise;
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use sim::body::attitude::of_vector;
use sim::functions::powi;

/// A quantity and its standard uncertainty.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug, Default)]
#[serde(deny_unknown_fields)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Standard uncertainty, in the unit of the value.
    pub u: f64,
}

impl Estimate {
    /// Returns zero with the uncertainty of a rectangular distribution over ±`limit` (GUM, 4.3.7).
    pub const fn within(limit: f64) -> Self {
        Self { value: 0.0, u: limit * INV_SQRT_3 }
    }
}

const INV_SQRT_3: f64 = 0.577_350_269_189_625_8;

/// The errors of a sensor.
#[derive(Clone, PartialEq, Debug)]
pub struct Sensor {
    /// Relative scale error of the gyroscope about each axis; positive if the reading is too large.
    pub gyro_scale: [Estimate; 3],
    /// `[i][j]`: share of the rate about axis j in the reading of axis i. Zero for i = j.
    pub gyro_cross: [[Estimate; 3]; 3],
    /// `[i][j]`: change of the rate read about axis i per standard gravity along axis j, °/s/g.
    pub gyro_g_dps: [[Estimate; 3]; 3],
    /// Relative scale error of the accelerometer along each axis.
    pub accel_scale: [Estimate; 3],
    /// `[i][j]`: share of the force along axis j in the reading of axis i. Zero for i = j.
    pub accel_cross: [[Estimate; 3]; 3],
    /// Change of the accelerometer's offset with temperature, g/°C.
    pub accel_drift_g_per_c: [Estimate; 3],
    /// Rotation from the body's to the sensor's axes about x, y and z, degrees.
    pub mounting_deg: [Estimate; 3],
    /// Noise of the gyroscope's bias about each axis. An unmeasured walk also represents the flicker.
    pub bias_noise: [BiasNoise; 3],
    /// Angle random walk of the gyroscope about z, if it was measured.
    pub angle_walk_z_deg_per_root_s: Option<Estimate>,
    /// The error of the axes after poses.
    pub axes: AxesError,
}

/// The common error of all axes after poses. `accel_cross[i][j]` and `accel_cross[j][i]` are one measured value
/// (`biflag sensor poses`), and turns measure the gyroscope's axes relative to the accelerometer's, so all of them
/// share this error.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct AxesError {
    /// Standard uncertainty of the pairs y and z, z and x, x and y; zero if not measured.
    pub u: [f64; 3],
    /// `[i][j]`: error of `gyro_cross[i][j]` for a unit error of the pair. Zero for i = j.
    pub of_gyro: [[f64; 3]; 3],
}

/// Limits of the MPU-6000/6050's data sheet (PS-MPU-6000A, revision 3.4).
mod data_sheet {
    /// Section 6.1, sensitivity scale factor tolerance: ±3 %.
    pub const GYRO_SCALE: f64 = 0.03;
    /// Section 6.1, cross-axis sensitivity: ±2 %.
    pub const GYRO_CROSS: f64 = 0.02;
    /// Section 6.1, linear acceleration sensitivity: 0.1 °/s/g.
    pub const GYRO_G_DPS: f64 = 0.1;
    /// Section 6.2, initial calibration tolerance: ±3 %.
    pub const ACCEL_SCALE: f64 = 0.03;
    /// Section 6.2, cross-axis sensitivity: ±2 %.
    pub const ACCEL_CROSS: f64 = 0.02;
    /// Section 6.2, zero-G level change over temperature: ±35 mg over 0 to 70 °C for x and y, ±60 mg for z.
    pub const ACCEL_DRIFT_G_PER_C: [f64; 3] = [0.035 / 35.0, 0.035 / 35.0, 0.060 / 35.0];
}

/// Assumed random walk of an unmeasured gyroscope's bias, °/s/√s: five times the walk of an MPU6050 at rest for 655 s.
/// Over a trial it also represents flicker.
const BIAS_WALK: f64 = 5e-4;

/// Limit of each unmeasured mounting angle, degrees: a board aligned by eye.
const MOUNTING_DEG: f64 = 2.0;

impl Sensor {
    /// Returns the data sheet's tolerances.
    pub fn of_data_sheet() -> Self {
        let cross = |limit: f64| {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| if i == j { Estimate::default() } else { Estimate::within(limit) })
            })
        };
        Self {
            gyro_scale: [Estimate::within(data_sheet::GYRO_SCALE); 3],
            gyro_cross: cross(data_sheet::GYRO_CROSS),
            gyro_g_dps: [[Estimate::within(data_sheet::GYRO_G_DPS); 3]; 3],
            accel_scale: [Estimate::within(data_sheet::ACCEL_SCALE); 3],
            accel_cross: cross(data_sheet::ACCEL_CROSS),
            accel_drift_g_per_c: data_sheet::ACCEL_DRIFT_G_PER_C.map(Estimate::within),
            mounting_deg: [Estimate::within(MOUNTING_DEG); 3],
            bias_noise: [BiasNoise { walk_dps_per_root_s: BIAS_WALK, instability_dps: 0.0 }; 3],
            angle_walk_z_deg_per_root_s: None,
            axes: AxesError::default(),
        }
    }

    /// Returns the measured angle random walk about z, °/√s, and its degrees of freedom.
    pub fn angle_walk(&self) -> Option<(f64, f64)> {
        let Estimate { value, u } = self.angle_walk_z_deg_per_root_s.filter(|walk| walk.value > 0.0)?;
        // A standard deviation with n degrees of freedom has a relative uncertainty of 1/√(2 n).
        Some((value, 0.5 * powi(value / u, 2)))
    }

    /// Returns the known rotation from the body's to the sensor's axes.
    pub fn mounting(&self) -> UnitQuaternion<f64> {
        of_vector(Vector3::from(self.mounting_deg.map(|angle| angle.value.to_radians())))
    }
}
