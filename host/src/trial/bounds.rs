//! Start and end of a trial's phases.

use biflag_log::{End, Summary};
use std::ops::Range;

/// Phases of a trial, seconds of its clock. A phase that the trial did not reach is empty.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Times {
    /// At rest before the run.
    pub preroll: Range<f64>,
    /// The motors turn.
    pub run: Range<f64>,
    /// After the run.
    pub decay: Range<f64>,
}

impl Times {
    /// Returns whether the trial reached its run.
    pub fn has_run(&self) -> bool {
        self.run.end > self.run.start
    }
}

/// Entries of a log that mark its phases.
pub(super) struct Marks<'a> {
    /// Name and start of each phase.
    pub phases: &'a [(String, f64)],
    /// When the motors got their target speeds.
    pub ordered_s: Option<f64>,
    pub fault: Option<&'a (f64, String)>,
    pub is_model: bool,
    pub summary: Option<&'a Summary>,
    /// Time of the last frame.
    pub end_s: f64,
}

/// Returns the phases. On a rig, the run begins when the motors get their target speeds, shortly after the start of the
/// phase, and ends with the first fault. Reasons for a shortened run are added to `warnings`.
pub(super) fn times(marks: &Marks, warnings: &mut Vec<String>) -> Times {
    let end_s = marks.end_s;
    let at = |name: &str| marks.phases.iter().position(|(phase, _)| phase == name);
    let start = |i: usize| marks.phases[i].1;
    let next = |i: usize| marks.phases.get(i + 1).map(|(_, next)| *next);
    let ordered = marks.ordered_s.filter(|_| !marks.is_model);
    let Some(run_start) = ordered.or(at("run").map(start)) else { return Times::default() };
    let after = at("run").and_then(next);
    let planned_end = after.unwrap_or(end_s).min(end_s);
    let mut run_end = planned_end;
    if let Some((time, fault)) = marks.fault
        && *time < run_end
    {
        warnings.push(format!("the board stopped at {time:.1} s ({fault}); the run is used up to there"));
        run_end = *time;
    } else if after.is_none() {
        let reason = match marks.summary {
            None => "the log ends without a summary",
            Some(summary) if summary.end == End::Aborted => "it was interrupted",
            Some(summary) if summary.reason.is_empty() => "the log ends during the run",
            Some(summary) => &summary.reason,
        };
        warnings.push(format!("the trial is not complete: {reason}; its run is used up to {run_end:.1} s"));
    }
    let preroll = at("preroll").map_or(run_start..run_start, |i| start(i)..run_start);
    let decay = at("decay").map_or(planned_end..planned_end, |i| start(i)..next(i).unwrap_or(end_s).min(end_s));
    Times { preroll, run: run_start..run_end.max(run_start), decay }
}
