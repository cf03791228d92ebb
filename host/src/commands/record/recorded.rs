//! The content of a session at the end of the command: its object in the JSON, and the last lines.

use super::row::{self, RecordedTrial};
use crate::commands::answer::{Outcome, finding_line};
use crate::plan::Trial;
use crate::progress::Progress;
use crate::run::rig::RigRun;
use crate::session::TrialState;
use crate::text;
use crate::trial::{LogFinding, Want};
use serde::Serialize;
use std::path::PathBuf;
use system::shell;

#[derive(Debug, Default, Serialize)]
pub(super) struct Recorded {
    #[serde(serialize_with = "crate::text::path")]
    pub session: PathBuf,
    pub trials: Vec<RecordedTrial>,
    /// Findings about logs in the folder that do not belong to the session.
    left_out: Vec<LogFinding>,
}

impl Recorded {
    /// Returns the complete trials of a session with these states, and the trials that are left.
    pub fn of(session: PathBuf, states: Vec<TrialState>) -> miette::Result<(Self, Vec<Trial>)> {
        let (mut recorded, mut todo) = (Self { session, ..Self::default() }, Vec::new());
        for state in states {
            recorded.left_out.extend(state.left_out.iter().cloned());
            let Some(attempt) = state.complete() else {
                todo.push(state.trial);
                continue;
            };
            let trial = attempt.read(Want::default())?;
            let run = RigRun {
                summary: attempt.summary.clone().unwrap_or_default(),
                angles: trial.steady_angles(),
                run_s: trial.data.times.run_s(),
                error: None,
                findings: trial.findings,
                notes: Vec::new(),
            };
            let row = RecordedTrial::of_run(&state.trial, attempt.path.clone(), &run, trial.data.origin());
            recorded.trials.push(row);
        }
        Ok((recorded, todo))
    }

    /// Prints the findings about logs that do not belong to the session.
    pub fn say_left_out(&self, progress: &Progress) {
        self.left_out.iter().for_each(|left_out| progress.line(&finding_line(None, &left_out.finding)));
    }

    /// Returns the outcome of the command from the trials recorded so far.
    pub fn outcome(&self) -> Outcome {
        Outcome::of(self.left_out.is_empty() && self.trials.iter().all(|trial| trial.warnings.is_empty()))
    }

    /// Returns the end of a command that had `todo` trials to record.
    pub fn end(&self, outcome: Outcome, todo: usize) -> String {
        let session = shell::quoted(&self.session.to_string_lossy());
        let table = if self.trials.len() > 1 { row::table(&self.trials) } else { String::new() };
        let then = match outcome {
            Outcome::Interrupted => "interrupted, the motors are stopped".to_owned(),
            _ if todo == 0 => format!("nothing left to do: {} complete", text::count(self.trials.len(), "trial")),
            // A robot at rest, or one turned by hand, cannot be compared with a model.
            _ if self.trials.iter().all(|trial| trial.w1_rpm == 0.0 && trial.w2_rpm == 0.0) => {
                format!("next: biflag info {session}")
            }
            _ => format!("next: biflag compare {session}"),
        };
        format!("{table}session {}\n{then}", self.session.display())
    }
}
