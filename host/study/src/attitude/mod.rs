//! Converts attitudes from quaternions to angles, and corrects them.
//!
//! Quaternions rotate body axes into world axes (Hamilton convention, scalar first). Euler angles are yaw about z, then
//! pitch about the new y, then roll about the new x (MATLAB's `quat2eul`).

mod bias_noise;
mod decay;
mod drift;
mod level;
mod rest;
mod returns;
mod series;
mod smoother;
mod still;
mod track;

pub use bias_noise::BiasNoise;
pub use drift::{Drift, Rest};
pub(crate) use level::LARGEST_TILT_DEG;
pub use level::{LARGEST_OFFSET_G, Level, Leveller, RestForce};
pub(crate) use rest::ANGLE_WALK;
pub use series::Series;
pub use sim::body::attitude::{euler_zyx, tilt_deg};
pub use smoother::WARMING_DPS_PER_C;
pub use still::{Motion, STILL_TILT_DPS, STILL_YAW_DPS, Still};
pub use track::{Columns, Track};

use nalgebra::{Quaternion, UnitQuaternion};

/// A reading of the sensor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reading {
    /// Attitude from the board's filter, `[w, x, y, z]`, body to world.
    pub attitude: [f64; 4],
    /// Rates about the body's axes with the calibrated bias removed, °/s.
    pub rates_dps: Option<[f64; 3]>,
    /// Temperature of the sensor, °C; only its changes are known for a part with an unknown thermometer.
    pub temperature_c: f64,
}

impl Default for Reading {
    /// Upright.
    fn default() -> Self {
        Self { attitude: [1.0, 0.0, 0.0, 0.0], rates_dps: None, temperature_c: 0.0 }
    }
}

/// Returns the same angle (°) within half a turn of zero.
pub(crate) fn wrapped(deg: f64) -> f64 {
    deg - 360.0 * (deg / 360.0).round()
}

/// Returns yaw, pitch and roll of an attitude, degrees: about the world's z, within ±180°, about the y axis after that, and about
/// the x axis after both.
pub fn euler_deg(attitude: &UnitQuaternion<f64>) -> [f64; 3] {
    euler_zyx(attitude).map(f64::to_degrees)
}

/// Returns the rotation of a quaternion `[w, x, y, z]`, which need not be normalised.
pub fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// Unwraps an angle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwrap {
    last: Option<f64>,
}

impl Unwrap {
    /// Returns the unwrapped angle, which is within half a turn of the previous one, degrees.
    pub fn next(&mut self, wrapped_deg: f64) -> f64 {
        let turns = self.last.map_or(0.0, |last| ((last - wrapped_deg) / 360.0).round());
        let angle = wrapped_deg + 360.0 * turns;
        self.last = Some(angle);
        angle
    }

    /// Returns yaw, pitch and roll of an attitude as [`euler_deg`] does, with the unwrapped yaw.
    pub fn angles_deg(&mut self, attitude: &UnitQuaternion<f64>) -> [f64; 3] {
        let [yaw, pitch, roll] = euler_deg(attitude);
        [self.next(yaw), pitch, roll]
    }
}
