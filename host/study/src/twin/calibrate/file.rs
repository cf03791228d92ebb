//! Writes the robot file of a calibration, and reads the standard errors back from it.

use super::{Calibration, Estimate};
use crate::text;
use std::fmt::Write;

/// Returns the file of a fitted robot: all parameters, and comments with the origin of the fitted ones.
pub fn to_toml(calibration: &Calibration) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let mut note = |line: String| {
        let _ = writeln!(text, "# {}", line.replace(['\n', '\r'], " "));
    };
    let closure = format!("{:?}", calibration.closure).to_lowercase();
    note(format!("Fitted by `biflag calibrate` {}, for the closure {closure}.", env!("CARGO_PKG_VERSION")));
    note(String::new());
    for Estimate { name, key, unit, start, value, std_error, model_error, interval_95: [low, high] } in
        &calibration.parameters
    {
        let place = key.unwrap_or("not a parameter of the model");
        let model = model_error.map_or_else(String::new, |error| format!(", error of the model {error:.1e}"));
        note(format!(
            "{name} ({place}): {value:.5e} {unit}, standard error {std_error:.1e}, 95 % {low:.5e} to {high:.5e}{model}; it \
             was {start:.5e}"
        ));
    }
    let mount = &calibration.mounting;
    note(format!(
        "the sensor at rest: pitch {} deg, roll {} deg",
        text::decimal(mount.pitch_deg, 3),
        text::decimal(mount.roll_deg, 3)
    ));
    note(format!("RMSE {:.3} deg before and {:.3} deg after", calibration.rmse_before_deg, calibration.rmse_after_deg));
    for line in &calibration.cannot_tell {
        note(line.clone());
    }
    note(String::new());
    note("Fitted to:".to_owned());
    for trial in &calibration.trials {
        let log = trial.log.file_name().unwrap_or_default().to_string_lossy();
        let [before, after] =
            [trial.rmse_before_deg, trial.rmse_after_deg].map(|deg| deg.map(|deg| format!("{deg:.2}")).join(", "));
        note(format!("{log}: RMSE of yaw, pitch, roll {before} deg before and {after} deg after"));
        note(format!("  sha256 {}", trial.sha256));
    }
    text.push('\n');
    // Numbers, flags, names and short lists all have a form in TOML.
    text + &toml::to_string(&calibration.robot).unwrap_or_default()
}

/// The standard error of a fitted parameter, as a robot file says it.
#[derive(Clone, PartialEq, Debug)]
pub struct StdError {
    /// Key of the parameter, such as `fluid.viscosity_pa_s`.
    pub key: String,
    /// The fitted value.
    pub value: f64,
    /// Its standard error.
    pub std_error: f64,
}

/// Returns the standard errors that a file of [`to_toml`] says; none for any other robot file.
pub fn std_errors(text: &str) -> Vec<StdError> {
    let error = |line: &str| {
        let (name, rest) = line.strip_prefix("# ")?.split_once("): ")?;
        let (_, key) = name.split_once(" (")?;
        let value = rest.split_whitespace().next()?.parse().ok()?;
        let (_, rest) = rest.split_once(", standard error ")?;
        let std_error = rest.split(',').next()?.parse().ok()?;
        // What is no parameter of the model has words in place of a key.
        (!key.contains(' ')).then(|| StdError { key: key.to_owned(), value, std_error })
    };
    text.lines().filter_map(error).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::calibrate::Mounting;
    use sim::body::closure::Closure;
    use sim::params::Robot;

    #[test]
    fn standard_errors_are_read_back() {
        let estimate = |name, key, unit, value: f64, model_error| Estimate {
            name,
            key,
            unit,
            start: 1.0,
            value,
            std_error: 0.01 * value.abs(),
            model_error,
            interval_95: [0.98 * value, 1.02 * value],
        };
        let calibration = Calibration {
            closure: Closure::Full,
            correlations: Vec::new(),
            condition_number: 1.0,
            cannot_tell: vec!["the drag is known to only 30 %".to_owned()],
            rmse_before_deg: 3.0,
            rmse_after_deg: 0.1,
            trials: Vec::new(),
            simulations: 8,
            findings: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            parameters: vec![
                estimate("tether", Some("joint.tether_full_nm_per_rad"), "N m/rad", 5e-4, Some(1e-5)),
                estimate("drag", Some("base.rotational_drag"), "1", 2.3, None),
                estimate("mount-yaw", None, "deg", -1.5, None),
            ],
            mounting: Mounting { pitch_deg: 0.1, roll_deg: 0.2, std_error_deg: None },
            robot: Robot::default(),
        };
        let text = to_toml(&calibration);
        let error = |key: &str, value: f64, std_error| StdError { key: key.to_owned(), value, std_error };
        assert_eq!(
            std_errors(&text),
            [error("joint.tether_full_nm_per_rad", 5e-4, 5e-6), error("base.rotational_drag", 2.3, 0.023)],
            "{text}"
        );
        assert_eq!(std_errors("# made by hand (by me): 3 m\n[fluid]\nviscosity_pa_s = 1\n"), []);
    }
}
