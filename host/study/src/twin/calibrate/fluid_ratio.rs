//! The fluid of a trial, relative to that of the fitted robot.

use sim::params::Robot;

/// Viscosity and density of the fluid of a trial, over those of the fitted robot.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct FluidRatio {
    pub viscosity: f64,
    pub density: f64,
}

impl Default for FluidRatio {
    fn default() -> Self {
        Self { viscosity: 1.0, density: 1.0 }
    }
}

impl FluidRatio {
    /// Returns the robot in the fluid of the trial.
    pub fn of(&self, robot: &Robot) -> Robot {
        let mut robot = robot.clone();
        robot.fluid.viscosity_pa_s *= self.viscosity;
        robot.fluid.density_kg_m3 *= self.density;
        robot
    }
}
