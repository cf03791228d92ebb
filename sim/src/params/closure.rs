//! The equation of motion of the base.

use serde::{Deserialize, Serialize};

/// The three closures of the base's equation of motion, and a base that is held ([`crate::body::closure`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Closure {
    /// Two-way: the clamps move with the body. All forces of the fluid on both flagella give a moment about the joint, in
    /// addition to the righting moment, tether, base drag and joint friction.
    #[default]
    Full,
    /// One-way: the flagella exert the same forces as on a base held still. Only the couples (F1z - F2z) d/2 and (F1y - F2y)
    /// d/2, with their true signs, and the reaction torques about the shafts count. The flagella's own rotational resistance
    /// about the joint is a constant matrix.
    Lumped,
    /// The printed equations to the letter: M_y = (F1z - F2z) d/2, M_z = (F1y - F2y) d/2, a righting
    /// moment about y alone and the base's drag. They place each flagellum on the opposite side, leave out the reaction
    /// torques, and have no term that stops a constant yaw torque.
    Paper,
    /// The base is held still at its attitude; for studies of the flagella alone.
    Held,
}

impl Closure {
    /// Returns whether the clamps of the elastic rods move with the body.
    pub fn two_way(self) -> bool {
        self == Closure::Full
    }
}
