//! Writes a plan with the speeds that were found.

use super::Solution;
use crate::plan::Phases;
use std::fmt::Write;

/// Returns a plan of the solutions' speeds, one trial each, that `record` and `simulate` run.
///
/// `name`: of the session; `robot`: name of a built-in robot, or path of its file from the plan's folder; `wanted`: what the
/// speeds are for.
pub fn plan(name: &str, robot: &str, wanted: &str, solutions: &[Solution]) -> String {
    let mut text = format!("# Speeds for {} of the robot {}:\n", comment(wanted), comment(robot));
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
    let [name, robot] = [name, robot].map(|text| toml::Value::String(text.to_owned()));
    let _ = write!(
        text,
        "\n[session]\nname = {name}\nrobot = {robot}\n\n[trial]\ncalibrate = {calibrate_s}\npreroll = {preroll_s}\n\
         run = {run_s}\ndecay = {decay_s}\n\n[speeds]\npairs = [{}]\n",
        pairs.join(", ")
    );
    text
}

/// Returns text for a line of a comment.
fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
