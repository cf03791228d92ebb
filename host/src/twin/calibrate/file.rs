//! Writes the robot file of a calibration.

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
