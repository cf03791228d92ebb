//! Warnings about a trial, for the reader of its page.

use super::text::{clip, count};
use biflag_log::schema::biflag::event::Kind;
use biflag_log::{Condition, End};
use study::text::capitalised;
use study::trial::{Angles, Data, Zeroed};
use study::twin::Comparison;

/// A warning on the page.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Warning {
    /// A few words for the table of a session.
    pub brief: String,
    /// A sentence for the trial.
    pub text: String,
}

impl Warning {
    pub fn new(brief: &str, text: impl Into<String>) -> Self {
        Self { brief: brief.to_owned(), text: text.into() }
    }
}

/// Returns the warnings of a trial, and of its comparison.
pub(super) fn warnings(
    data: &Data,
    zeroed: &Zeroed,
    angles: Option<&Angles>,
    comparison: Option<&Comparison>,
) -> Vec<Warning> {
    let records = &data.records;
    let mut warnings = Vec::new();
    let mut warn = |brief: &str, text: String| warnings.push(Warning::new(brief, text));
    match data.condition {
        Condition::Clean | Condition::Rewritten => {}
        Condition::CutOff => {
            warn("cut off", "The log is cut off. The page shows the part that can be read.".to_owned())
        }
        Condition::Damaged => {
            warn("damaged", "The log is damaged. The page shows the parts that can be read.".to_owned())
        }
    }
    if let Some(summary) = &records.summary {
        let why = if summary.reason.is_empty() { String::new() } else { format!(": {}", clip(&summary.reason, 300)) };
        match summary.end {
            End::Complete => {}
            End::Aborted => warn("aborted", format!("The trial was aborted{why}.")),
            End::Faulted => warn("faulted", format!("The board stopped the motors because of a fault{why}.")),
            End::Failed => warn("failed", format!("The trial failed{why}.")),
        }
    } else {
        warn("end unknown", "The log does not say how the trial ended.".to_owned());
    }
    if let Some(recovery) = &records.recovery {
        let (source, lost) = (clip(&recovery.source, 200), clip(&recovery.lost, 300));
        warn("recovered", format!("Recovered from {source}; lost: {lost}."));
    }
    let link = data.link;
    if link.lost > 0 {
        let all = count(link.lost.saturating_add(link.samples), "telemetry frame", "telemetry frames");
        warn(&format!("{} lost", link.lost), format!("Lost: {} of {all}.", link.lost));
    }
    if records.steady.as_ref().is_some_and(|steady| !steady.settled) {
        warn("not settled", "Not settled: these are averages, not steady values.".to_owned());
    }
    if records.calibration.as_ref().is_some_and(|calibration| !calibration.still) {
        let text = "The sensor moved during the calibration of the gyroscope. The measured bias is not used.";
        warn("not calibrated", text.to_owned());
    }
    if !data.is_model() && angles.is_some_and(|angles| angles.yaw_uncertainty_deg.is_none()) {
        let text = "The uncertainty of the yaw is unknown: the trial has no still phase that is long enough to estimate it from.";
        warn("yaw uncertainty unknown", text.to_owned());
    }
    // What the recorder saw.
    for event in data.events.iter().filter(|event| event.kind == Kind::Warning) {
        warn(&clip(&event.text, 80), clip(&event.text, 500));
    }
    // Those of a comparison are among its warnings.
    for finding in zeroed.rest.iter().filter(|finding| finding.grave && comparison.is_none()) {
        warn("not at rest", format!("{}; {}.", capitalised(&finding.text), finding.cure));
    }
    for text in comparison.iter().flat_map(|comparison| &comparison.warnings) {
        warn(&clip(text, 80), clip(text, 500));
    }
    warnings
}
