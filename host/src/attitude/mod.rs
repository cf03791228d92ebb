//! Attitude: from quaternions to the angles that are reported.
//!
//! Quaternions turn body axes into world axes, Hamilton, scalar first. Euler angles are yaw about z, then pitch about
//! the new y, then roll about the new x (MATLAB's `quat2eul`).

mod drift;
mod rest;
mod series;
mod trial;

pub use drift::Drift;
pub(crate) use drift::{BIAS_WALK, student_95};
pub use series::{Series, Track};
pub(crate) use trial::levelling_deg;
pub use trial::{Angles, PhaseTimes, Times, steady_window};

use crate::log::schema::biflag::Telemetry;
use nalgebra::{Quaternion, UnitQuaternion};

/// What the sensor said at a moment.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Reading {
    /// The attitude that was made of it, `[w, x, y, z]`.
    pub attitude: [f64; 4],
    /// Rates about the body's x and y, less the calibrated bias, °/s.
    pub lateral_dps: Option<[f64; 2]>,
    /// The sensor's own temperature, °C.
    pub temperature_c: f64,
}

impl Reading {
    /// Of a frame; `None` where it has no attitude.
    pub fn of(frame: &Telemetry) -> Option<Self> {
        let q = frame.attitude.as_ref()?;
        let lateral_dps = frame.angular_velocity_dps.as_ref().map(|rate| [rate.x, rate.y]);
        Some(Self { attitude: [q.w, q.x, q.y, q.z], lateral_dps, temperature_c: frame.temperature_c })
    }
}

impl Default for Reading {
    /// Upright.
    fn default() -> Self {
        Self { attitude: [1.0, 0.0, 0.0, 0.0], lateral_dps: None, temperature_c: 0.0 }
    }
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
    /// The angles of an attitude; the yaw lies within ±180°.
    pub fn of(attitude: &UnitQuaternion<f64>) -> Self {
        let (roll, pitch, yaw) = attitude.euler_angles();
        Self { yaw_deg: yaw.to_degrees(), pitch_deg: pitch.to_degrees(), roll_deg: roll.to_degrees() }
    }
}

/// The rotation that `[w, x, y, z]` stands for.
pub fn rotation([w, x, y, z]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// Follows an angle across its wraps.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwrap {
    last: Option<f64>,
}

impl Unwrap {
    /// The angle without wraps, within half a turn of the one before. Degrees.
    pub fn next(&mut self, wrapped_deg: f64) -> f64 {
        let turns = self.last.map_or(0.0, |last| ((last - wrapped_deg) / 360.0).round());
        let angle = wrapped_deg + 360.0 * turns;
        self.last = Some(angle);
        angle
    }
}
