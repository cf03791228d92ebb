//! Whether two trials are of the same robot, model and speeds, so that they can be compared.

use super::{Recording, TwinError};
use sim::params::Robot;

/// Why two trials should not be compared, if there is a reason.
pub(super) fn difference(a: &Recording, b: &Recording) -> Result<Option<String>, TwinError> {
    if a.speeds() != b.speeds() {
        let speeds = |r: &Recording| r.speeds().map(|speed| speed.rpm().to_string()).join(", ");
        return Ok(Some(format!("they have no common trial: the speeds are {} and {} rpm", speeds(a), speeds(b))));
    }
    if a.reverse() != b.reverse() {
        return Ok(Some("they have no common trial: a motor reverses in one of them, or at another time".to_owned()));
    }
    if let (Some(one), Some(other)) = (&a.model, &b.model)
        && one.closure != other.closure
    {
        return Ok(Some(format!("they have other closures: {:?} and {:?}", one.closure, other.closure).to_lowercase()));
    }
    Ok(robot_difference(&a.robot()?, &b.robot()?).map(|text| format!("they have other robots: {text}")))
}

/// The first parameter in which two robots differ. How their model is solved is not the robot's.
fn robot_difference(a: &Robot, b: &Robot) -> Option<String> {
    fn first(a: &toml::Value, b: &toml::Value, key: &str) -> Option<String> {
        if let (toml::Value::Table(one), toml::Value::Table(other)) = (a, b) {
            let keys = one.keys().chain(other.keys().filter(|key| !one.contains_key(*key)));
            let path = |name: &String| if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
            let none = toml::Value::String("not set".to_owned());
            return keys
                .filter_map(|name| first(one.get(name).unwrap_or(&none), other.get(name).unwrap_or(&none), &path(name)))
                .next();
        }
        (a != b).then(|| format!("{key} is {a} and {b}"))
    }
    let value = |robot: &Robot| {
        toml::Value::try_from(Robot { solver: sim::params::SolverSettings::default(), ..robot.clone() }).ok()
    };
    first(&value(a)?, &value(b)?, "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_are_told_apart_by_the_first_parameter_that_differs() {
        let published = Robot::default();
        assert_eq!(robot_difference(&published, &published), None);
        let mut other = published.clone();
        other.solver.sweeps += 1;
        assert_eq!(robot_difference(&published, &other), None, "the robot is the same");
        other.fluid.viscosity_pa_s = 1.2;
        assert_eq!(robot_difference(&published, &other).unwrap(), "fluid.viscosity_pa_s is 1.0 and 1.2");
        let mut mixed = published.clone();
        mixed.fluid.glycerol = Some(sim::params::Glycerol { mass_fraction: 0.9, temperature_c: 20.0 });
        assert!(robot_difference(&published, &mixed).unwrap().starts_with("fluid.glycerol is "));
    }
}
