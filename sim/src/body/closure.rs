//! How the flagella act on the base, and the base on the flagella.
//!
//! # The closure `paper`
//!
//! The equations as the publication prints them (Hao, Zalavadia, Jawed, RoboSoft 2024), to the letter. F1 and F2 are
//! the forces of the flagella on a base held still (body axes), d the distance of the shafts, m g r_m the righting
//! moment, theta the pitch, w the angular velocity in body axes and C = 2 pi mu C_r r_h^3 the base's drag:
//!
//! ```text
//! J dw/dt + w x J w = M
//! M_x = -C w_x
//! M_y = (F1z - F2z) d/2 - m g r_m sin(theta) - C w_y
//! M_z = (F1y - F2y) d/2 - C w_z
//! ```
//!
//! The righting moment is written with its restoring sign. The table has the results of the three closures at the
//! published points for the robot `published` (`cargo run --release -p sim --example closures`; both helices start at
//! the same angle; yaw is the value at that time and not a mean over whole turns; rates are means and tilts ranges of
//! the last minute of 240 s):
//!
//! | speeds rpm | closure | yaw at 120 s | at 240 s, deg | rate about z_B, deg/s | by drag alone | tilt, deg | settled |
//! | --- | --- | --- | --- | --- | --- | --- | --- |
//! | (50, 10) | Full | -62.4 | -62.4 | -0.026 |  | 4.4 to 6.2 | true |
//! | (50, 10) | Lumped | -63.3 | -63.3 | 0.000 |  | 3.4 to 3.4 | true |
//! | (50, 10) | Paper | 31379.6 | 64244.2 | 80.203 | 80.204 | 1.0 to 154.9 | false |
//! | (0, 45) | Full | -48.9 | -48.9 | -0.022 |  | 4.9 to 6.2 | true |
//! | (0, 45) | Lumped | -48.4 | -48.4 | -0.000 |  | 3.9 to 3.9 | true |
//! | (0, 45) | Paper | 28766.8 | 59180.5 | 61.698 | 61.697 | 3.2 to 142.4 | false |
//! | (90, 90) | Full | -180.0 | -180.0 | -0.230 |  | 1.4 to 2.0 | true |
//! | (90, 90) | Lumped | -180.0 | -180.0 | -0.000 |  | 0.0 to 0.0 | true |
//! | (90, 90) | Paper | 34158.9 | 69798.2 | 143.281 | 143.282 | 2.4 to 177.7 | false |
//! | (-90, 90) | Full | 32.8 | 32.8 | 0.128 |  | 16.9 to 20.8 | true |
//! | (-90, 90) | Lumped | 35.1 | 35.1 | 0.000 |  | 16.8 to 16.8 | true |
//! | (-90, 90) | Paper | 829.7 | 1660.0 | 6.113 | 6.113 | 26.8 to 47.8 | false |
//!
//! The printed equations have no steady state, for three reasons.
//!
//! - No term resists a yaw *angle*. Lateral forces are sinusoids, but their mean over a revolution is not zero, so the
//!   couple (F1y - F2y) d/2 has a mean as well. The only other term is drag, so w_z approaches that mean over C. The
//!   time constant J_z/C is a quarter of a second; the base then spins at that rate for ever. In the real tank
//!   something else resists the yaw, such as the sensor's cable. `full` and `lumped` model it by one stiffness, the
//!   only calibrated constant.
//! - No term resists a *roll*. While the base spins about z_B, its tilt changes from pitch to roll and back, and no
//!   moment acts on the roll. So the axis does not settle either: it tumbles, at three of the four points to nearly
//!   upside down and back. (At these points the Euler yaw increases faster than the base rotates about z_B.)
//! - C is the drag of the base alone. The drag of the flagella about the joint, which is far larger, is left out, and so
//!   are the reaction torques about the helix axes, the largest part of the yaw moment.
//!
//! The two couples also place each flagellum on the opposite side: with flagellum 1 at +d/2 along x_B, the moment of
//! its thrust about y_B is -F1z d/2. `lumped` has the true sign.

use super::load::Load;
use crate::V3;
pub use crate::params::Closure;

/// Returns the moment of the flagella on the base, body axes, N m.
///
/// `distance`: distance of the shafts, m.
pub fn flagella_moment(closure: Closure, loads: &[Load; 2], distance: f64) -> V3 {
    let difference = (loads[0].force - loads[1].force) * (0.5 * distance);
    match closure {
        Closure::Full => loads[0].moment + loads[1].moment,
        Closure::Lumped => V3::new(0.0, -difference.z, difference.y + loads[0].axial_torque + loads[1].axial_torque),
        Closure::Paper => V3::new(0.0, difference.z, difference.y),
        Closure::Held => V3::zeros(),
    }
}
