//! The findings about a trial, as every command prints them.

use crate::trial::Finding;
use serde_json::{Value, json};

/// Returns a finding as JSON, with the log that it is about where a command names several.
pub fn finding_json(log: Option<&str>, finding: &Finding) -> Value {
    let mut value = json!({
        "kind": finding.kind,
        "text": finding.text,
        "cure": finding.cure,
        "grave": finding.grave,
    });
    if let Some(log) = log {
        value["log"] = log.into();
    }
    value
}

/// Returns a finding as a line.
pub fn finding_line(log: Option<&str>, finding: &Finding) -> String {
    let label = if finding.grave { "warning" } else { "note" };
    let log = log.map_or_else(String::new, |log| format!("{log}: "));
    let cure = if finding.cure.is_empty() { String::new() } else { format!("; {}", finding.cure) };
    format!("{label}: {log}{}{cure}", finding.text)
}
