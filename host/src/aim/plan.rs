//! Writes a plan with the speeds that were found.

use super::{Solution, Target};
use crate::plan::Phases;
use sim::params::BUILT_IN;
use std::fmt::Write;
use std::path::Path;

/// Returns the text of a plan of the solutions' speeds, one trial each, that `record` and `simulate` run.
///
/// `out`: the plan's file, after which the session is named; `robot`: name of a built-in robot, or path of its file.
pub fn plan(out: &Path, robot: &Path, target: &Target, solutions: &[Solution]) -> String {
    let name = out.file_stem().unwrap_or_default().to_string_lossy();
    let robot = named_in(out, robot);
    let mut text = format!("# Speeds for {target} of the robot {}:\n", comment(&robot));
    for Solution { state, interval, .. } in solutions {
        let (attitude, [yaw, pitch, roll]) =
            (&state.attitude, [interval.yaw_ci_deg, interval.pitch_ci_deg, interval.roll_ci_deg]);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "#   {}, {} rpm: yaw {:.2} ({:.2} to {:.2}), pitch {:.2} ({:.2} to {:.2}), roll {:.2} ({:.2} to {:.2}) deg",
            state.w1_rpm,
            state.w2_rpm,
            attitude.yaw_deg,
            yaw[0],
            yaw[1],
            attitude.pitch_deg,
            pitch[0],
            pitch[1],
            attitude.roll_deg,
            roll[0],
            roll[1]
        );
    }
    let Phases { calibrate_s, preroll_s, run_s, decay_s } = Phases::default();
    let pairs: Vec<_> = solutions.iter().map(|s| format!("[{}, {}]", s.state.w1_rpm, s.state.w2_rpm)).collect();
    let [name, robot] = [&*name, &*robot].map(|text| toml::Value::String(text.to_owned()));
    let _ = write!(
        text,
        "\n[session]\nname = {name}\nrobot = {robot}\n\n[trial]\ncalibrate = {calibrate_s}\npreroll = {preroll_s}\n\
         run = {run_s}\ndecay = {decay_s}\n\n[speeds]\npairs = [{}]\n",
        pairs.join(", ")
    );
    text
}

/// Returns how a plan names the robot: a file in its own folder by its name, any other by its whole path.
fn named_in(plan: &Path, robot: &Path) -> String {
    if robot.to_str().is_some_and(|name| BUILT_IN.contains(&name)) {
        return robot.display().to_string();
    }
    let folder = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
    match robot.file_name() {
        Some(name) if folder(plan) == folder(robot) => name.to_string_lossy().into_owned(),
        _ => std::path::absolute(robot).unwrap_or_else(|_| robot.to_owned()).display().to_string(),
    }
}

/// Returns text for a line of a comment.
fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
