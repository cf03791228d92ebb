//! Writes the robot file of a calibration.

use super::Calibration;
use crate::plan::with_fit;
use crate::text;
use std::fmt::Write;

/// Returns the file of a fitted robot: all parameters, and under `[fit]` the fitted ones with their covariance.
/// Comments list the trials; no program reads them.
pub fn to_toml(calibration: &Calibration) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let mut note = |line: String| {
        let _ = writeln!(text, "# {}", line.replace(['\n', '\r'], " "));
    };
    note(format!(
        "Fitted by `biflag calibrate` {}. What is known of the fitted parameters is under [fit].",
        env!("CARGO_PKG_VERSION")
    ));
    let mount = &calibration.mounting;
    note(format!(
        "The sensor at rest: pitch {} deg, roll {} deg.",
        text::decimal(mount.pitch_deg, 3),
        text::decimal(mount.roll_deg, 3)
    ));
    note(format!(
        "RMSE {:.3} deg before and {:.3} deg after.",
        calibration.rmse_before_deg, calibration.rmse_after_deg
    ));
    for line in calibration.cannot_tell.iter().chain(&calibration.misfits) {
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
    format!("{text}\n{}", with_fit(&calibration.robot, Some(&calibration.fit())))
}
