//! Force and torque of a flagellum on the base.

use crate::V3;
use serde::{Deserialize, Serialize};

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
