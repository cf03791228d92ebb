//! The provenance of a trial: plan, board, model, versions, and the files behind it.

use super::parameters;
use super::scroll::scrolled;
use super::text::{clip, count, degrees, number, plain};
use super::view::{ModelRobot, View};
use biflag_log::{BoardMeta, Identity, ImportMeta, ReplayMeta};
use maud::{Markup, html};
use sim::trial::quantity::{self, Place};
use study::text::{rest as rest_text, word};
use study::trial::AngleTerm;

/// The longest file that is shown, in characters.
const LONGEST_FILE: usize = 20_000;

pub(super) fn facts(view: &View, shared: bool) -> Markup {
    html! {
        @if let Some(angles) = view.angles.as_ref().filter(|angles| !angles.budget.is_empty()) { (budget(&angles.budget)) }
        details {
            summary { "Provenance" }
            table.facts { @for (name, value) in provenance(view) { tr { th { (name) } td { (value) } } } }
        }
        @if !shared { (files(view)) }
    }
}

/// The causes of uncertainty of the steady angles.
fn budget(terms: &[AngleTerm]) -> Markup {
    let percent = |share: f64| format!("{} %", number(100.0 * share, 0));
    let (shown, further): (Vec<_>, Vec<_>) = terms.iter().partition(|of_angle| of_angle.term.share >= 0.005);
    let rows = html! {
        @for AngleTerm { angle, term } in shown {
            tr {
                td { (angle) }
                td { (term.name) }
                td { (word(&term.evaluation)) }
                td { (degrees(term.u_deg, 3)) }
                td { (percent(term.share)) }
                td { (word(&term.common_to)) }
            }
        }
        @if !further.is_empty() {
            tr { td {} td colspan="5" { (count(further.len(), "further cause", "further causes")) ", each below 0.5 %" } }
        }
    };
    let heads = ["angle", "cause", "type", "standard uncertainty", "share", "common to"];
    html! { details { summary { "Uncertainty budget" } (scrolled("Uncertainty budget", &heads, &rows)) } }
}

/// The files behind a trial. All trials of a session share them.
pub(super) fn files(view: &View) -> Markup {
    let records = &view.records;
    let mut files = Vec::new();
    let mut tables = Vec::new();
    if let Some(ModelRobot { robot, model, .. }) = &view.model_robot {
        let title = format!("Model: parameters of the robot {}, closure {}", robot.name, word(&model.closure));
        tables.push((title, &model.parameters, robot.name.as_str(), robot.text.as_str()));
        files.push((format!("Model: robot file {}", robot.name), &robot.text));
    }
    if let Some(model) = &records.model {
        let whose = if view.is_model() { "this log’s model" } else { "the emulated robot" };
        let (name, file) = records.robot.as_ref().map_or(("", ""), |robot| (&robot.name, &robot.text));
        tables.push((format!("Parameters of {whose}: robot {name}"), &model.parameters, name, file));
    }
    files.extend(records.robot.as_ref().map(|robot| (format!("Robot file {} of the plan", robot.name), &robot.text)));
    files.extend(records.board.as_ref().map(|board| ("Board settings".to_owned(), &board.settings)));
    files.extend(records.plan.as_ref().map(|plan| ("Plan".to_owned(), &plan.text)));
    html! {
        @for (title, text, name, file) in tables {
            @if !text.is_empty() {
                details {
                    summary { (clip(&title, 200)) }
                    (parameters::table(text, name, file))
                    pre { (clip(text, LONGEST_FILE)) }
                }
            }
        }
        @for (name, text) in files {
            @if !text.is_empty() { details { summary { (clip(&name, 200)) } pre { (clip(text, LONGEST_FILE)) } } }
        }
    }
}

fn provenance(view: &View) -> Vec<(&'static str, String)> {
    let records = &view.records;
    let mut facts = vec![("Log", view.log.display().to_string())];
    facts.extend(compared(view));
    if let Some(trial) = &records.trial {
        let (number, repeat, attempt) = (trial.index + 1, trial.repeat, trial.attempt);
        facts.push(("Trial", format!("number {number}, repeat {repeat}, attempt {attempt}")));
        let [calibrate, preroll, run, decay] =
            [trial.calibrate_s, trial.preroll_s, trial.run_s, trial.decay_s].map(plain);
        facts.push(("Phases", format!("calibrate {calibrate} s, preroll {preroll} s, run {run} s, decay {decay} s")));
        facts.extend(records.rest.as_ref().map(|rest| ("Rest before", rest_text(rest))));
        let angles = trial.phase_deg.map(|phase| phase.map(plain));
        facts.extend(angles.map(|[one, two]| ("Motors start at", format!("{one}° and {two}°"))));
    }
    if let Some(identity) = &records.identity {
        let Identity { host_version, host_git_hash, protocol, .. } = identity;
        facts.push(("Recorded by", format!("biflag {host_version} ({host_git_hash}), protocol {protocol}")));
    }
    match (&records.model, &records.board) {
        (Some(model), _) => {
            let rate = plain(model.rate_hz);
            facts.push(("Model", format!("closure {}, {rate} samples per second", word(&model.closure))));
        }
        (None, Some(board)) => {
            let BoardMeta { firmware, firmware_git_hash, protocol, board_id, imu_id, boot_count, reset_cause, .. } =
                board;
            facts.push(("Firmware", format!("{firmware} ({firmware_git_hash}), protocol {protocol}")));
            let start = format!("start {boot_count}, last reset by {reset_cause}");
            facts.push(("Board", format!("number {board_id}, IMU {imu_id:#04x}, {start}")));
        }
        (None, None) => {}
    }
    if let Some(steady) = &records.steady {
        for quantity in quantity::steady().filter(|quantity| quantity.is_in(Place::Trials)) {
            let parts = steady.values.parts(&quantity).iter().filter(|part| part.is_finite());
            let parts: Vec<_> = parts.map(|part| format!("{part:.3e} {}", quantity.unit)).collect();
            if !parts.is_empty() {
                facts.push(("Model’s steady state", format!("{}: {}", quantity.label(None), parts.join(", "))));
            }
        }
    }
    let angles = view.angles.as_ref().filter(|_| !view.is_model());
    facts.extend(angles.map(|angles| ("Speeds by the swing", angles.measured.to_string())));
    facts.extend(records.robot.as_ref().map(|robot| ("Robot of the recording", robot.name.clone())));
    if let (Some(calibration), false) = (&records.calibration, view.is_model()) {
        let [x, y, z] = calibration.bias_counts.map(|counts| number(counts.into(), 1));
        facts.push(("Gyroscope bias", format!("{x}, {y}, {z} counts, from {} readings", calibration.samples)));
    }
    let clock = records.clock.as_ref().filter(|_| !view.is_model());
    facts.extend(clock.map(|clock| ("Clock of the board", study::text::clock(clock))));
    facts.extend(view.is_recorded().then(|| ("Link", view.link.to_string())));
    if let Some(import) = &records.import {
        let ImportMeta { source, source_sha256, columns, .. } = import;
        facts.push(("Imported from", format!("{source}, SHA-256 {source_sha256}")));
        facts.push(("Columns", columns.clone()));
        if let (Some(offset_s), Some(rate_ppm)) = (import.clock_offset_s, import.clock_rate_ppm) {
            let (trial, offset, rate) = (&import.trial, number(offset_s, 3), number(rate_ppm, 0));
            let clock = format!("of {trial}: {offset} s at the table’s zero, {rate} ppm faster");
            facts.push(("Clock and motors", clock));
        }
    }
    let counts: Vec<_> = view.channels.iter().map(|(topic, count)| format!("{topic} {count}")).collect();
    facts.push(("Messages", counts.join(", ")));
    facts.into_iter().map(|(name, value)| (name, clip(&value, 600))).collect()
}

/// Returns the other log of the comparison, and the alignment of both.
fn compared(view: &View) -> Vec<(&'static str, String)> {
    let Some(comparison) = &view.comparison else { return Vec::new() };
    let mut facts = vec![("Compared with", comparison.modelled.display().to_string())];
    if let Some(ModelRobot { robot, model, replay }) = &view.model_robot {
        facts.push(("Robot of the model", format!("{}, closure {}", robot.name, word(&model.closure))));
        let source = |replay: &ReplayMeta| ("Model driven by", format!("the measured speeds in {}", replay.source));
        facts.extend(replay.as_ref().map(source));
    }
    facts.push(("Offset removed, this log", angles(comparison.measured_zero_deg)));
    facts.push(("Offset removed, the other log", angles(comparison.modelled_zero_deg)));
    facts.push(("Yaw drift removed", degrees(comparison.yaw_drift_deg, 3)));
    facts.push(("Time shift", format!("{} s", number(comparison.time_shift_s, 3))));
    facts
}

fn angles([yaw, pitch, roll]: [f64; 3]) -> String {
    format!("yaw {}, pitch {}, roll {}", degrees(yaw, 3), degrees(pitch, 3), degrees(roll, 3))
}
