//! Writes a plan with the speeds that were found.

use super::{Attitude, Solution, Target};
use crate::plan::Phases;
use sim::params::BUILT_IN;
use std::path::Path;

/// Returns the text of a plan of the solutions' speeds, one trial each, that `record` and `simulate` run.
///
/// `out`: the plan's file, which also names the session; `robot`: name of a built-in robot, or path of its file.
pub fn plan(out: &Path, robot: &Path, target: &Target, solutions: &[Solution]) -> String {
    let name = out.file_stem().unwrap_or_default().to_string_lossy();
    let robot = named_in(out, robot);
    let mut text = format!("# Speeds for {target} of the robot {}:\n", comment(&robot));
    for Solution { state, interval, .. } in solutions {
        let Attitude { yaw_deg, pitch_deg, roll_deg, .. } = state.attitude;
        let angles = [
            ("yaw", yaw_deg, interval.yaw_ci_deg),
            ("pitch", pitch_deg, interval.pitch_ci_deg),
            ("roll", roll_deg, interval.roll_ci_deg),
        ];
        let angles = angles.map(|(name, deg, ci)| match ci {
            Some([low, high]) => format!("{name} {deg:.2} ({low:.2} to {high:.2})"),
            None => format!("{name} {deg:.2} (interval unknown)"),
        });
        text += &format!("#   {}, {} rpm: {} deg\n", state.w1_rpm, state.w2_rpm, angles.join(", "));
    }
    let Phases { calibrate_s, preroll_s, run_s, decay_s, .. } = Phases::default();
    let pairs: Vec<_> = solutions.iter().map(|s| format!("[{}, {}]", s.state.w1_rpm, s.state.w2_rpm)).collect();
    let [name, robot] = [&*name, &*robot].map(|text| toml::Value::String(text.to_owned()));
    text += &format!(
        "\n[session]\nname = {name}\nrobot = {robot}\n\n[trial]\ncalibrate = {calibrate_s}\npreroll = {preroll_s}\n\
         run = {run_s}\ndecay = {decay_s}\n\n[speeds]\npairs = [{}]\n",
        pairs.join(", ")
    );
    text
}

/// Returns the plan's reference to the robot: the file name if both are in the same folder, otherwise the whole path.
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
