//! The base on its ball joint: J dw/dt + w x J w = M, and all moments on it except those of the flagella.
//!
//! Body axes, about the joint. M is the sum of the righting moment r_com x m g, the tether, the joint's friction and
//! the drag of the base; the closure decides which of them count.
//!
//! The tether has the energy K tau^2/2. Its twist tau is the rotation about the vertical that remains after the base is
//! turned upright by the smallest rotation: 2 atan2(q_z, q_w) plus full turns. This is the twist of a cable with the
//! same bending stiffness in all directions. The Euler yaw differs from it by half the product of pitch and roll, and
//! would treat the x and y axes differently. Its moment is minus the energy's gradient. For an angular velocity w in
//! body axes the twist changes by w . (up + z_B)/(1 + up . z_B), with the vertical up (from dq/dt = q w/2).

use super::Body;
use super::attitude::{euler_zyx, unwrap};
use super::closure::Closure;
use crate::V3;
use crate::fluid::head::RigidSurface;
use crate::functions::{atan2, sin};
use crate::params::Robot;
use nalgebra::Matrix3;
use std::f64::consts::PI;

/// Inertia of the base and the moments on it besides those of the flagella.
#[derive(Clone, Debug)]
pub struct RigidBase {
    inertia: V3,
    /// Of the base or its head, without the flagella, N m s.
    drag: Matrix3<f64>,
    flagella_resistance: Matrix3<f64>,
    righting: f64,
    tether: f64,
    viscous: f64,
    coulomb: f64,
    closure: Closure,
}

/// Rate in rad/s below which Coulomb friction is smoothed: 0.01 degrees a second, far below any rate of a trial.
const SLIP: f64 = 0.01 * PI / 180.0;

/// Lower limit of 1 + up . z_B in the twist's gradient, which is unbounded for a base that is upside down. Within 18
/// degrees of that attitude the tether moment is reduced.
const LEAST_SUM: f64 = 0.05;

/// Returns the twist of the tether, rad.
fn twist(body: &Body) -> f64 {
    let q = body.attitude.into_inner();
    unwrap(2.0 * atan2(q.k, q.w), body.yaw)
}

/// Returns the gradient of the twist for rotations in body axes. `up`: the vertical in body axes.
fn twist_gradient(up: V3) -> V3 {
    (up + V3::z()) / (1.0 + up.z).max(LEAST_SUM)
}

impl RigidBase {
    /// Returns the base of a robot. Only the closure `lumped` uses `flagella_resistance`: the rotational resistance of
    /// the rigid flagella about the joint, N m s. `head`: a head that is a body in the flow; it replaces the local
    /// drag.
    pub fn new(
        robot: &Robot,
        closure: Closure,
        flagella_resistance: Matrix3<f64>,
        head: Option<&RigidSurface>,
    ) -> Self {
        let base = &robot.base;
        // With `full` the weight of the elastic flagella is among their loads.
        let flagella = match closure {
            Closure::Lumped if base.flagella_weight_on_base => 2.0 * flagellum_righting(robot),
            _ => 0.0,
        };
        Self {
            inertia: V3::from(base.inertia_kg_m2),
            drag: head.map_or(Matrix3::identity() * robot.base_drag(), |head| head.rotational_resistance()),
            flagella_resistance,
            righting: base.mass_kg * base.gravity_m_s2 * base.mass_centre_below_joint_m + flagella,
            tether: robot.joint.tether(closure),
            viscous: robot.joint.viscous_nms,
            coulomb: robot.joint.coulomb_nm,
            closure,
        }
    }

    /// Returns the sum of all moments except those of the flagella, N m.
    pub fn moment(&self, body: &Body) -> V3 {
        let mut moment = -(self.drag * body.rate);
        if self.closure == Closure::Paper {
            let pitch = euler_zyx(&body.attitude)[1];
            moment.y -= self.righting * sin(pitch);
            return moment;
        }
        let up = body.attitude.inverse_transform_vector(&V3::z());
        // The mass centre hangs below the joint: r_com x m g.
        moment += V3::z().cross(&up) * self.righting;
        moment -= twist_gradient(up) * (self.tether * twist(body));
        moment -= body.rate * self.viscous;
        moment -= body.rate * (self.coulomb / (body.rate.norm_squared() + SLIP * SLIP).sqrt());
        if self.closure == Closure::Lumped {
            moment -= self.flagella_resistance * body.rate;
        }
        moment
    }

    /// Returns J a + w x J w for the angular velocity w and its derivative a, N m.
    pub fn inertial_moment(&self, rate: V3, acceleration: V3) -> V3 {
        self.inertia.component_mul(&acceleration) + rate.cross(&self.inertia.component_mul(&rate))
    }

    /// Returns the derivative of (inertial moment - moment) with respect to the rate, N m s.
    ///
    /// `h_eff` (s) is the effective step of the time formula, its length over its first weight: a change d of the rate
    /// changes the attitude by h_eff d and the acceleration by d/h_eff.
    pub fn stiffness(&self, body: &Body, h_eff: f64) -> Matrix3<f64> {
        let up = body.attitude.inverse_transform_vector(&V3::z());
        let mut s = Matrix3::from_diagonal(&(self.inertia / h_eff));
        s += self.drag;
        if self.closure == Closure::Paper {
            s[(1, 1)] += self.righting * h_eff;
            return s;
        }
        let friction = (body.rate.norm_squared() + SLIP * SLIP).sqrt();
        s += Matrix3::identity() * (self.viscous + self.coulomb / friction);
        // A rotation d moves `up` by up x d, and the twist by its gradient times d.
        s += (Matrix3::identity() * up.z - up * V3::z().transpose()) * (self.righting * h_eff);
        let gradient = twist_gradient(up);
        s += gradient * gradient.transpose() * (self.tether * h_eff);
        if self.closure == Closure::Lumped {
            s += self.flagella_resistance;
        }
        s
    }
}

/// Returns the righting moment of a rigid flagellum's net weight per sine of the tilt, N m, averaged over a revolution.
pub(crate) fn flagellum_righting(robot: &Robot) -> f64 {
    let below = robot.base.height_m + 0.5 * robot.flagellum.axial_length_m;
    robot.net_weight() * robot.flagellum.helix(0).contour_length() * below
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::attitude::rotated;
    use nalgebra::UnitQuaternion;

    #[test]
    fn the_tether_has_an_energy() {
        let mut robot = Robot::published();
        robot.base.mass_centre_below_joint_m = 0.0;
        let base = RigidBase::new(&robot, Closure::Full, Matrix3::zeros(), None);
        let stiffness = robot.joint.tether_full_nm_per_rad;
        for (yaw, pitch, roll) in [(0.4, 0.3, -0.5), (-2.9, -1.2, 0.9), (9.0, 1.5, 0.7), (-5.0, 0.0, 0.0)] {
            let attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let energy = |change: V3| {
                let attitude = rotated(&attitude, change);
                // After the shortest rotation to upright, about a horizontal axis, a rotation about the vertical
                // remains.
                let axis = attitude.transform_vector(&V3::z());
                let upright = UnitQuaternion::rotation_between(&axis, &V3::z()).expect("not upside down") * attitude;
                let tau = unwrap(euler_zyx(&upright)[0], yaw);
                0.5 * stiffness * tau * tau
            };
            let moment = base.moment(&Body { attitude, rate: V3::zeros(), yaw });
            let h = 1e-5;
            for axis in 0..3 {
                let mut change = V3::zeros();
                change[axis] = h;
                let slope = (energy(change) - energy(-change)) / (2.0 * h);
                assert!((moment[axis] + slope).abs() < 1e-6 * stiffness, "{yaw} {pitch} {roll}, axis {axis}");
            }
        }
    }

    #[test]
    fn the_tether_is_finite_upside_down() {
        let base = RigidBase::new(&Robot::published(), Closure::Full, Matrix3::zeros(), None);
        let attitude = UnitQuaternion::from_axis_angle(&V3::y_axis(), PI);
        let moment = base.moment(&Body { attitude, rate: V3::zeros(), yaw: 3.0 });
        assert!(moment.norm() < 0.01, "{moment}");
    }

    #[test]
    fn flagella_on_the_base_of_lumped_right_it_more() {
        let mut robot = Robot::published();
        let moment = |robot: &Robot| {
            let base = RigidBase::new(robot, Closure::Lumped, Matrix3::zeros(), None);
            let attitude = UnitQuaternion::from_axis_angle(&V3::y_axis(), 0.1);
            base.moment(&Body { attitude, ..Body::default() }).y
        };
        let without = moment(&robot);
        robot.base.flagella_weight_on_base = true;
        // Both rods of 0.2435 m weigh 25.7 mN in the fluid, and hang 0.1356 m below the joint.
        assert!((moment(&robot) - without + 25.66e-3 * 0.1356 * 0.1f64.sin()).abs() < 2e-6);
    }

    #[test]
    fn the_righting_moment_rights() {
        let base = RigidBase::new(&Robot::published(), Closure::Full, Matrix3::zeros(), None);
        let body = Body { attitude: UnitQuaternion::from_axis_angle(&V3::y_axis(), 0.2), ..Body::default() };
        assert!(base.moment(&body).y < 0.0);
    }
}
