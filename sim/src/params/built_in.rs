//! The built-in robots.

use super::{Fluid, Head, HeadShape, Joint, Robot};

/// Names of the built-in robots: [`Robot::default`] and [`Robot::published`].
pub const BUILT_IN: [&str; 2] = ["physical", "published"];

impl Robot {
    /// Returns the built-in robot of this name, see [`BUILT_IN`].
    pub fn built_in(name: &str) -> Option<Self> {
        match name {
            "physical" => Some(Self::default()),
            "published" => Some(Self::published()),
            _ => None,
        }
    }

    /// Returns the robot with the laboratory's choices, which reproduce the published angles: a regularisation of 1.03
    /// rod radii, rods that spin about their centre lines without drag, and a head with a drag but no flow about it.
    pub fn published() -> Self {
        Self {
            head: Head { shape: HeadShape::Local, ..Head::default() },
            fluid: Fluid { spin_drag: 0.0, regularisation_radii: 1.03, ..Fluid::default() },
            joint: Joint {
                tether_full_nm_per_rad: 3.599e-4,
                tether_lumped_nm_per_rad: 3.645e-4,
                viscous_nms: 0.0,
                coulomb_nm: 0.0,
            },
            ..Self::default()
        }
    }
}
