//! What can be fitted.

use sim::body::closure::Closure;
use sim::params::Robot;
use std::str::FromStr;

/// A parameter of the robot, or of how its sensor sits in it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Parameter {
    /// Stiffness of the tether, of the closure that is fitted.
    Tether,
    /// The righting moment, by the mass centre's depth below the joint.
    Righting,
    /// Coefficient of the base's rotational drag.
    Drag,
    /// Viscosity of the fluid.
    Viscosity,
    /// Young's modulus of the flagella.
    Young,
    /// By how much the sensor is turned in the body about the vertical.
    MountYaw,
}

impl Parameter {
    /// Every parameter.
    pub const ALL: [Self; 6] = [Self::Tether, Self::Righting, Self::Drag, Self::Viscosity, Self::Young, Self::MountYaw];

    /// Those that are fitted unless the user says otherwise. The flagella's stiffness is left out: it is measured better
    /// on a rod than on a robot, and the viscosity can hardly be told from it.
    pub const USUAL: [Self; 5] = [Self::Tether, Self::Righting, Self::Drag, Self::Viscosity, Self::MountYaw];

    /// Its name on the command line.
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

    /// Its key in the robot's file; the sensor's place is in none.
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

    /// Its unit.
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

    /// Its place in a robot; `None`: it is the sensor's.
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

    /// Whether it is the robot's, so that the model must be computed anew where it changes.
    pub(super) fn is_of_the_robot(self) -> bool {
        self != Self::MountYaw
    }

    /// How well the model's own numbers allow it to be told at best: standard error of what the fit moves.
    ///
    /// Two runs of a trial whose solver stops at 0.02 and at 0.001 differ by 0.2 % in yaw, and by up to 0.6 % in tilt. The
    /// base's drag is 4 % of what resists the yaw (3.6e-5 of 9e-4 N m s), so that 0.2 % of the whole is 5 % of it.
    pub(super) fn numbers(self) -> f64 {
        match self {
            Self::Drag => 0.05,
            Self::MountYaw => 0.0,
            Self::Tether | Self::Righting | Self::Viscosity | Self::Young => 0.003,
        }
    }

    /// What the fit moves, at `start`: the logarithm of a positive parameter over its start, so that it stays positive;
    /// radians of an angle.
    pub(super) fn value(self, start: &Robot, closure: Closure, moved: f64) -> f64 {
        let mut robot = start.clone();
        match self.place(&mut robot, closure) {
            Some(place) => *place * moved.exp(),
            None => moved.to_degrees(),
        }
    }

    /// Standard error of the value from that of what the fit moves.
    pub(super) fn error(self, value: f64, moved_error: f64) -> f64 {
        if self.is_of_the_robot() { value * moved_error } else { moved_error.to_degrees() }
    }

    /// Moves a robot's parameter.
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
    fn every_key_is_one_of_a_robots_file_and_moves_it() {
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
