//! The natural shape of a flagellum: a helix that hangs from its clamp.
//!
//! Shaft frame: origin at the shaft's foot, z along the shaft (up), the helix axis along -z; at zero
//! motor angle x points as x_B. Equal steps of the helix angle s from 0 at the clamp:
//! (R cos s, -+R sin s, -pitch s/(2 pi)), upper sign right-handed.

use crate::V3;
use crate::functions::{hypot, sin_cos};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Sense in which a helix winds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Handedness {
    /// As a common screw. Turned counter-clockwise seen from above, the helix pushes up, towards its clamp.
    #[default]
    Right,
    /// The mirror image.
    Left,
}

/// Geometry of a helix, lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Helix {
    /// Radius of the centre line about the helix axis.
    pub radius: f64,
    /// Advance of a coil along the axis.
    pub pitch: f64,
    /// Length along the axis.
    pub axial_length: f64,
    /// Sense of winding.
    pub handedness: Handedness,
}

impl Helix {
    /// Returns the length of the centre line, m.
    pub fn contour_length(&self) -> f64 {
        let turn = hypot(TAU * self.radius, self.pitch);
        turn * self.axial_length / self.pitch
    }

    /// Returns `edges + 1` nodes on the centre line, m.
    pub fn nodes(&self, edges: usize) -> Vec<V3> {
        let total = TAU * self.axial_length / self.pitch;
        let sign = match self.handedness {
            Handedness::Right => -1.0,
            Handedness::Left => 1.0,
        };
        (0..=edges)
            .map(|i| {
                let share = i as f64 / edges as f64;
                let (sine, cosine) = sin_cos(total * share);
                V3::new(self.radius * cosine, sign * self.radius * sine, -self.axial_length * share)
            })
            .collect()
    }
}
