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
    /// Temperature of the sensor, °C; of a part with an unknown thermometer, only its changes.
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

/// Yaw, pitch and roll.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Euler {
    /// About the world's z, degrees.
    pub yaw_deg: f64,
    /// About the y axis after the yaw, degrees.
    pub pitch_deg: f64,
    /// About the x axis after yaw and pitch, degrees.
    pub roll_deg: f64,
}

impl Euler {
    /// Returns the angles of an attitude, with yaw within ±180°.
    pub fn of(attitude: &UnitQuaternion<f64>) -> Self {
        let [yaw, pitch, roll] = euler_zyx(attitude);
        Self { yaw_deg: yaw.to_degrees(), pitch_deg: pitch.to_degrees(), roll_deg: roll.to_degrees() }
    }
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
}
