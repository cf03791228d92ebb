//! Warnings about a trial, for the reader of its page: its findings, and those of its comparison.

use super::text::clip;
use study::text::capitalised;
use study::trial::{Finding, Judged};
use study::twin::Comparison;

/// A warning on the page.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Warning {
    /// A few words for the table of a session.
    pub brief: String,
    /// A sentence for the trial.
    pub text: String,
    /// Whether the trial's numbers may be wrong.
    pub is_grave: bool,
}

impl Warning {
    pub fn new(brief: &str, text: impl Into<String>) -> Self {
        Self { brief: brief.to_owned(), text: text.into(), is_grave: true }
    }

    /// Returns a finding as a warning; `log` names the log where it is not that of the page.
    pub fn of(finding: &Finding, log: Option<&str>) -> Self {
        let log = log.map_or_else(String::new, |log| format!("{log}: "));
        let brief = finding.text.split([':', ';']).next().unwrap_or_default();
        let text = clip(&format!("{}{}", log, capitalised(&finding.to_string())), 500);
        Self { brief: clip(brief, 80), text, is_grave: finding.grave }
    }
}

/// Returns the warnings of a trial, and of its comparison.
pub(super) fn warnings(trial: &Judged, comparison: Option<&Comparison>) -> Vec<Warning> {
    let mut warnings: Vec<Warning> = trial.findings.iter().map(|finding| Warning::of(finding, None)).collect();
    let path = trial.data.path.to_string_lossy();
    if let Some(comparison) = comparison {
        let other = comparison.other;
        for of_log in comparison.findings.iter().filter(|of_log| of_log.log != path) {
            let warning = Warning::of(&of_log.finding, Some(&capitalised(&format!("{other} {}", of_log.log))));
            warnings.push(Warning { brief: format!("{other}: {}", warning.brief), ..warning });
        }
    }
    for text in comparison.iter().flat_map(|comparison| &comparison.warnings) {
        warnings.push(Warning::new(&clip(text, 80), clip(text, 500)));
    }
    warnings
}
