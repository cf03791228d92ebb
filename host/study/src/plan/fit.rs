//! `[fit]` of a robot file: the parameters that `calibrate` has fitted, and their uncertainties.

use super::PlanError;
use super::source::Source;
use serde::{Deserialize, Serialize};
use sim::body::closure::Closure;
use sim::functions::powi;
use sim::params::Robot;

/// Largest ratio between the value of a parameter and a bound of its interval if it counts as determined.
pub const MAX_FACTOR: f64 = 1.5;

/// Relative difference up to which two values in a file are the same, because a program may have rounded one of them.
const ROUNDED: f64 = 1e-4;

/// The fit of a robot's parameters, as its file states it.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub struct Fit {
    /// The closure of the fit. Its values hold only for this closure.
    pub closure: Closure,
    /// The kind of fitted trials.
    pub fitted_to: FittedTo,
    /// Whether the model describes the trials within their noise.
    pub is_described: bool,
    /// Names of the parameters in which the fit has not reached its minimum, so that their intervals do not hold.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub short_of_minimum: Vec<String>,
    /// Mean temperature of the sensor in the trials, °C.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Degrees of freedom of the scatter of the residuals.
    pub degrees_of_freedom: f64,
    /// Covariance of the parameters' errors, in their order. Units: the row's unit times the column's.
    pub covariance: Vec<Vec<f64>>,
    /// The part of the covariance estimated from the scatter of the residuals.
    pub scatter_covariance: Vec<Vec<f64>>,
    /// Whether the covariance lacks the correlations: earlier versions wrote comments without them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_correlations: bool,
    /// The parameters.
    pub parameters: Vec<FittedParameter>,
}

/// The kind of fitted trials.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "lowercase")]
pub enum FittedTo {
    /// Trials of a real robot, which the model describes only to within its own error.
    Robot,
    /// Trials of a model, or of a simulated robot behind an emulated board.
    Simulation,
}

/// Returns the text of a robot file.
pub fn with_fit(robot: &Robot, fit: Option<&Fit>) -> String {
    #[derive(Serialize)]
    struct OnlyFit<'a> {
        fit: &'a Fit,
    }
    // Numbers, flags, names and short lists all have a form in TOML.
    let parameters = toml::to_string(robot).unwrap_or_default();
    let fit = fit.and_then(|fit| toml::to_string(&OnlyFit { fit }).ok());
    fit.map_or(parameters.clone(), |fit| format!("{parameters}\n{fit}"))
}

/// A fitted parameter in a robot file.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub struct FittedParameter {
    /// Its name in `calibrate --fit`.
    pub name: String,
    /// Its key in the file; `None` for the mounting of the sensor.
    pub key: Option<String>,
    /// The unit of the numbers below.
    pub unit: String,
    /// The value that the fit started from.
    pub start: f64,
    /// The fitted value.
    pub value: f64,
    /// Standard error, without the model's error: the root of its variance in the covariance.
    pub std_error: f64,
    /// 95 % interval, with the model's error.
    pub interval_95: [f64; 2],
    /// Possible change of the value due to the model's error; `None` if it was fitted to a simulation.
    pub model_error: Option<f64>,
}

impl Fit {
    /// Returns the fit from the comments of a file written by an earlier version of `calibrate`; `None` for any other
    /// file. The comments do not state correlations.
    pub(super) fn of_comments(text: &str) -> Option<Self> {
        let parameters: Vec<FittedParameter> = text.lines().filter_map(FittedParameter::of_comment).collect();
        if parameters.is_empty() {
            return None;
        }
        let count = parameters.len();
        let diagonal = |i: usize, j: usize| if i == j { powi(parameters[i].std_error, 2) } else { 0.0 };
        let has_model_error = parameters.iter().any(|parameter| parameter.model_error.is_some());
        let closure = |word: &str| text.lines().any(|line| line.ends_with(&format!("for the closure {word}.")));
        Some(Self {
            closure: if closure("lumped") { Closure::Lumped } else { Closure::Full },
            fitted_to: if has_model_error { FittedTo::Robot } else { FittedTo::Simulation },
            is_described: true,
            short_of_minimum: Vec::new(),
            temperature_c: None,
            degrees_of_freedom: f64::INFINITY,
            covariance: (0..count).map(|i| (0..count).map(|j| diagonal(i, j)).collect()).collect(),
            scatter_covariance: vec![vec![0.0; count]; count],
            lacks_correlations: true,
            parameters,
        })
    }

    /// Returns the parameters whose values in the robot's file differ from the fit.
    pub fn changed(&self, robot: &Robot) -> Vec<&str> {
        let table = toml::Value::try_from(robot).ok();
        let is_changed = |parameter: &&FittedParameter| {
            let own = parameter.key.as_ref().and_then(|key| value_of(table.as_ref()?, key)?.as_float());
            own.is_some_and(|own| (own - parameter.value).abs() > ROUNDED * own.abs())
        };
        self.parameters.iter().filter(is_changed).map(|parameter| parameter.name.as_str()).collect()
    }

    /// Checks the values against each other and against the robot of the file.
    pub(super) fn check(&self, source: &Source, robot: &Robot) -> Result<(), PlanError> {
        let count = self.parameters.len();
        let wrong = |key: &str, what: String| {
            let cure = "fit again with `biflag calibrate`, or remove [fit] and all under it";
            Err(source.error_at(["fit", key], format!("[fit] {key}: {what}"), cure))
        };
        let table = toml::Value::try_from(robot).ok();
        for (i, parameter) in self.parameters.iter().enumerate() {
            let FittedParameter { name, key, value, std_error, .. } = parameter;
            if let Some(key) = key
                && table.as_ref().is_none_or(|table| value_of(table, key).is_none())
            {
                return wrong("parameters", format!("{key} is not a number of a robot file"));
            }
            if self.parameters[..i].iter().any(|other| other.name == *name) {
                return wrong("parameters", format!("{name} is there twice"));
            }
            if !(value.is_finite() && std_error.is_finite() && *std_error >= 0.0) {
                return wrong("parameters", format!("{name} = {value} with a standard error of {std_error}"));
            }
        }
        if self.degrees_of_freedom.is_nan() || self.degrees_of_freedom < 1.0 {
            return wrong("degrees_of_freedom", format!("{} is less than 1", self.degrees_of_freedom));
        }
        for (key, matrix) in [("covariance", &self.covariance), ("scatter_covariance", &self.scatter_covariance)] {
            if matrix.len() != count || matrix.iter().any(|row| row.len() != count) {
                return wrong(key, format!("it has not {count} rows and columns, one for each parameter"));
            }
            for (i, row) in matrix.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    let limit = (matrix[i][i] * matrix[j][j]).sqrt() * (1.0 + ROUNDED);
                    // NaN is in no range.
                    let is_possible = value.abs() <= limit && (value - matrix[j][i]).abs() <= ROUNDED * limit;
                    if !is_possible {
                        return wrong(key, format!("{value} in row {} is impossible", i + 1));
                    }
                }
            }
        }
        for (i, parameter) in self.parameters.iter().enumerate() {
            let std_error = self.covariance[i][i].sqrt();
            if (parameter.std_error - std_error).abs() > 0.01 * std_error
                || self.scatter_covariance[i][i] > self.covariance[i][i] * (1.0 + ROUNDED)
            {
                let what = format!("it contradicts the standard error {} of {}", parameter.std_error, parameter.name);
                return wrong("covariance", what);
            }
        }
        Ok(())
    }
}

impl FittedParameter {
    /// Reads a line of [`Fit::of_comments`].
    fn of_comment(line: &str) -> Option<Self> {
        let (name, rest) = line.strip_prefix("# ")?.split_once("): ")?;
        let (name, key) = name.split_once(" (")?;
        let number = |text: &str| text.split_whitespace().next()?.trim_end_matches([',', ';']).parse::<f64>().ok();
        let after = |words: &str| number(rest.split_once(words)?.1);
        let (value, std_error) = (number(rest)?, after(", standard error ")?);
        let unit = rest.split_once(' ').and_then(|(_, rest)| Some(rest.split_once(',')?.0)).unwrap_or_default();
        // A quantity that is not a parameter of the model has words in place of a key.
        (!key.contains(' ')).then(|| Self {
            name: name.to_owned(),
            key: Some(key.to_owned()),
            unit: unit.to_owned(),
            start: after("it was ").unwrap_or(value),
            value,
            std_error,
            interval_95: [after(", 95 % "), after(" to ")].map(|bound| bound.unwrap_or(value)),
            model_error: after("error of the model "),
        })
    }
}

/// Returns the value of a dotted key.
fn value_of<'t>(table: &'t toml::Value, key: &str) -> Option<&'t toml::Value> {
    key.split('.').try_fold(table, |value, part| value.get(part)).filter(|value| !value.is_table())
}

#[cfg(test)]
mod tests {
    use super::super::{RobotFile, robot};
    use super::*;

    /// Returns a file with a fit of two parameters.
    fn file() -> (Fit, String) {
        let parameter = |name: &str, key: Option<&str>, unit: &str, value: f64, std_error: f64| FittedParameter {
            name: name.to_owned(),
            key: key.map(str::to_owned),
            unit: unit.to_owned(),
            start: 1.0,
            value,
            std_error,
            interval_95: [value - 2.0 * std_error, value + 2.0 * std_error],
            model_error: (name == "viscosity").then_some(0.05),
        };
        let fit = Fit {
            closure: Closure::Full,
            fitted_to: FittedTo::Robot,
            is_described: true,
            short_of_minimum: Vec::new(),
            temperature_c: Some(21.37),
            degrees_of_freedom: 7.25,
            covariance: vec![vec![4e-4, -1.7e-3], vec![-1.7e-3, 0.09]],
            scatter_covariance: vec![vec![1e-4, 0.0], vec![0.0, 0.04]],
            lacks_correlations: false,
            parameters: vec![
                parameter("viscosity", Some("fluid.viscosity_pa_s"), "Pa s", 1.0237, 0.02),
                parameter("mount-yaw", None, "deg", -1.53, 0.3),
            ],
        };
        let mut robot = Robot::default();
        robot.fluid.viscosity_pa_s = 1.0237;
        let text = with_fit(&robot, Some(&fit));
        (fit, text)
    }

    fn read(text: &str) -> Result<Option<Fit>, PlanError> {
        RobotFile { name: "fitted.toml".to_owned(), text: text.to_owned() }.fit()
    }

    #[test]
    fn reformatted_file_says_the_same() {
        let (fit, text) = file();
        assert_eq!(read(&text).unwrap().unwrap(), fit, "{text}");
        // Tables in another order, other spaces, no comments: the output of a program that only knows TOML.
        let reformatted = toml::to_string_pretty(&text.parse::<toml::Table>().unwrap()).unwrap();
        assert_ne!(reformatted, text);
        assert_eq!(read(&reformatted).unwrap().unwrap(), fit, "{reformatted}");
        assert_eq!(fit.changed(&robot::parse(&text, "fitted.toml").unwrap()), [""; 0]);
        let edited = text.replace("viscosity_pa_s = 1.0237", "viscosity_pa_s = 1.1");
        let changed = robot::parse(&edited, "fitted.toml").unwrap();
        assert_eq!(read(&edited).unwrap().unwrap().changed(&changed), ["viscosity"]);
        assert_eq!(read("").unwrap(), None);
    }

    #[test]
    fn comments_of_earlier_versions_are_read() {
        let text = "# Fitted by `biflag calibrate` 0.1.0, for the closure lumped.\n#\n\
             # tether (joint.tether_full_nm_per_rad): 5.00000e-4 N m/rad, standard error 5.0e-6, 95 % 4.9e-4 to 5.1e-4, \
             error of the model 1.0e-5; it was 4.7e-4\n\
             # mount-yaw (not a parameter of the model): 1.5 deg, standard error 0.1, 95 % 1.3 to 1.7; it was 0\n\
             [fluid]\nviscosity_pa_s = 1.0\n";
        let fit = read(text).unwrap().unwrap();
        let [tether] = fit.parameters.as_slice() else { panic!("{fit:?}") };
        assert!(fit.lacks_correlations && fit.closure == Closure::Lumped && fit.fitted_to == FittedTo::Robot);
        assert_eq!(
            (tether.value, tether.std_error, tether.start, tether.unit.as_str()),
            (5e-4, 5e-6, 4.7e-4, "N m/rad")
        );
        assert_eq!((tether.interval_95, tether.model_error), ([4.9e-4, 5.1e-4], Some(1e-5)));
        assert_eq!(fit.covariance, [[5e-6f64.powi(2)]]);
        assert_eq!(read("# made by hand (by me): 3 m\n[fluid]\nviscosity_pa_s = 1\n").unwrap(), None);
    }

    #[test]
    fn every_mistake_has_one_error() {
        let (_, text) = file();
        for (from, to, message) in [
            ("degrees_of_freedom = 7.25", "degrees_of_freedom = 0.5", "degrees_of_freedom: 0.5 is less than 1"),
            ("degrees_of_freedom = 7.25", "degrees = 7.25", "unknown key `degrees`"),
            ("closure = \"full\"", "closure = \"round\"", "closure cannot be \"round\""),
            ("closure = \"full\"\n", "", "the key `closure` is missing"),
            ("[0.0004, -0.0017]", "[0.0004]", "covariance: it has not 2 rows and columns"),
            ("[0.0004, -0.0017]", "[0.0004, -0.9]", "covariance: -0.9 in row 1 is impossible"),
            ("[0.0004, -0.0017]", "[0.0004, 0.0017]", "covariance: 0.0017 in row 1 is impossible"),
            ("[0.0004, -0.0017]", "[nan, -0.0017]", "covariance: NaN in row 1 is impossible"),
            ("std_error = 0.02", "std_error = 0.01", "contradicts the standard error 0.01 of viscosity"),
            ("fluid.viscosity_pa_s", "fluid.colour", "fluid.colour is not a number of a robot file"),
            ("name = \"mount-yaw\"", "name = \"viscosity\"", "viscosity is there twice"),
        ] {
            assert!(text.contains(from), "{from} in {text}");
            let error = read(&text.replace(from, to)).unwrap_err().to_string();
            assert!(error.starts_with("fitted.toml:") && error.contains(message), "{error}\nexpected {message}");
        }
    }
}
