//! A recorded trial: its line on the screen and its object in the JSON.

use crate::plan::Trial;
use crate::run::rig::RigRun;
use crate::text::{count, decimal};
use crate::trial::{AngleTerm, Angles, Finding};
use biflag_log::{End, LinkStats, Origin};
use serde::ser::Error as _;
use serde::{Serialize, Serializer};
use std::fmt;
use std::path::PathBuf;

#[derive(Debug, Serialize)]
pub(super) struct RecordedTrial {
    pub name: String,
    pub w1_rpm: f64,
    pub w2_rpm: f64,
    #[serde(serialize_with = "crate::text::path")]
    pub log: PathBuf,
    pub origin: &'static str,
    #[serde(flatten)]
    pub link: LinkStats,
    /// Start of the run on the log's clock, which depends on how long the robot took to come to rest; `None` if the motors
    /// never ran.
    pub run_start_s: Option<f64>,
    /// End of the run.
    pub run_end_s: Option<f64>,
    /// Its steady angles; `None` if there is no attitude in the run.
    #[serde(flatten, serialize_with = "angles_or_nulls")]
    pub angles: Option<Angles>,
    /// The causes of their uncertainties.
    pub budget: Vec<AngleTerm>,
    /// The turn by hand in the plan, compared with the measured one; only for trials of this run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hand_turn: Option<String>,
    /// Findings about the trial.
    pub findings: Vec<Finding>,
    /// The grave ones as text.
    pub warnings: Vec<String>,
    /// The others as text, and notes about things that did not affect the data.
    pub notes: Vec<String>,
    pub complete: bool,
}

impl RecordedTrial {
    /// Returns the row of a trial that ran.
    pub fn of_run(trial: &Trial, log: PathBuf, run: &RigRun, origin: Origin) -> Self {
        let [w1_rpm, w2_rpm] = trial.speeds.map(|speed| speed.rpm());
        let texts = |grave: bool| run.findings.iter().filter(move |one| one.grave == grave).map(ToString::to_string);
        Self {
            name: trial.name.clone(),
            w1_rpm,
            w2_rpm,
            log,
            origin: origin.name(),
            link: run.summary.link,
            run_start_s: run.run_s.map(|[start, _]| start),
            run_end_s: run.run_s.map(|[_, end]| end),
            angles: run.angles.clone(),
            budget: run.angles.as_ref().map(|angles| angles.budget.clone()).unwrap_or_default(),
            hand_turn: None,
            findings: run.findings.clone(),
            warnings: texts(true).collect(),
            notes: run.notes.iter().cloned().chain(texts(false)).collect(),
            complete: run.summary.end == End::Complete,
        }
    }
}

impl fmt::Display for RecordedTrial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.link)?;
        let is_still = self.w1_rpm == 0.0 && self.w2_rpm == 0.0;
        match (&self.hand_turn, &self.angles) {
            (Some(verdict), _) => write!(f, "; {verdict}")?,
            (None, Some(angles)) if is_still => {
                let [x, y, z] = angles.turned_deg.map(|deg| decimal(deg, 1));
                write!(f, "; turned {x}°, {y}°, {z}° about x, y, z")?;
            }
            (None, Some(angles)) => write!(f, "; {angles}")?,
            (None, None) => {}
        }
        if !self.complete {
            write!(f, "; not complete")?;
        }
        self.warnings.iter().try_for_each(|warning| write!(f, "\n  warning: {warning}"))?;
        self.notes.iter().try_for_each(|note| write!(f, "\n  note: {note}"))
    }
}

/// Returns whether a trial is complete and without warnings, in a word or two.
pub(super) fn remarks(trial: &RecordedTrial) -> String {
    match (trial.complete, trial.warnings.len()) {
        (false, _) => "not complete".to_owned(),
        (true, 0) => String::new(),
        (true, number) => count(number, "warning"),
    }
}

/// Returns the trials as a table, a line each.
pub(super) fn table(trials: &[RecordedTrial]) -> String {
    let rows = trials.iter().map(|trial| {
        let none = || std::array::from_fn(|_| "-".to_owned());
        let [yaw, pitch, roll] = trial.angles.as_ref().map_or_else(none, Angles::cells);
        [trial.name.clone(), yaw, pitch, roll, trial.link.lost.to_string(), remarks(trial)]
    });
    let head = ["trial", "yaw, deg", "pitch, deg", "roll, deg", "lost", ""].map(str::to_owned);
    let rows: Vec<_> = std::iter::once(head).chain(rows).collect();
    let widths: [usize; 6] = std::array::from_fn(|i| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0));
    let line = |row: &[String; 6]| {
        let [name, angles @ .., remarks] = row;
        let angles = angles.iter().zip(&widths[1..]).map(|(cell, width)| format!("  {cell:>width$}"));
        let line = format!("{name:0$}{1}  {remarks}", widths[0], angles.collect::<String>());
        format!("{}\n", line.trim_end())
    };
    rows.iter().map(line).collect()
}

/// Serialises the angles into the row of their trial; `null` for each if there are none.
fn angles_or_nulls<S: Serializer>(angles: &Option<Angles>, serializer: S) -> Result<S::Ok, S::Error> {
    let Some(angles) = angles else {
        let keys = serde_json::to_value(Angles::default()).map_err(S::Error::custom)?;
        return serializer.collect_map(keys.as_object().into_iter().flat_map(|keys| keys.keys().map(|key| (key, ()))));
    };
    angles.serialize(serializer)
}
