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
//! The righting moment is written with its restoring sign. The table has the means at the end of runs of 120 and 240 s of the robot
//! `published` without a preroll (`biflag simulate plan.toml --closure paper --json`; both helices start at the same angle):
//!
//! | speeds rpm | closure | yaw after 120 s | after 240 s, deg | tilt after 120 s | after 240 s, deg |
//! | --- | --- | --- | --- | --- | --- |
//! | (50, 10) | full | -63.5 | -63.5 | 5.3 | 5.3 |
//! | (50, 10) | lumped | -63.7 | -63.7 | 3.4 | 3.4 |
//! | (50, 10) | paper | 23896.5 | 61014.4 | 120.8 | 77.3 |
//! | (0, 45) | full | -47.2 | -47.2 | 5.6 | 5.6 |
//! | (0, 45) | lumped | -47.4 | -47.4 | 3.9 | 3.9 |
//! | (0, 45) | paper | 34184.7 | 65615.4 | 73.9 | 40.6 |
//! | (90, 90) | full | -180.0 | -180.0 | 0.0 | 0.0 |
//! | (90, 90) | lumped | -180.0 | -180.0 | 0.0 | 0.0 |
//! | (90, 90) | paper | 34180.5 | 69948.8 | 56.2 | 55.7 |
//! | (-90, 90) | full | 31.7 | 31.7 | 18.7 | 18.8 |
//! | (-90, 90) | lumped | 34.4 | 34.4 | 16.8 | 16.8 |
//! | (-90, 90) | paper | 859.7 | 1719.8 | 34.4 | 34.3 |
//!
//! The printed equations have no steady state, for three reasons.
//!
//! - No term resists a yaw *angle*. Lateral forces are sinusoids, but their mean over a revolution is not zero, so the
//!   couple (F1y - F2y) d/2 has a mean as well. The only other term is drag, so w_z approaches that mean over C. The
//!   time constant J_z/C is a quarter of a second; the base then spins at that rate for ever. In the real tank
//!   something else resists the yaw, such as the sensor's cable. `full` and `lumped` model it by one stiffness, the
//!   only calibrated constant.
//! - No term resists a *roll*. While the base spins about z_B, its tilt changes from pitch to roll and back, and no
//!   moment acts on the roll. So the axis does not settle either: it tumbles. (Then the Euler yaw increases faster than the base
//!   rotates about z_B.)
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
