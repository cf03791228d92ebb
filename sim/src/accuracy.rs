//! Modelling errors of the steady angles, relative to the robot in its tank; numerical errors are not included.
//!
//! Each figure is the measured effect of an omission in the parameters: the largest effect at the four published points
//! with equal starting angles, rounded up. The error of rods as lines is computed from the robot's flagella.
//! `sim/docs/accuracy.md` has the tables and the commands that print them.

use crate::functions::{hypot, ln, powi};
use crate::params::Robot;
use std::f64::consts::TAU;

/// Below this regularisation, in rod radii, the flow is like a much thinner rod's. A round rod has e^(1/2).
const THIN_RADII: f64 = 1.3;
/// Below this share of a round rod's couple the rods spin freely.
const FREE_SPIN: f64 = 0.5;

/// Error of the yaw from rods as lines and edges of 5 mm.
const LINES_YAW: f64 = 0.05;
/// Slender-body theory counts flow within this distance of a helix's centre line, over the length of a turn, as the
/// rod's own (Lighthill 1976, SIAM Rev. 18, 161).
const NEAR: f64 = 0.09;
/// The theory needs rods that are thinner than the flow about them: it gives no valid drag below this logarithm.
const LEAST_LOGARITHM: f64 = 0.2;
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
    /// The omission or approximation.
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
        let mut causes = vec![Self::of_lines(robot)];
        causes.extend(match (thin, free) {
            (false, false) => None,
            (true, false) => Some(THIN),
            (false, true) => Some(SPIN),
            (true, true) => Some(THIN_SPIN),
        });
        if !robot.head.is_resolved() {
            causes.push(HEAD);
        }
        if robot.tank.is_none() {
            causes.push(WALLS);
        }
        Self { causes }
    }

    /// Returns the error from rods as lines. Lines have a flagellum's forces and the torque of the couples that turn
    /// the fluid about its rod, but not the flow of these couples. A flagellum's whole torque causes the mean swirl
    /// about it. The swirl drives the mean lateral force on the other flagellum, which causes most of the mean tilt.
    /// Swirl and force are too small by the share of these couples in the torque. This bounds the error from above.
    ///
    /// The couple of a rod of radius a that turns at 1 rad/s about its own centre line is 4 π μ a² per length; a rod at an
    /// angle to the axis needs less. The torque of its centre line about the helix's axis follows from resistive-force
    /// theory with Lighthill's coefficients.
    pub fn of_lines(robot: &Robot) -> Cause {
        let flagellum = &robot.flagellum;
        let (radius, advance) = (flagellum.helix_radius_m, flagellum.pitch_m / TAU);
        let arm = hypot(radius, advance);
        let logarithm = ln(2.0 * NEAR * TAU * arm / flagellum.rod_radius_m).max(LEAST_LOGARITHM);
        // Drags per length along the rod and across it, over the viscosity.
        let [along, across] = [TAU / logarithm, 2.0 * TAU / (logarithm + 0.5)];
        let line = powi(radius / arm, 2) * (along * radius * radius + across * advance * advance);
        let couple = 2.0 * TAU * powi(flagellum.rod_radius_m, 2);
        Cause { what: "rods as lines", yaw: LINES_YAW, tilt: couple / (couple + line) }
    }

    /// Returns the relative error of the steady yaw.
    pub fn yaw(&self) -> f64 {
        self.total(|cause| cause.yaw)
    }

    /// Returns the relative error of the steady tilt.
    pub fn tilt(&self) -> f64 {
        self.total(|cause| cause.tilt)
    }

    /// Returns the errors of the model in degrees for a robot with this yaw, pitch and roll in degrees. Pitch and roll
    /// have an error in proportion to the whole tilt, because the error may have another direction than the tilt.
    pub fn of_angles_deg(&self, angles_deg: [f64; 3]) -> [f64; 3] {
        in_proportion([self.yaw(), self.tilt()], angles_deg)
    }

    /// Returns the errors of a model that has these angles. An error of a share e of the robot's angle is up to e / (1 - e)
    /// of the model's angle, which is smaller if the model leaves out an effect that moves the robot.
    pub fn of_modelled_deg(&self, angles_deg: [f64; 3]) -> [f64; 3] {
        let of_model = |share: f64| share / (1.0 - share);
        let shares = [self.total(|cause| of_model(cause.yaw)), self.total(|cause| of_model(cause.tilt))];
        in_proportion(shares, angles_deg)
    }

    /// Errors of independent causes add as squares.
    fn total(&self, of: impl Fn(&Cause) -> f64) -> f64 {
        self.causes.iter().map(|cause| powi(of(cause), 2)).sum::<f64>().sqrt()
    }
}

fn in_proportion([of_yaw, of_tilt]: [f64; 2], [yaw, pitch, roll]: [f64; 3]) -> [f64; 3] {
    let tilt = of_tilt * hypot(pitch, roll);
    [of_yaw * yaw.abs(), tilt, tilt]
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
        // As `host/book/src/compare.md` says.
        assert_eq!((100.0 * free.of_modelled_deg([0.0, 1.0, 0.0])[1]).round(), 73.0);
        let tilt = 5.0 * ModelError::of_lines(&Robot::default()).tilt;
        assert_eq!(in_tank.of_angles_deg([-100.0, 3.0, -4.0]), [5.0, tilt, tilt]);
    }

    #[test]
    fn thick_rods_have_the_larger_error_and_a_small_angle_of_the_model_may_be_a_large_one() {
        let error = |rod_radius_m: f64| {
            let mut robot = Robot { tank: Some(Tank::published()), ..Robot::default() };
            robot.flagellum.rod_radius_m = rod_radius_m;
            ModelError::of(&robot)
        };
        let radii = [0.002, 0.003, 0.0075].map(|radius_m| {
            let error = error(radius_m);
            println!("rods of radius {radius_m} m: tilt {:.3}", error.tilt());
            error
        });
        assert!(radii.windows(2).all(|pair| pair[1].tilt() > 1.4 * pair[0].tilt()), "{radii:?}");
        for error in radii {
            let robot = [-100.0, 3.0, -4.0];
            // A model with the whole error: its angles are the robot's angles less the error.
            let model = [1.0 - error.yaw(), 1.0 - error.tilt(), 1.0 - error.tilt()];
            let modelled = [0, 1, 2].map(|k| model[k] * robot[k]);
            for (one, other) in error.of_angles_deg(robot).iter().zip(error.of_modelled_deg(modelled)) {
                assert!((one - other).abs() < 1e-9, "{one} {other}");
            }
        }
    }
}
