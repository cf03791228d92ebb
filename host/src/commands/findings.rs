//! The findings about a trial, as every command prints them.

use crate::trial::Finding;

/// Returns a finding as a line, with the log that it is about where a command names several.
pub fn finding_line(log: Option<&str>, finding: &Finding) -> String {
    let label = if finding.grave { "warning" } else { "note" };
    let log = log.map_or_else(String::new, |log| format!("{log}: "));
    format!("{label}: {log}{finding}")
}
