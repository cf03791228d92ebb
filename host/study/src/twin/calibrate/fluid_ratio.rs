//! The fluid of a trial, relative to the fitted robot's.

use sim::params::Robot;

/// Viscosity and density of a trial's fluid, relative to the fitted robot's.
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
    /// Returns the robot in the trial's fluid.
    pub fn of(&self, robot: &Robot) -> Robot {
        let mut robot = robot.clone();
        robot.fluid.viscosity_pa_s *= self.viscosity;
        robot.fluid.density_kg_m3 *= self.density;
        robot
    }
}
