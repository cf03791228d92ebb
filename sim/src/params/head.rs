//! The head: how the rigid base acts on the fluid about it.

use super::ParamError;
use super::validate::{refuse, within};
use crate::V3;
use crate::functions::{hypot, sin_cos};
use serde::{Deserialize, Serialize};

/// The effect of the base on the fluid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeadShape {
    /// Nothing: neither a drag on the base nor a flow about it.
    None,
    /// A drag on the base's rotation, 2 pi mu C_r r_h^3 with `base.rotational_drag` and `base.radius_m`, and no flow about it.
    Local,
    /// A closed circular cylinder along z_B, in the same Stokes flow as the flagella.
    Cylinder,
    /// A sphere in the same Stokes flow as the flagella.
    Sphere,
    /// A spheroid about z_B in the same Stokes flow as the flagella.
    Spheroid,
}

/// The head's shape, size and place. The other parts of the base are too thin to matter to the fluid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Head {
    /// Its shape (`physical`: `cylinder`; `published`: `local`). With `none` and `local` the other keys do not matter.
    pub shape: HeadShape,
    /// Radius across z_B in m (0.0135, publication).
    pub radius_m: f64,
    /// Length of a cylinder or spheroid along z_B in m (0.0285, from the joint to 9 mm above the shafts' feet). A
    /// sphere ignores it.
    pub length_m: f64,
    /// Centre in the body frame in m (0, 0, -0.01425): the joint is in the middle of the top.
    pub centre_m: [f64; 3],
}

impl Default for Head {
    fn default() -> Self {
        Self { shape: HeadShape::Cylinder, radius_m: 0.0135, length_m: 0.0285, centre_m: [0.0, 0.0, -0.01425] }
    }
}

/// Bounds of length over radius: the layout of the surface's points suits compact bodies.
const SLENDERNESS: [f64; 2] = [0.5, 10.0];

impl Head {
    /// Returns whether the head is a body in the flow.
    pub fn is_resolved(&self) -> bool {
        !matches!(self.shape, HeadShape::None | HeadShape::Local)
    }

    /// Returns half the length along z_B, m.
    pub fn half_length(&self) -> f64 {
        if self.shape == HeadShape::Sphere { self.radius_m } else { 0.5 * self.length_m }
    }

    /// Returns the centre in the body frame, m.
    pub fn centre(&self) -> V3 {
        V3::from(self.centre_m)
    }

    /// Checks sizes and place. `feet`: the shafts' feet in the body frame, m; `reach`: radius of a turning flagellum with
    /// its rod, `rod`: radius of the rod, m.
    pub(super) fn validate(&self, feet: &[V3], reach: f64, rod: f64) -> Result<(), ParamError> {
        if !self.is_resolved() {
            return Ok(());
        }
        within("head.radius_m", self.radius_m, 1e-5, 1.0)?;
        for coordinate in self.centre_m {
            within("head.centre_m", coordinate, -1.0, 1.0)?;
        }
        if self.shape != HeadShape::Sphere {
            let [least, most] = SLENDERNESS.map(|ratio| ratio * self.radius_m);
            within("head.length_m", self.length_m, least, most)?;
        }
        for foot in feet {
            let gap = self.gap_to_flagellum(foot, reach, rod);
            if gap <= 0.0 {
                let reason = format!("the head and a turning flagellum overlap by {:.2e} m", -gap);
                return refuse("head.radius_m", self.radius_m, reason);
            }
        }
        Ok(())
    }

    /// Returns the least distance (m) from the head's surface to the space in which a flagellum turns: a cylinder of radius
    /// `reach` about its shaft, from a rod's radius above the foot downwards. Negative when they overlap.
    fn gap_to_flagellum(&self, foot: &V3, reach: f64, rod: f64) -> f64 {
        let apart = (foot - self.centre()).xy().norm();
        let top = foot.z + rod;
        let outline = 256;
        (0..=outline)
            .map(|i| {
                let (radius, z) = self.outline(f64::from(i) / f64::from(outline));
                let (above, beside) = (self.centre_m[2] + z - top, apart - radius - reach);
                if above > 0.0 { hypot(above, beside.max(0.0)) } else { beside }
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns the outline in a half-plane through the axis, from the top (0) to the bottom (1): distance from the axis and
    /// height above the centre, m.
    fn outline(&self, share: f64) -> (f64, f64) {
        let (a, c) = (self.radius_m, self.half_length());
        if self.shape == HeadShape::Cylinder {
            let along = share * (2.0 * a + 2.0 * c);
            let z = (a + c - along).clamp(-c, c);
            return (along.min(2.0 * (a + c) - along).min(a), z);
        }
        let (sine, cosine) = sin_cos(std::f64::consts::PI * share);
        (a * sine, c * cosine)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gap(change: impl Fn(&mut Head)) -> f64 {
        let mut head = Head::default();
        change(&mut head);
        head.gap_to_flagellum(&V3::new(0.0225, 0.0, -0.0375), 0.01189, 0.003)
    }

    #[test]
    fn the_gap_to_the_flagella_is_that_of_the_surfaces() {
        // Above the feet: 6 mm above the space in which the flagella turn, whose inner side is 2.89 mm inside the rim.
        assert!((gap(|_| {}) - 0.006).abs() < 1e-12);
        // Beside them, no more than 10.61 mm wide.
        assert!((gap(|h| (h.length_m, h.radius_m, h.centre_m[2]) = (0.08, 0.01, -0.04)) - 0.61e-3).abs() < 1e-12);
        assert!(gap(|h| (h.length_m, h.centre_m[2]) = (0.08, -0.04)) < 0.0);
        // From the centre of a sphere to the upper edge of that space, 10.61 mm aside and 34.5 mm below.
        let sphere = gap(|h| (h.shape, h.centre_m[2]) = (HeadShape::Sphere, 0.0));
        assert!((sphere - (0.01061f64.hypot(0.0345) - 0.0135)).abs() < 1e-6);
    }
}
