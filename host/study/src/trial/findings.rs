//! What a log says against its own trial: one list, made from the log alone, for every command to print.

use super::data::Data;
use super::finding::{Finding, FindingKind};
use super::zero::Zeroed;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::{Condition, End};

const REPEAT: &str = "repeat the trial";

/// Returns all findings about a trial.
pub fn findings(data: &Data, zeroed: &Zeroed) -> Vec<Finding> {
    let mut found = conduct(data);
    found.extend(zeroed.rest.iter().cloned());
    if let Some(steady) = zeroed.steady.as_ref().filter(|steady| !steady.settled) {
        let window_s = steady.window.end - steady.window.start;
        let text = format!("not settled: the angles are means over the last {window_s:.1} s, not steady values");
        found.push(Finding::slight(FindingKind::Window, text, "give the trial a longer run"));
    }
    found
}

fn conduct(data: &Data) -> Vec<Finding> {
    let grave = |text: String, cure: &str| Finding::grave(FindingKind::Conduct, text, cure);
    let mut found = Vec::new();
    match data.condition {
        Condition::Clean | Condition::Rewritten => {}
        Condition::CutOff => found.push(grave("the log is cut off; the rest is used".into(), REPEAT)),
        Condition::Damaged => found.push(grave("the log is damaged; the rest is used".into(), REPEAT)),
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
        found.push(grave(format!("{} of {all} telemetry frames were lost", data.link.lost), "check the cable"));
    }
    // What the recorder saw is in the log: a cure follows the colon.
    for event in data.events.iter().filter(|event| event.kind == Kind::Warning) {
        let (text, cure) = event.text.split_once(": ").unwrap_or((&event.text, ""));
        found.push(grave(text.to_owned(), cure));
    }
    found
}
