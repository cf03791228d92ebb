//! How far the model's steady angles may be from those of the robot in its tank, besides numerical errors.
//!
//! Every figure is the measured effect of something that the parameters leave out, or of the line model itself against
//! resolved surfaces. `sim/docs/accuracy.md` has them all, with the commands that print them.

use crate::params::Robot;

/// Relative error of the reaction torque about a shaft, and so of the yaw: rods by lines with the rod's spin, against
/// resolved surfaces.
const LINE_TORQUE: f64 = 0.045;
/// Relative error of the tilting moment of the same rods.
const LINE_TILT: f64 = 0.15;
/// Relative error of the reaction torque without the couple on the rods' spin.
const NO_SPIN_TORQUE: f64 = 0.35;
/// Relative effect of a head outside of the flow on the yaw moment.
const NO_HEAD_YAW: f64 = 0.04;
/// The same on the tilting moment.
const NO_HEAD_TILT: f64 = 0.08;
/// Relative effect of the published tank's walls on the yaw moment.
const NO_TANK_YAW: f64 = 0.03;
/// The same on the tilting moment: of its size at (90, 90) rpm; at (50, 10) rpm the roll moment doubles.
const NO_TANK_TILT: f64 = 0.5;

/// An effect, and the relative error that it leaves in the steady angles.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Cause {
    /// What is left out or approximate.
    pub what: &'static str,
    /// Relative error of the yaw.
    pub yaw: f64,
    /// Relative error of the tilt.
    pub tilt: f64,
}

/// The error of a robot's model.
#[derive(Clone, PartialEq, Debug)]
pub struct ModelError {
    /// Its causes.
    pub causes: Vec<Cause>,
}

impl ModelError {
    /// Returns the error of the model with these parameters.
    pub fn of(robot: &Robot) -> Self {
        let mut causes = Vec::new();
        let torque = if robot.fluid.spin_drag < 0.5 { NO_SPIN_TORQUE } else { LINE_TORQUE };
        causes.push(Cause { what: "rods as lines", yaw: torque, tilt: LINE_TILT });
        if !robot.head.is_resolved() {
            causes.push(Cause { what: "no head in the flow", yaw: NO_HEAD_YAW, tilt: NO_HEAD_TILT });
        }
        if robot.tank.is_none() {
            causes.push(Cause { what: "no walls", yaw: NO_TANK_YAW, tilt: NO_TANK_TILT });
        }
        Self { causes }
    }

    /// Returns the relative error of the steady yaw.
    pub fn yaw(&self) -> f64 {
        self.total(|cause| cause.yaw)
    }

    /// Returns the relative error of the steady tilt.
    pub fn tilt(&self) -> f64 {
        self.total(|cause| cause.tilt)
    }

    /// Returns the errors in degrees of a yaw, pitch and roll in degrees. Pitch and roll have an error in proportion to the
    /// whole tilt, because the error may have another direction than the tilt.
    pub fn of_angles_deg(&self, [yaw, pitch, roll]: [f64; 3]) -> [f64; 3] {
        let tilt = self.tilt() * pitch.hypot(roll);
        [self.yaw() * yaw.abs(), tilt, tilt]
    }

    /// Independent causes add up as squares.
    fn total(&self, of: impl Fn(&Cause) -> f64) -> f64 {
        self.causes.iter().map(|cause| of(cause).powi(2)).sum::<f64>().sqrt()
    }
}
