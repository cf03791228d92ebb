//! The quantity that a sweep varies: a number in the robot's file, a group, or a speed.

use crate::plan::source::real;
use sim::groups::Groups;
use sim::params::Robot;
use toml::Value;

/// A quantity that varies.
#[derive(Clone, PartialEq, Debug)]
pub enum Key {
    /// A dotted key of the robot's file.
    Robot(String),
    /// A group, in multiples of its published value.
    Group(Group),
    /// The speed of motor 1 or 2 (index 0 or 1), rpm.
    Speed(usize),
}

/// One of the four groups of [`Groups`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Group {
    /// omega mu l^4/(E I).
    Stiffness,
    /// d/l.
    Spacing,
    /// pitch/L.
    Pitch,
    /// R/L.
    Radius,
}

/// The keys of the speeds in a plan.
pub const SPEEDS: [&str; 2] = ["speeds.w1_rpm", "speeds.w2_rpm"];

/// Keys that depend on the contour length, and through it on the groups `pitch` and `radius`.
const OF_THE_CONTOUR: [&str; 9] = [
    "flagellum.young_pa",
    "flagellum.density_kg_m3",
    "flagellum.edge_length_m",
    "base.motor_distance_m",
    "base.mass_centre_below_joint_m",
    "joint.tether_full_nm_per_rad",
    "joint.tether_lumped_nm_per_rad",
    "joint.viscous_nms",
    "joint.coulomb_nm",
];

impl Group {
    /// All groups, in the order of the table.
    pub const ALL: [Self; 4] = [Self::Stiffness, Self::Spacing, Self::Pitch, Self::Radius];

    /// Returns the key in a plan.
    pub fn name(self) -> &'static str {
        ["group.stiffness", "group.spacing", "group.pitch", "group.radius"][self as usize]
    }

    fn place(self, groups: &mut Groups) -> &mut f64 {
        match self {
            Self::Stiffness => &mut groups.stiffness,
            Self::Spacing => &mut groups.spacing,
            Self::Pitch => &mut groups.pitch,
            Self::Radius => &mut groups.radius,
        }
    }

    /// Returns the value of the group.
    pub fn of(self, groups: &Groups) -> f64 {
        *self.place(&mut { *groups })
    }

    /// Sets the group to a multiple of its published value.
    pub fn set(self, groups: &mut Groups, multiple: f64) {
        *self.place(groups) = multiple * self.of(&Groups::of(&Robot::published()));
    }

    /// Returns whether changing this group changes this key of the robot file.
    pub fn moves(self, key: &str) -> bool {
        match self {
            Self::Stiffness => key == "flagellum.young_pa",
            Self::Spacing => key == "base.motor_distance_m",
            Self::Pitch => key == "flagellum.pitch_m" || OF_THE_CONTOUR.contains(&key),
            Self::Radius => key == "flagellum.helix_radius_m" || OF_THE_CONTOUR.contains(&key),
        }
    }
}

impl Key {
    /// Returns the key of this name; `None` if it is neither a group, nor a speed, nor a numeric key of the robot.
    pub fn parse(name: &str, robot: &Value) -> Option<Self> {
        let group = Group::ALL.into_iter().find(|group| group.name() == name).map(Self::Group);
        let speed = SPEEDS.iter().position(|speed| *speed == name).map(Self::Speed);
        let number = || number(robot, name).map(|_| Self::Robot(name.to_owned()));
        group.or(speed).or_else(number)
    }

    /// Returns the group, if the key is one.
    pub fn group(&self) -> Option<Group> {
        if let Self::Group(group) = self { Some(*group) } else { None }
    }

    /// Returns the name in a plan.
    pub fn name(&self) -> &str {
        match self {
            Self::Robot(key) => key,
            Self::Group(group) => group.name(),
            Self::Speed(motor) => SPEEDS[*motor],
        }
    }
}

/// Returns the value at a dotted key of a robot's file.
pub fn value<'v>(robot: &'v Value, key: &str) -> Option<&'v Value> {
    key.split('.').try_fold(robot, |value, part| value.get(part))
}

/// Returns the number at a dotted key.
pub fn number(robot: &Value, key: &str) -> Option<f64> {
    real(value(robot, key)?)
}

/// Sets the number at an existing dotted key of the robot. An integer key takes whole numbers.
pub fn set(robot: &mut Value, key: &str, number: f64) {
    let target = key.split('.').try_fold(robot, |value, part| value.get_mut(part));
    match target {
        Some(Value::Float(target)) => *target = number,
        Some(Value::Integer(target)) => *target = number as i64,
        _ => {}
    }
}

/// Returns every dotted key with a numeric value.
pub fn numbers(robot: &Value) -> Vec<String> {
    let mut keys = Vec::new();
    for (name, value) in robot.as_table().into_iter().flatten() {
        match value {
            Value::Float(_) | Value::Integer(_) => keys.push(name.clone()),
            Value::Table(_) => keys.extend(numbers(value).into_iter().map(|key| format!("{name}.{key}"))),
            _ => {}
        }
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    fn physical() -> Value {
        Value::try_from(Robot::default()).unwrap()
    }

    #[test]
    fn every_number_of_a_robot_is_a_key() {
        let keys = numbers(&physical());
        for key in ["fluid.viscosity_pa_s", "flagellum.young_pa", "solver.sweeps", "joint.coulomb_nm"] {
            assert!(keys.iter().any(|name| name == key), "{key}");
            assert_eq!(Key::parse(key, &physical()), Some(Key::Robot(key.to_owned())));
        }
        for key in ["fluid", "fluid.viscosity", "head.shape", "tank.length_m", "group.size", "flagellum.phase_deg"] {
            assert_eq!(Key::parse(key, &physical()), None, "{key}");
        }
    }

    #[test]
    fn a_key_is_set_with_its_type() {
        let mut robot = physical();
        set(&mut robot, "fluid.viscosity_pa_s", 0.8);
        set(&mut robot, "solver.sweeps", 30.0);
        let robot: Robot = robot.try_into().unwrap();
        assert_eq!((robot.fluid.viscosity_pa_s, robot.solver.sweeps), (0.8, 30));
    }

    /// A group changes exactly the keys that it claims to change.
    #[test]
    fn a_group_moves_what_it_says() {
        let like = Robot {
            joint: sim::params::Joint { viscous_nms: 1e-6, coulomb_nm: 1e-6, ..Default::default() },
            ..Default::default()
        };
        let before = Value::try_from(&like).unwrap();
        for group in Group::ALL {
            // A smaller pitch or radius shortens the turns, and with them the edges.
            let mut groups = Groups::of(&like);
            group.set(&mut groups, 0.8);
            let after = Value::try_from(groups.robot(&like, 1.0, 1.0)).unwrap();
            for key in numbers(&before) {
                let [old, new] = [&before, &after].map(|robot| number(robot, &key).unwrap());
                let moved = (new - old).abs() > 1e-9 * old.abs();
                assert_eq!(moved, group.moves(&key), "{group:?} {key}: {old} {new}");
            }
        }
    }
}
