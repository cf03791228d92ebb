//! Modelling errors of the steady angles, relative to the robot in its tank; numerical errors are not included.
//!
//! Each figure is the measured effect of something that the parameters leave out, or the error of the line model
//! against resolved surfaces. It is the largest effect at the four published points with equal starting angles, rounded
//! up. `sim/docs/accuracy.md` has the tables and the commands that print them.

use crate::params::Robot;

/// Below this regularisation, in rod radii, the flow is that of a much thinner rod. The value of a round rod is
/// e^(1/2).
const THIN_RADII: f64 = 1.3;
/// Below this share of a round rod's couple the rods spin freely.
const FREE_SPIN: f64 = 0.5;

/// Rods as lines with the couple of their spin, and edges of 5 mm, against resolved surfaces.
const LINES: Cause = Cause { what: "rods as lines", yaw: 0.05, tilt: 0.1 };
/// A regularisation of 1.03 rod radii.
const THIN: Cause = Cause { what: "thin rods", yaw: 0.14, tilt: 0.25 };
/// No drag on the spin of the rods about their centre lines.
const SPIN: Cause = Cause { what: "no drag on the rods' spin", yaw: 0.19, tilt: 0.03 };
/// Both.
const THIN_SPIN: Cause = Cause { what: "thin rods without drag on their spin", yaw: 0.35, tilt: 0.25 };
/// A head with a drag coefficient and no flow.
const HEAD: Cause = Cause { what: "no flow about the head", yaw: 0.01, tilt: 0.02 };
/// An unbounded fluid, for a robot in the published tank.
const WALLS: Cause = Cause { what: "no walls", yaw: 0.04, tilt: 0.4 };

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
        let (thin, free) = (robot.fluid.regularisation_radii < THIN_RADII, robot.fluid.spin_drag < FREE_SPIN);
        let rods = match (thin, free) {
            (false, false) => LINES,
            (true, false) => THIN,
            (false, true) => SPIN,
            (true, true) => THIN_SPIN,
        };
        let mut causes = vec![rods];
        if !robot.head.is_resolved() {
            causes.push(HEAD);
        }
        if robot.tank.is_none() {
            causes.push(WALLS);
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

    /// Errors of independent causes add as squares.
    fn total(&self, of: impl Fn(&Cause) -> f64) -> f64 {
        self.causes.iter().map(|cause| of(cause).powi(2)).sum::<f64>().sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Tank;

    #[test]
    fn what_is_left_out_adds_to_the_error() {
        let error = |change: fn(&mut Robot)| {
            let mut robot = Robot::default();
            change(&mut robot);
            ModelError::of(&robot)
        };
        let [free, in_tank] = [error(|_| {}), error(|robot| robot.tank = Some(Tank::published()))];
        assert!(in_tank.yaw() < free.yaw() && in_tank.tilt() < 0.5 * free.tilt());
        assert!(ModelError::of(&Robot::published()).yaw() > 5.0 * free.yaw());
        assert_eq!(in_tank.of_angles_deg([-100.0, 3.0, -4.0]), [5.0, 0.5, 0.5]);
    }
}
