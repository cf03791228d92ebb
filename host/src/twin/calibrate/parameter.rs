//! Parameters that can be fitted.

use sim::body::closure::Closure;
use sim::params::Robot;
use std::str::FromStr;

/// A parameter of the robot, or of the mounting of its sensor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Parameter {
    /// Stiffness of the tether in the fitted closure.
    Tether,
    /// The righting moment, given by the depth of the centre of mass below the joint.
    Righting,
    /// Coefficient of the base's rotational drag.
    Drag,
    /// Viscosity of the fluid.
    Viscosity,
    /// Young's modulus of the flagella.
    Young,
    /// Angle by which the sensor is rotated in the body about the vertical.
    MountYaw,
}

impl Parameter {
    /// All parameters.
    pub const ALL: [Self; 6] = [Self::Tether, Self::Righting, Self::Drag, Self::Viscosity, Self::Young, Self::MountYaw];

    /// The parameters that are fitted by default. The flagella's stiffness is not: it is measured better on a rod, and
    /// is nearly indistinguishable from the viscosity.
    pub const USUAL: [Self; 5] = [Self::Tether, Self::Righting, Self::Drag, Self::Viscosity, Self::MountYaw];

    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tether => "tether",
            Self::Righting => "righting",
            Self::Drag => "drag",
            Self::Viscosity => "viscosity",
            Self::Young => "young",
            Self::MountYaw => "mount-yaw",
        }
    }

    /// Returns the key in the robot's file; `None` for the mounting of the sensor.
    pub fn key(self, closure: Closure) -> Option<&'static str> {
        Some(match self {
            Self::Tether if closure == Closure::Lumped => "joint.tether_lumped_nm_per_rad",
            Self::Tether => "joint.tether_full_nm_per_rad",
            Self::Righting => "base.mass_centre_below_joint_m",
            Self::Drag => "base.rotational_drag",
            Self::Viscosity => "fluid.viscosity_pa_s",
            Self::Young => "flagellum.young_pa",
            Self::MountYaw => return None,
        })
    }

    /// Returns the unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Tether => "N m/rad",
            Self::Righting => "m",
            Self::Drag => "1",
            Self::Viscosity => "Pa s",
            Self::Young => "Pa",
            Self::MountYaw => "deg",
        }
    }

    /// Returns the parameter in a robot; `None` for the mounting of the sensor.
    fn place(self, robot: &mut Robot, closure: Closure) -> Option<&mut f64> {
        Some(match self {
            Self::Tether if closure == Closure::Lumped => &mut robot.joint.tether_lumped_nm_per_rad,
            Self::Tether => &mut robot.joint.tether_full_nm_per_rad,
            Self::Righting => &mut robot.base.mass_centre_below_joint_m,
            Self::Drag => &mut robot.base.rotational_drag,
            Self::Viscosity => &mut robot.fluid.viscosity_pa_s,
            Self::Young => &mut robot.flagellum.young_pa,
            Self::MountYaw => return None,
        })
    }

    /// Returns whether it is a parameter of the robot, so that a change requires a new simulation.
    pub(super) fn is_of_the_robot(self) -> bool {
        self != Self::MountYaw
    }

    /// Returns the smallest standard error, due to discretisation, in the units of the fit.
    ///
    /// Two runs of a trial with solver tolerances of 0.02 and 0.001 differ by 0.2 % in yaw, and by up to 0.6 % in tilt.
    /// The base's drag is 4 % of the total resistance to yaw (3.6e-5 of 9e-4 N m s), so that 0.2 % of the total is 5 %
    /// of the drag.
    pub(super) fn solver_error(self) -> f64 {
        match self {
            Self::Drag => 0.05,
            Self::MountYaw => 0.0,
            Self::Tether | Self::Righting | Self::Viscosity | Self::Young => 0.003,
        }
    }

    /// Returns the value of the parameter for a value of the fit's variable: the logarithm of its ratio to the start for
    /// a positive parameter, an angle in radians otherwise.
    pub(super) fn value(self, start: &Robot, closure: Closure, moved: f64) -> f64 {
        let mut robot = start.clone();
        match self.place(&mut robot, closure) {
            Some(place) => *place * moved.exp(),
            None => moved.to_degrees(),
        }
    }

    /// Returns the standard error of the value, given that of the moved quantity.
    pub(super) fn error(self, value: f64, moved_error: f64) -> f64 {
        if self.is_of_the_robot() { value * moved_error } else { moved_error.to_degrees() }
    }

    /// Sets the parameter of a robot.
    pub(super) fn put(self, robot: &mut Robot, closure: Closure, moved: f64) {
        if let Some(place) = self.place(robot, closure) {
            *place *= moved.exp();
        }
    }
}

impl FromStr for Parameter {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL.into_iter().find(|p| p.name() == name).ok_or_else(|| format!("give one or more of {}", names()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_name_fields_of_the_robot_file() {
        for parameter in Parameter::ALL {
            assert_eq!(parameter.name().parse(), Ok(parameter));
            let mut robot = Robot::default();
            parameter.put(&mut robot, Closure::Full, 0.1);
            let Some(key) = parameter.key(Closure::Full) else {
                assert_eq!(robot, Robot::default());
                continue;
            };
            let text = toml::Value::try_from(&robot).unwrap();
            let (table, name) = key.split_once('.').unwrap();
            let value = text[table][name].as_float().unwrap();
            assert_eq!(value, parameter.value(&Robot::default(), Closure::Full, 0.1), "{key}");
            assert_ne!(robot, Robot::default());
        }
        assert!("colour".parse::<Parameter>().is_err());
    }
}
