//! How the flagella act on the base, and the base on the flagella.

use crate::V3;
use serde::{Deserialize, Serialize};

/// The three closures of the base's equation of motion, and a base that is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Closure {
    /// Two-way: the clamps move with the body, and the moment is that of all forces of the fluid on
    /// both flagella about the joint, with righting moment, tether, base drag and joint friction.
    #[default]
    Full,
    /// One-way: forces of flagella on a base held still, of them the couples (F1z - F2z) d/2 and
    /// (F1y - F2y) d/2 with their true signs and the reaction torques about the shafts; the flagella's
    /// own rotational resistance about the joint is a constant matrix.
    Lumped,
    /// The printed equations to the letter: M_y = (F1z - F2z) d/2, M_z = (F1y - F2y) d/2, a righting
    /// moment about y alone and the base's drag. They assume the two flagella on opposite sides from
    /// where they are, leave out the reaction torques, and nothing in them stops a constant yaw torque.
    Paper,
    /// The base is held still at its attitude; for studies of the flagella alone.
    Held,
}

impl Closure {
    /// Whether the clamps of the elastic rods move with the body.
    pub fn two_way(self) -> bool {
        self == Closure::Full
    }
}

/// Loads of one flagellum on its clamp in body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Load {
    /// Force in N.
    pub force: V3,
    /// Moment about the joint in N m.
    pub moment: V3,
    /// Moment about its own shaft in N m.
    pub axial_torque: f64,
}

/// The moment that the flagella put on the base, body axes, N m.
///
/// `distance`: that of the shafts in m.
pub fn flagella_moment(closure: Closure, loads: &[Load; 2], distance: f64) -> V3 {
    let difference = (loads[0].force - loads[1].force) * (0.5 * distance);
    match closure {
        Closure::Full => loads[0].moment + loads[1].moment,
        Closure::Lumped => V3::new(0.0, -difference.z, difference.y + loads[0].axial_torque + loads[1].axial_torque),
        Closure::Paper => V3::new(0.0, difference.z, difference.y),
        Closure::Held => V3::zeros(),
    }
}
