//! Findings about a trial's log and its conduct.

use super::{REPEAT, Rule, Section};
use crate::trial::data::{Data, Event};
use crate::trial::finding::FindingKind::Conduct;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::{Condition, End, Origin};

/// Beginning of the warning about a damaged frame in a log. A bad serial line causes many of them.
pub const DAMAGED_FRAME: &str = "a frame was damaged";

const CABLE: &str = "check the cable";

pub(super) const SECTION: Section = Section { is_judged: |_| true, rules: RULES };

static RULES: &[Rule] = &[
    Rule::warning(Conduct, REPEAT, |data, _| {
        let is_cut_off = data.condition == Condition::CutOff;
        is_cut_off.then(|| "the log is cut off; the rest is used".to_owned())
    }),
    Rule::warning(Conduct, REPEAT, |data, _| {
        let lost = data.losses.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
        let is_damaged = data.condition == Condition::Damaged;
        is_damaged.then(|| format!("the log is damaged ({lost}); the rest is used"))
    }),
    Rule::warning(Conduct, REPEAT, |data, _| {
        let recovery = data.records.recovery.as_ref().filter(|recovery| !recovery.lost.is_empty())?;
        Some(format!("recovered from {}; lost: {}", recovery.source, recovery.lost))
    }),
    Rule::warning(Conduct, REPEAT, |data, _| ended(data)),
    // The board integrates the gyroscope, so a few lost frames do not affect the angles.
    Rule::loss(Conduct, CABLE, |data, _| {
        let (lost, all) = (data.link.lost, data.link.lost.saturating_add(data.link.samples));
        (lost > 0).then(|| format!("{lost} of {all} telemetry frames were lost"))
    }),
    Rule::note(Conduct, "", |data, _| data.gaps()),
    Rule::note(Conduct, "", |data, _| {
        let imu_id = data.records.board.as_ref().filter(|_| data.temperature_c.is_nan())?.imu_id;
        Some(format!("the temperature is unknown, because the sensor is an unknown part (WHO_AM_I {imu_id:#04x})"))
    }),
    Rule::warning(Conduct, "import a table with more rows", |data, _| {
        (data.origin() == Origin::Imported).then(|| long_gap(data))?
    }),
    Rule::warning(Conduct, REPEAT, |data, _| (data.origin() != Origin::Imported).then(|| long_gap(data))?),
    Rule::warning(Conduct, "use the version of biflag that recorded it", |data, _| newer(data)),
    Rule::each(Conduct, Some(REPEAT), |data| data.warnings.clone()),
    Rule::each(Conduct, Some("check the motor and its encoder"), |data| {
        if !data.times.has_run() || data.motors.is_empty() || data.is_model() {
            return Vec::new();
        }
        data.encoders().unwrap_or_else(|error| vec![error.reason])
    }),
    // Damaged frames of telemetry are also counted as lost.
    Rule::loss(Conduct, CABLE, |data, _| {
        let damaged = warnings(data).filter(|event| event.text.starts_with(DAMAGED_FRAME)).count();
        let were = if damaged == 1 { "frame was" } else { "frames were" };
        (damaged > 0).then(|| format!("{damaged} {were} damaged on the line"))
    }),
    // The recorder's warnings are in the log, with their remedies.
    Rule::each(Conduct, None, |data| {
        let others = warnings(data).filter(|event| !event.text.starts_with(DAMAGED_FRAME));
        others.map(|event| event.text.clone()).collect()
    }),
];

fn warnings(data: &Data) -> impl Iterator<Item = &Event> {
    data.events.iter().filter(|event| event.kind == Kind::Warning)
}

fn ended(data: &Data) -> Option<String> {
    match &data.records.summary {
        Some(summary) if summary.end == End::Complete => None,
        Some(summary) if summary.reason.is_empty() => Some("the trial did not end as planned".to_owned()),
        Some(summary) => Some(format!("the trial did not end as planned: {}", summary.reason)),
        None => Some("the log does not say how the trial ended".to_owned()),
    }
}

fn long_gap(data: &Data) -> Option<String> {
    let gap = data.longest_gap().filter(|_| data.has_long_gap())?;
    let ([what, verb], [start, end]) = (data.lacking(), [gap.start, gap.end].map(|time_s| data.by_table_s(time_s)));
    Some(format!("the yaw may lack a full turn: {what} {verb} missing from {start:.1} s to {end:.1} s"))
}

/// Logs of older protocols contain the same messages.
fn newer(data: &Data) -> Option<String> {
    let newer = data.records.identity.as_ref()?.protocol;
    let known = protocol::VERSION;
    (newer > known).then(|| format!("recorded with protocol {newer}, of which this program knows {known} at most"))
}
