//! Quantities of a target: angles of the attitude, and the thrust.

use crate::attitude::tilt_deg;
use serde::Serialize;
use sim::trial::Summary;
use sim::trial::quantity::{THRUST, Values};
use std::ops::RangeInclusive;

/// A steady attitude, with the thrust.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Attitude {
    /// Mean yaw, unwrapped.
    pub yaw_deg: f64,
    /// Mean pitch.
    pub pitch_deg: f64,
    /// Mean roll.
    pub roll_deg: f64,
    /// Mean thrust of both flagella, along z_B.
    pub thrust_n: f64,
}

impl Attitude {
    /// Returns the steady attitude of a trial.
    pub fn of(summary: &Summary) -> Self {
        let values = Values::of(summary);
        let [yaw_deg, pitch_deg, roll_deg] = values.angles_deg();
        Self { yaw_deg, pitch_deg, roll_deg, thrust_n: values.get(&THRUST) }
    }

    /// Returns the angle between the robot's axis and the vertical, degrees.
    pub fn tilt_deg(&self) -> f64 {
        tilt_deg(self.pitch_deg, self.roll_deg)
    }

    /// Returns yaw, pitch and roll, degrees.
    pub fn angles_deg(&self) -> [f64; 3] {
        [self.yaw_deg, self.pitch_deg, self.roll_deg]
    }
}

/// A quantity that a target can contain.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Yaw, modulo 360 degrees.
    Yaw,
    /// Pitch.
    Pitch,
    /// Roll.
    Roll,
    /// Angle between the robot's axis and the vertical.
    Tilt,
    /// Thrust of both flagella.
    Thrust,
}

impl Quantity {
    /// Returns the value of the quantity, degrees or N.
    pub fn of(self, attitude: &Attitude) -> f64 {
        match self {
            Self::Yaw => attitude.yaw_deg,
            Self::Pitch => attitude.pitch_deg,
            Self::Roll => attitude.roll_deg,
            Self::Tilt => attitude.tilt_deg(),
            Self::Thrust => attitude.thrust_n,
        }
    }

    /// Returns the values that a target may have, degrees or N.
    pub fn range(self) -> RangeInclusive<f64> {
        match self {
            Self::Yaw => -36_000.0..=36_000.0,
            Self::Pitch => -90.0..=90.0,
            Self::Roll => -180.0..=180.0,
            Self::Tilt => 0.0..=180.0,
            Self::Thrust => -1e3..=1e3,
        }
    }
}
