//! Parameters that can be fitted.

use crate::attitude::wrapped;
use biflag_log::similar::suggest;
use sim::body::closure::Closure;
use sim::functions::exp;
use sim::params::{HeadShape, Robot};
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
    /// Angle of flagellum 2 minus that of flagellum 1 at zero encoder counts.
    Phase,
    /// Angle of flagellum 1 at zero encoder counts; flagellum 2 turns with it.
    PhaseBoth,
}

/// A key of the robot's file, and its place in a robot.
type Keyed = (&'static str, fn(&mut Robot) -> &mut f64);

impl Parameter {
    /// All parameters that can be requested; [`Self::Phase`] requests both phases.
    pub const ALL: [Self; 7] =
        [Self::Tether, Self::Righting, Self::Drag, Self::Viscosity, Self::Young, Self::MountYaw, Self::Phase];

    /// Returns the parameters fitted by default. The flagella's stiffness is not among them: it is better measured on a
    /// rod, and is nearly indistinguishable from the viscosity.
    pub fn usual(robot: &Robot) -> Vec<Self> {
        let mut usual = vec![Self::Tether, Self::Righting, Self::Drag, Self::Viscosity, Self::MountYaw];
        usual.retain(|parameter| parameter.has_effect(robot));
        usual
    }

    /// Returns whether the model of this robot depends on the parameter: the drag of the base has no effect if the head
    /// is a body in the flow.
    pub(super) fn has_effect(self, robot: &Robot) -> bool {
        self != Self::Drag || robot.head.shape == HeadShape::Local
    }

    /// Returns its name, the unit of its values, and the relative error that the solver's error causes in it, or the error in
    /// radians for an angle.
    fn row(self) -> (&'static str, &'static str, f64) {
        match self {
            Self::Tether => ("tether", "N m/rad", 0.003),
            Self::Righting => ("righting", "m", 0.003),
            Self::Drag => ("drag", "1", 0.05),
            Self::Viscosity => ("viscosity", "Pa s", 0.003),
            Self::Young => ("young", "Pa", 0.003),
            Self::MountYaw => ("mount-yaw", "deg", 0.0),
            Self::Phase => ("phase", "deg", 0.03),
            Self::PhaseBoth => ("phase-both", "deg", 0.03),
        }
    }

    /// Returns its name.
    pub fn name(self) -> &'static str {
        self.row().0
    }

    /// Returns the key in the robot's file; `None` for the mounting of the sensor.
    pub fn key(self, closure: Closure) -> Option<&'static str> {
        let phases = self.is_phase().then_some("flagellum.phase_deg");
        self.place(closure).map(|(key, _)| key).or(phases)
    }

    /// Returns the unit.
    pub fn unit(self) -> &'static str {
        self.row().1
    }

    /// Returns the key of a positive parameter in the robot's file, and its place in a robot; `None` for an angle.
    fn place(self, closure: Closure) -> Option<Keyed> {
        Some(match self {
            Self::Tether if closure == Closure::Lumped => {
                ("joint.tether_lumped_nm_per_rad", |r| &mut r.joint.tether_lumped_nm_per_rad)
            }
            Self::Tether => ("joint.tether_full_nm_per_rad", |r| &mut r.joint.tether_full_nm_per_rad),
            Self::Righting => ("base.mass_centre_below_joint_m", |r| &mut r.base.mass_centre_below_joint_m),
            Self::Drag => ("base.rotational_drag", |r| &mut r.base.rotational_drag),
            Self::Viscosity => ("fluid.viscosity_pa_s", |r| &mut r.fluid.viscosity_pa_s),
            Self::Young => ("flagellum.young_pa", |r| &mut r.flagellum.young_pa),
            Self::MountYaw | Self::Phase | Self::PhaseBoth => return None,
        })
    }

    /// Returns whether it is an angle, which the fit moves in radians.
    pub(super) fn is_angle(self) -> bool {
        matches!(self, Self::MountYaw | Self::Phase | Self::PhaseBoth)
    }

    /// Returns whether it is an angle of the flagella.
    pub(super) fn is_phase(self) -> bool {
        matches!(self, Self::Phase | Self::PhaseBoth)
    }

    /// Returns the contribution of discretisation to the standard error, in the units of the fit.
    ///
    /// Two runs of a trial with solver tolerances of 0.02 and 0.001 differ by 0.2 % in yaw, and by up to 0.6 % in tilt.
    /// The base's drag is 4 % of the total resistance to yaw (3.6e-5 of 9e-4 N m s), so that 0.2 % of the total is 5 %
    /// of the drag. Steady tilts are within 0.1 degrees, and change by about 3 degrees per radian of the phase at equal
    /// speeds.
    pub(super) fn solver_error(self) -> f64 {
        self.row().2
    }

    /// Returns the value of the parameter for a value of the fit's variable: the logarithm of its ratio to the start for
    /// a positive parameter, an angle in radians otherwise.
    pub(super) fn value(self, start: &Robot, closure: Closure, moved: f64) -> f64 {
        if let Some((_, place)) = self.place(closure) {
            return *place(&mut start.clone()) * exp(moved);
        }
        let [one, two] = start.flagellum.phase_deg;
        let from = match self {
            Self::Phase => two - one,
            Self::PhaseBoth => one,
            _ => 0.0,
        };
        from + moved.to_degrees()
    }

    /// Returns the standard error of the value, given the standard error of the fit's variable.
    pub(super) fn error(self, value: f64, moved_error: f64) -> f64 {
        if self.is_angle() { moved_error.to_degrees() } else { value * moved_error }
    }

    /// Returns the bounds of an interval about the value, given its half width in the fit's variable.
    pub(super) fn bounds(self, value: f64, half: f64) -> [f64; 2] {
        let bound =
            |side: f64| if self.is_angle() { value + (side * half).to_degrees() } else { value * exp(side * half) };
        [bound(-1.0), bound(1.0)]
    }

    /// Sets the parameter of a robot.
    pub(super) fn put(self, robot: &mut Robot, closure: Closure, moved: f64) {
        if let Some((_, place)) = self.place(closure) {
            *place(robot) *= exp(moved);
        }
        let [one, two] = &mut robot.flagellum.phase_deg;
        if self == Self::PhaseBoth {
            *one = wrapped(*one + moved.to_degrees());
        }
        if self.is_phase() {
            *two = wrapped(*two + moved.to_degrees());
        }
    }
}

impl FromStr for Parameter {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = Self::ALL.map(Self::name);
        let otherwise = || suggest(name, names, &format!("give one or more of {}", names.join(", ")));
        Self::ALL.into_iter().find(|p| p.name() == name).ok_or_else(otherwise)
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
            let value = &text[table][name];
            let value = value.get(1).unwrap_or(value).as_float().unwrap();
            assert_eq!(value, parameter.value(&Robot::default(), Closure::Full, 0.1), "{key}");
            assert_ne!(robot, Robot::default());
        }
        assert!("colour".parse::<Parameter>().is_err());
    }

    #[test]
    fn phases_are_angles_between_the_flagella_and_of_both() {
        let mut robot = Robot::default();
        robot.flagellum.phase_deg = [170.0, 60.0];
        let value =
            |robot: &Robot| [Parameter::Phase, Parameter::PhaseBoth].map(|p| p.value(robot, Closure::Full, 0.0));
        assert_eq!(value(&robot), [-110.0, 170.0]);
        Parameter::Phase.put(&mut robot, Closure::Full, 10f64.to_radians());
        Parameter::PhaseBoth.put(&mut robot, Closure::Full, 20f64.to_radians());
        let [one, two] = robot.flagellum.phase_deg;
        assert!((one + 170.0).abs() < 1e-9 && (two - 90.0).abs() < 1e-9, "{one} {two}");
        assert_eq!(wrapped(-540.0 + 1.0), -179.0);
    }
}
