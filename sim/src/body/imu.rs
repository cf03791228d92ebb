//! The readings of an ideal inertial sensor that does not sit at the ball joint.

use crate::V3;

/// Returns the specific force in m/s2, body axes, that an ideal accelerometer measures at `point` (from the joint, m).
///
/// The joint is fixed, so f = alpha x r + w x (w x r) - g. `rate` (rad/s), `angular_acceleration` (rad/s2) and
/// `gravity` (m/s2, pointing down) are in body axes. At rest it is gravity's reaction, upwards.
pub fn specific_force(point: V3, rate: V3, angular_acceleration: V3, gravity: V3) -> V3 {
    angular_acceleration.cross(&point) + rate.cross(&rate.cross(&point)) - gravity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn off_the_axis_it_measures_gravity_and_both_accelerations() {
        let (point, gravity) = (V3::new(0.1, 0.0, -0.2), V3::new(0.0, 0.0, -9.81));
        let force = specific_force(point, V3::new(0.0, 0.0, 3.0), V3::new(0.0, 5.0, 0.0), gravity);
        // Centripetal -w2 x, tangential alpha x r.
        let expected = V3::new(-0.1 * 9.0 - 5.0 * 0.2, 0.0, 9.81 - 5.0 * 0.1);
        assert!((force - expected).norm() < 1e-14, "{force}");
    }
}
