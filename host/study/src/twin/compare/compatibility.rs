//! Checks whether two trials have the same robot, model and speeds, so that they can be compared.

use crate::trial::Data;
use crate::twin::TwinError;
use sim::body::closure::Closure;
use sim::params::Robot;

/// Returns the reason why two trials should not be compared, if there is one.
pub(super) fn difference(a: &Data, b: &Data) -> Result<Option<String>, TwinError> {
    if is_same_recording(a, b) {
        return Ok(Some("both are the same recording".to_owned()));
    }
    // An import on the clock of a recording without encoders has the speeds that were measured.
    let are_measured = |recording: &Data, other: &Data| {
        recording.is_blind() && other.records.import.as_ref().is_some_and(|import| import.clock_rms_deg.is_some())
    };
    if a.planned_speeds() != b.planned_speeds() && !are_measured(a, b) && !are_measured(b, a) {
        let speeds = |data: &Data| data.planned_speeds().map(|speed| speed.rpm().to_string()).join(", ");
        return Ok(Some(format!("the speeds differ: {} and {} rpm", speeds(a), speeds(b))));
    }
    if a.reverse() != b.reverse() {
        return Ok(Some("the reversals differ".to_owned()));
    }
    // A recording and its replay start with the flagella's actual angles.
    let is_planned = |data: &Data| data.is_model() && data.records.replay.is_none();
    let phase = |data: &Data| is_planned(data).then(|| data.trial().phase_deg.unwrap_or_default());
    if let (Some(one), Some(other)) = (phase(a), phase(b))
        && one != other
    {
        return Ok(Some(format!("the starting phases differ: {one:?} and {other:?} deg")));
    }
    Ok(Maker::of(a)?.difference(&Maker::of(b)?))
}

/// The robot and the closure behind the angles of a log or of a sweep.
#[derive(Clone, Debug)]
pub struct Maker {
    /// The robot.
    pub robot: Robot,
    /// The closure; `None` without a model.
    pub closure: Option<Closure>,
}

impl Maker {
    /// Returns the maker of a log's angles.
    ///
    /// # Errors
    /// [`TwinError::Robot`] if the robot's parameters in the log are invalid.
    pub fn of(data: &Data) -> Result<Self, TwinError> {
        let robot = data.robot().map_err(|source| TwinError::robot(data, source))?;
        let closure = data.records.model.as_ref().map(|model| model.closure);
        Ok(Self { robot, closure })
    }

    /// Returns the reason why the angles of two makers should not be compared, if there is one.
    pub fn difference(&self, other: &Self) -> Option<String> {
        match (self.closure, other.closure) {
            (Some(a), Some(b)) if a != b => Some(format!("the closures differ: {a:?} and {b:?}").to_lowercase()),
            _ => robot_difference(&self.robot, &other.robot).map(|text| format!("the robots differ: {text}")),
        }
    }
}

/// Returns whether two logs are the same recording, possibly copied, recovered or cut. Comparing a recording with
/// itself shows nothing.
fn is_same_recording(a: &Data, b: &Data) -> bool {
    let count = a.readings.len().min(b.readings.len());
    a.is_recorded() && b.is_recorded() && count > 0 && a.readings[..count] == b.readings[..count]
}

/// Returns the first parameter in which two robots differ, apart from the parameters of the solver.
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
    fn robot_difference_is_the_first_parameter_that_differs() {
        let published = Robot::published();
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
