//! The rigid base on its ball joint, and its coupling to the flagella.
//!
//! World: z up. Body frame B at the ball joint P, x_B from motor 2 to motor 1, z_B up along the
//! robot's axis. Shaft frame of motor k: origin at the foot of shaft k, parallel to B but turned by
//! the motor's angle about z_B.

pub mod attitude;
pub mod closure;
pub mod imu;
pub mod joint;
pub mod load;
pub mod shaft;

use crate::V3;
use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};

/// Attitude and angular velocity of the base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Body to world.
    pub attitude: UnitQuaternion<f64>,
    /// Angular velocity in body axes, rad/s.
    pub rate: V3,
    /// Yaw in rad, unwrapped: the tether counts revolutions.
    pub yaw: f64,
}
