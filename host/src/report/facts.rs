//! How a trial was made: plan, board, model, versions, and the files that it was made from.

use super::text::{clip, degrees, number, plain, word};
use super::view::View;
use crate::log::Identity;
use maud::{Markup, html};

/// The longest file that is shown.
const LONGEST_FILE: usize = 20_000;

pub(super) fn facts(view: &View, shared: bool) -> Markup {
    html! {
        details.how {
            summary { "How it was made" }
            table.facts { @for (name, value) in how(view) { tr { th { (name) } td { (value) } } } }
        }
        @if !shared { (files(view)) }
    }
}

/// The files that the trial was made from: of a session they are the same for all trials.
pub(super) fn files(view: &View) -> Markup {
    let overview = &view.overview;
    let mut files = Vec::new();
    if let Some(model) = &overview.model {
        files.push(("Parameters of the model", &model.parameters));
    }
    if let Some(robot) = overview.robot.as_ref().filter(|robot| !robot.text.is_empty()) {
        files.push(("The robot’s file", &robot.text));
    }
    if let Some(board) = overview.board.as_ref().filter(|board| !board.settings.is_empty()) {
        files.push(("Settings of the board", &board.settings));
    }
    if let Some(plan) = &overview.plan {
        files.push(("The plan", &plan.text));
    }
    html! {
        @for (name, text) in files {
            @if !text.is_empty() { details { summary { (name) } pre { (clip(text, LONGEST_FILE)) } } }
        }
    }
}

fn how(view: &View) -> Vec<(&'static str, String)> {
    let overview = &view.overview;
    let mut facts = vec![("Log", view.log.display().to_string())];
    if let Some(comparison) = &view.comparison {
        facts.push(("Compared with", comparison.modelled.display().to_string()));
        facts.push(("Zero taken off, measured", angles(comparison.measured_zero_deg)));
        facts.push(("Zero taken off, model", angles(comparison.modelled_zero_deg)));
        facts.push(("Drift taken off the yaw", degrees(comparison.yaw_drift_deg, 3)));
        facts.push(("Clock moved by", format!("{} s", number(comparison.time_shift_s, 3))));
    }
    if let Some(trial) = &overview.trial {
        facts
            .push(("Trial", format!("number {}, repeat {}, attempt {}", trial.index + 1, trial.repeat, trial.attempt)));
        let [calibrate, preroll, run, decay] =
            [trial.calibrate_s, trial.preroll_s, trial.run_s, trial.decay_s].map(plain);
        facts.push(("Phases", format!("calibrate {calibrate} s, preroll {preroll} s, run {run} s, decay {decay} s")));
    }
    if let Some(identity) = &overview.identity {
        let Identity { host_version, host_git_hash, protocol, .. } = identity;
        facts.push(("Recorded by", format!("biflag {host_version} ({host_git_hash}), protocol {protocol}")));
    }
    match (&overview.model, &overview.board) {
        (Some(model), _) => {
            facts.push((
                "Model",
                format!("closure {}, {} samples a second", word(&model.closure), plain(model.rate_hz)),
            ));
        }
        (None, Some(board)) => {
            let (version, hash) = (&board.firmware, &board.firmware_git_hash);
            facts.push(("Firmware", format!("{version} ({hash}), protocol {}", board.protocol)));
            facts.push((
                "Board",
                format!(
                    "number {}, IMU {:#04x}, start {} by {}",
                    board.board_id, board.imu_id, board.boot_count, board.reset_cause
                ),
            ));
        }
        (None, None) => {}
    }
    if let Some(robot) = &overview.robot {
        facts.push(("Robot", robot.name.clone()));
    }
    if let (Some(calibration), false) = (&overview.calibration, view.is_model()) {
        let [x, y, z] = calibration.bias_counts.map(|counts| number(counts.into(), 1));
        facts.push(("Gyroscope’s bias", format!("{x}, {y}, {z} counts, from {} readings", calibration.samples)));
    }
    if let (Some(clock), false) = (&overview.clock, view.is_model()) {
        let (residual, pings) = (number(clock.residual_us, 0), clock.pings);
        facts.push(("Clock", format!("{} ppm, residual {residual} µs, {pings} pings", number(clock.drift_ppm, 1))));
    }
    if !view.is_model() {
        facts.push(("Link", overview.link.to_string()));
    }
    let counts: Vec<_> = overview.channels.iter().map(|(topic, count)| format!("{topic} {count}")).collect();
    facts.push(("Channels", counts.join(", ")));
    facts.into_iter().map(|(name, value)| (name, clip(&value, 600))).collect()
}

fn angles([yaw, pitch, roll]: [f64; 3]) -> String {
    format!("yaw {}, pitch {}, roll {}", degrees(yaw, 3), degrees(pitch, 3), degrees(roll, 3))
}
