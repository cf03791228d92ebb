//! Findings about a trial from its log alone: one list that every command prints.

use super::axes;
use super::data::Data;
use super::finding::{Finding, FindingKind};
use super::import_findings;
use super::sensor_gap;
use super::usable::Unusable;
use super::zero::Zeroed;
use crate::attitude::Motion;
use crate::sensor::MeasuredSensor;
use crate::text::decimal;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::{Condition, End, Origin};
use protocol::Settings;
use protocol::units::CentiRpm;
use std::ops::Range;

const REPEAT: &str = "repeat the trial";

/// Beginning of the warning about a damaged frame in a log. A bad serial line causes many of them.
pub const DAMAGED_FRAME: &str = "a frame was damaged";

/// Speeds of a trial in which the sensor is turned by hand, and may have any mounting.
const HAND_TURN: [CentiRpm; 2] = [CentiRpm(0); 2];

/// Smallest share of the averaging time that must have telemetry.
const LEAST_SHARE: f64 = 0.9;

/// Time between readings above which telemetry counts as missing, s: ten frames of a board.
const GAP_S: f64 = 0.05;

/// Bound on the motion after a wait, relative to the limits of a still robot, up to which the fit of the return to rest
/// covers the remaining motion.
const RESIDUAL: f64 = 4.0;

/// Smallest gain of the board's filter with which the tilt has settled when the zero is taken, 1/s.
const LEAST_GAIN: f32 = 0.5;

/// Returns all findings about a trial.
pub fn findings(data: &Data, zeroed: &Zeroed) -> Vec<Finding> {
    let mut found = data.identity.clone();
    found.extend(conduct(data));
    found.extend(sensor(data));
    found.extend(import_findings::all(data, zeroed));
    found.extend(wait(data));
    found.extend(zeroed.rest.iter().cloned());
    found.extend(window(data, zeroed));
    found
}

/// Judges the recorder's wait for a still robot.
fn wait(data: &Data) -> Option<Finding> {
    let rest = data.records.rest.as_ref().filter(|rest| !rest.still)?;
    let waited_s = rest.waited_s;
    let cure = "let the robot come to rest, or give the plan a longer rest_at_most";
    let (Some(yaw_dps), Some(tilt_dps)) = (rest.yaw_dps, rest.tilt_dps) else {
        let text = format!("the wait of {waited_s:.1} s was too short to tell whether the robot was still");
        return Some(Finding::slight(FindingKind::Rest, text, cure));
    };
    let motion = Motion { yaw_dps, tilt_dps };
    let text = format!(
        "the robot was not still after a wait of {waited_s:.1} s: its yaw turned at up to {yaw_dps:.2} °/s, its tilt at up \
         to {tilt_dps:.2} °/s"
    );
    Some(match motion.relative() > RESIDUAL {
        true => Finding::grave(FindingKind::Rest, text, cure),
        false => Finding::slight(FindingKind::Rest, text, cure),
    })
}

/// Returns findings about the averaging window.
fn window(data: &Data, zeroed: &Zeroed) -> Vec<Finding> {
    if let Err(Unusable { reason, help }) = data.upright() {
        return vec![Finding::grave(FindingKind::Window, reason, help)];
    }
    let Some(steady) = &zeroed.steady else { return Vec::new() };
    let mut found = Vec::new();
    let window_s = steady.window.end - steady.window.start;
    if !steady.settled && data.speeds() != [CentiRpm(0); 2] {
        let of_model = data.records.steady.as_ref().filter(|_| data.is_model());
        let errors: Option<Vec<f64>> = of_model.and_then(|own| own.values.angle_errors_deg().into_iter().collect());
        let text = if let Some(errors) = errors {
            let largest = decimal(2.0 * errors.into_iter().fold(0.0, f64::max), 2);
            format!(
                "not settled: the angles are what a slow approach has reached by a fit to the last {window_s:.1} s, known to ± \
                 {largest}°, not steady values"
            )
        } else if window_s > 0.0 {
            format!("not settled: the angles are means over the last {window_s:.1} s, not steady values")
        } else {
            "not settled: the run ends as a motor reverses, and the angles are those of its end".to_owned()
        };
        found.push(Finding::slight(FindingKind::Window, text, "give the trial a longer run"));
    }
    if !data.is_model() && window_s > 0.0 {
        let times = &zeroed.angles_deg.time_s;
        let gap_s = match data.is_recorded() {
            true => GAP_S,
            false => zeroed.angles_deg.longest_step_s().unwrap_or_default(),
        };
        let inside = times.iter().filter(|time| steady.window.contains(time)).copied();
        let ends = std::iter::once(steady.window.start).chain(inside).chain([steady.window.end]);
        let missing_s: f64 = ends.clone().zip(ends.skip(1)).map(|(from, to)| to - from).filter(|s| *s > gap_s).sum();
        let share = 1.0 - missing_s / window_s;
        if share < LEAST_SHARE {
            let [what, _] = data.lacking();
            let text = format!("only {:.0} % of the last {window_s:.1} s have {what}", 100.0 * share);
            found.push(Finding::grave(FindingKind::Window, text, REPEAT));
        }
    }
    found
}

/// Returns findings about the sensor's mounting and filter.
fn sensor(data: &Data) -> Vec<Finding> {
    let mut found = Vec::new();
    if !data.is_recorded() || data.speeds() == HAND_TURN || !data.times.has_run() {
        return found;
    }
    if let Some(level) = data.records.level.as_ref().filter(|level| !level.used) {
        let text =
            format!("tilt at rest of {:.1} degrees, too large for an offset of the accelerometer", level.tilt_deg);
        let cure = "set accel_axes and gyro_axes to the mounting of the sensor, let the robot hang freely, and repeat the trial";
        found.push(Finding::grave(FindingKind::Rest, text, cure));
    }
    found.extend(other_sensor(data));
    if let Some([found_deg, allowed_deg]) = axes::contradiction(data) {
        let text = format!(
            "gyroscope and accelerometer contradict each other: in the first seconds of the run they differ by \
             {found_deg:.1} degrees of tilt, where {allowed_deg:.1} are possible"
        );
        let cure = "set gyro_axes and accel_axes to the same mounting of the sensor, and repeat the trial";
        found.push(Finding::grave(FindingKind::Conduct, text, cure));
    }
    if let Some(Range { start, end }) = sensor_gap::longest(data) {
        let length_s = end - start;
        let text = format!(
            "the sensor had no reading for {length_s:.2} s, from {start:.2} s on: the board bridged it, and the yaw may be off \
             from then on"
        );
        found.push(Finding::grave(
            FindingKind::Conduct,
            text,
            "check the sensor's wiring and supply, and repeat the trial",
        ));
    }
    found.extend(data.settings().iter().flat_map(of_settings));
    found
}

/// Returns a finding if the sensor's file gives a wrong gravity: its errors are removed from the angles.
fn other_sensor(data: &Data) -> Option<Finding> {
    let file = data.records.measured_sensor.as_ref()?;
    let level = data.records.level.as_ref()?;
    let reading_g = level.up.map(|part| part * level.force_g);
    let gravity = MeasuredSensor::of(file)?.gravity(reading_g)?;
    ((gravity.value - 1.0).abs() > 2.0 * gravity.u).then(|| {
        let text = format!(
            "by the sensor's file {}, the accelerometer read {:.3} of gravity at rest, where {:.3} is possible: the file is of \
             another sensor, or the sensor has changed",
            file.name,
            gravity.value,
            1.0 + (2.0 * gravity.u).copysign(gravity.value - 1.0)
        );
        let cure = "measure this sensor with `biflag sensor`, name its file in the plan, and repeat the trial";
        Finding::grave(FindingKind::Identity, text, cure)
    })
}

/// Returns findings about settings of the board that make the angles wrong for any readings.
fn of_settings(settings: &Settings) -> Vec<Finding> {
    let Settings { gyro_axes, accel_axes, attitude_kp, attitude_ki, .. } = *settings;
    let mut found = Vec::new();
    let mut grave = |text: String, cure: &str| found.push(Finding::grave(FindingKind::Conduct, text, cure));
    if gyro_axes != accel_axes {
        let [gyro, accel] = [gyro_axes, accel_axes].map(|axes| axes.0.map(|axis| axis.to_string()).join(", "));
        let text = format!(
            "gyro_axes ({gyro}) and accel_axes ({accel}) differ, and in an MPU6050 gyroscope and accelerometer have the same axes"
        );
        grave(text, "set gyro_axes and accel_axes to the same mounting of the sensor, and repeat the trial");
    }
    if attitude_kp < LEAST_GAIN {
        let lags = match attitude_kp {
            0.0 => "does not follow gravity (attitude_kp 0): the tilt drifts".to_owned(),
            gain => format!("follows gravity in {:.1} s (attitude_kp {gain}): the tilt lags", 1.0 / gain),
        };
        grave(format!("the board's filter {lags}"), "set attitude_kp to 1, and repeat the trial");
    }
    // Even 0.003 makes the yaw wrong by 2 degrees in a run of 70 s.
    if attitude_ki != 0.0 {
        let text = format!(
            "the board's filter takes a part of the robot's motion for a bias of the gyroscope (attitude_ki {attitude_ki}): the \
             yaw drifts in the run"
        );
        grave(text, "set attitude_ki to 0, and repeat the trial");
    }
    found
}

fn conduct(data: &Data) -> Vec<Finding> {
    let grave = |text: String, cure: &str| Finding::grave(FindingKind::Conduct, text, cure);
    let slight = |text: String, cure: &str| Finding::slight(FindingKind::Conduct, text, cure);
    let mut found = Vec::new();
    match data.condition {
        Condition::Clean | Condition::Rewritten => {}
        Condition::CutOff => found.push(grave("the log is cut off; the rest is used".into(), REPEAT)),
        Condition::Damaged => {
            let lost: Vec<_> = data.losses.iter().map(ToString::to_string).collect();
            found.push(grave(format!("the log is damaged ({}); the rest is used", lost.join("; ")), REPEAT));
        }
    }
    let records = &data.records;
    if let Some(recovery) = records.recovery.as_ref().filter(|recovery| !recovery.lost.is_empty()) {
        found.push(grave(format!("recovered from {}; lost: {}", recovery.source, recovery.lost), REPEAT));
    }
    match &records.summary {
        Some(summary) if summary.end != End::Complete && !summary.reason.is_empty() => {
            found.push(grave(format!("the trial did not end as planned: {}", summary.reason), REPEAT));
        }
        Some(summary) if summary.end != End::Complete => {
            found.push(grave("the trial did not end as planned".into(), REPEAT));
        }
        Some(_) => {}
        None => found.push(grave("the log does not say how the trial ended".into(), REPEAT)),
    }
    if data.link.lost > 0 {
        let all = data.link.lost.saturating_add(data.link.samples);
        let text = format!("{} of {all} telemetry frames were lost", data.link.lost);
        // The board integrates the gyroscope, so a few lost frames do not affect the angles.
        found.push(Finding::loss(FindingKind::Conduct, text, "check the cable"));
    }
    if let Some(gaps) = data.gaps() {
        found.push(slight(gaps, ""));
    }
    if let Some(Range { start, end }) = data.longest_gap().filter(|_| data.has_long_gap()) {
        let [what, verb] = data.lacking();
        let cure = if data.origin() == Origin::Imported { "import a table with more rows" } else { REPEAT };
        let text = format!("the yaw may lack a full turn: {what} {verb} missing from {start:.1} s to {end:.1} s");
        found.push(grave(text, cure));
    }
    let protocols = records.identity.as_ref().map(|identity| identity.protocol);
    // Logs of older protocols contain the same messages.
    if let Some(newer) = protocols.filter(|found| *found > protocol::VERSION) {
        let text = format!("recorded with protocol {newer}, of which this program knows {} at most", protocol::VERSION);
        found.push(grave(text, "use the version of biflag that recorded it"));
    }
    found.extend(data.warnings.iter().map(|text| grave(text.clone(), REPEAT)));
    if data.times.has_run() && !data.motors.is_empty() && !data.is_model() {
        let turns = data.encoders().unwrap_or_else(|error| vec![error.reason]);
        found.extend(turns.into_iter().map(|text| grave(text, "check the motor and its encoder")));
    }
    let warnings = data.events.iter().filter(|event| event.kind == Kind::Warning);
    let (damaged, others): (Vec<_>, Vec<_>) = warnings.partition(|event| event.text.starts_with(DAMAGED_FRAME));
    if !damaged.is_empty() {
        // A damaged frame of telemetry is a lost one.
        let were = if damaged.len() == 1 { "frame was" } else { "frames were" };
        let text = format!("{} {were} damaged on the line", damaged.len());
        found.push(Finding::loss(FindingKind::Conduct, text, "check the cable"));
    }
    // The recorder's warnings are in the log; the remedy follows the colon.
    for event in others {
        let (text, cure) = event.text.split_once(": ").unwrap_or((&event.text, ""));
        found.push(grave(text.to_owned(), cure));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::units::{Axis, AxisMap};

    #[test]
    fn settings_that_make_the_angles_wrong_are_grave() {
        assert_eq!(of_settings(&Settings::DEFAULT), []);
        let gyro_axes = AxisMap([Axis::PlusX, Axis::PlusY, Axis::MinusZ]);
        let turned = AxisMap([Axis::PlusY, Axis::MinusX, Axis::PlusZ]);
        assert_eq!(of_settings(&Settings { gyro_axes: turned, accel_axes: turned, ..Settings::DEFAULT }), []);
        for (settings, said) in [
            (Settings { gyro_axes, ..Settings::DEFAULT }, "gyro_axes (+x, +y, -z) and accel_axes (+x, +y, +z) differ"),
            (Settings { attitude_kp: 0.49, ..Settings::DEFAULT }, "follows gravity in 2.0 s (attitude_kp 0.49)"),
            (Settings { attitude_kp: 0.0, ..Settings::DEFAULT }, "does not follow gravity"),
            (Settings { attitude_ki: 0.003, ..Settings::DEFAULT }, "bias of the gyroscope (attitude_ki 0.003)"),
        ] {
            let [finding] = of_settings(&settings).try_into().unwrap();
            assert!(finding.grave && finding.text.contains(said), "{finding}");
        }
    }
}
