//! The findings about trials, as every command prints them.

use crate::trial::{Finding, LogFinding};

/// Returns a finding as a line, with the log that it is about where a command names several.
pub fn finding_line(log: Option<&str>, finding: &Finding) -> String {
    let label = if finding.grave { "warning" } else { "note" };
    let log = log.map_or_else(String::new, |log| format!("{log}: "));
    format!("{label}: {log}{finding}")
}

/// Returns findings about several logs as lines that begin with a line end.
pub fn lines_of_logs(findings: &[LogFinding]) -> String {
    findings.iter().map(|of_log| format!("\n{}", finding_line(Some(&of_log.log), &of_log.finding))).collect()
}

/// Returns whether none of the findings is grave.
pub fn are_slight(findings: &[LogFinding]) -> bool {
    !findings.iter().any(|of_log| of_log.finding.grave)
}
