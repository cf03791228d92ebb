//! The shafts: the state of each motor, and its shaft frame in the body frame.

use crate::V3;
use crate::functions::sin_cos;
use serde::{Deserialize, Serialize};

/// Angle and speed of a motor's shaft about +z_B.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotorState {
    /// Angle of the shaft in rad, unwrapped.
    pub angle: f64,
    /// Speed in rad/s, positive counter-clockwise seen from above.
    pub speed: f64,
}

/// Position and orientation of a shaft frame in the body frame.
#[derive(Clone, Copy, Debug)]
pub struct Shaft {
    /// Foot of the shaft in the body frame, m.
    pub foot: V3,
    sine: f64,
    cosine: f64,
}

impl Shaft {
    /// Returns a shaft with its foot at `foot` (body frame, m), turned by `angle` (rad).
    pub fn new(foot: V3, angle: f64) -> Self {
        let (sine, cosine) = sin_cos(angle);
        Self { foot, sine, cosine }
    }

    /// Converts a direction from the shaft frame to the body frame.
    #[inline(always)]
    pub fn to_body(&self, v: V3) -> V3 {
        V3::new(self.cosine * v.x - self.sine * v.y, self.sine * v.x + self.cosine * v.y, v.z)
    }

    /// Converts a direction from the body frame to the shaft frame.
    #[inline(always)]
    pub fn to_shaft(&self, v: V3) -> V3 {
        V3::new(self.cosine * v.x + self.sine * v.y, self.cosine * v.y - self.sine * v.x, v.z)
    }

    /// Converts a point from the shaft frame to the body frame, m.
    #[inline(always)]
    pub fn point_to_body(&self, x: V3) -> V3 {
        self.foot + self.to_body(x)
    }

    /// Converts a point from the body frame to the shaft frame, m.
    #[inline(always)]
    pub fn point_to_shaft(&self, x: V3) -> V3 {
        self.to_shaft(x - self.foot)
    }
}
