//! The base on its ball joint: J dw/dt + w x J w = M, and all moments on it but those of the flagella.
//!
//! Body axes, about the joint. M holds the righting moment r_com x m g, the tether, the joint's friction and the drag of
//! the base; which of them count depends on the closure.

use super::Body;
use super::attitude::euler_zyx;
use super::closure::Closure;
use crate::V3;
use crate::fluid::head::RigidSurface;
use crate::params::Robot;
use nalgebra::Matrix3;
use std::f64::consts::PI;

/// Inertia of the base and the moments on it besides those of the flagella.
#[derive(Clone, Debug)]
pub struct RigidBase {
    inertia: V3,
    /// Of the head alone.
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

impl RigidBase {
    /// From the parameters. Only the closure `lumped` uses `flagella_resistance`: the rotational resistance of the rigid
    /// flagella about the joint, N m s. `head`: the head where it is a body in the flow, which replaces the local drag.
    pub fn new(
        robot: &Robot,
        closure: Closure,
        flagella_resistance: Matrix3<f64>,
        head: Option<&RigidSurface>,
    ) -> Self {
        let base = &robot.base;
        Self {
            inertia: V3::from(base.inertia_kg_m2),
            drag: head.map_or(Matrix3::identity() * robot.base_drag(), |head| head.rotational_resistance()),
            flagella_resistance,
            righting: base.mass_kg * base.gravity_m_s2 * base.mass_centre_below_joint_m,
            tether: robot.joint.tether(closure),
            viscous: robot.joint.viscous_nms,
            coulomb: robot.joint.coulomb_nm,
            closure,
        }
    }

    /// Returns the moment of everything but the flagella's loads, N m.
    pub fn moment(&self, body: &Body) -> V3 {
        let mut moment = -(self.drag * body.rate);
        if self.closure == Closure::Paper {
            let pitch = euler_zyx(&body.attitude)[1];
            moment.y -= self.righting * pitch.sin();
            return moment;
        }
        let up = body.attitude.inverse_transform_vector(&V3::z());
        // The mass centre hangs below the joint: r_com x m g.
        moment += V3::z().cross(&up) * self.righting;
        moment -= up * (self.tether * body.yaw);
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
        // A rotation d moves `up` by up x d, and the tether's twist by about up.d.
        s += (Matrix3::identity() * up.z - up * V3::z().transpose()) * (self.righting * h_eff);
        s += up * up.transpose() * (self.tether * h_eff);
        if self.closure == Closure::Lumped {
            s += self.flagella_resistance;
        }
        s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn the_righting_moment_rights() {
        let base = RigidBase::new(&Robot::published(), Closure::Full, Matrix3::zeros(), None);
        let body = Body { attitude: UnitQuaternion::from_axis_angle(&V3::y_axis(), 0.2), ..Body::default() };
        assert!(base.moment(&body).y < 0.0);
    }
}
