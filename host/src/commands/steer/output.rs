//! The result of a run, and the output of `biflag steer`.

use super::super::answer::finding_line;
use crate::text::{count, decimal};
use crate::trial::{AngleTerm, Finding};
use miette::Report;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;
use study::steer::{Held, Tally, Wanted};

/// The result of a run, on a rig or in the model.
pub struct Ran {
    pub tally: Tally,
    pub notes: Vec<String>,
    pub error: Option<Report>,
    pub interrupted: bool,
}

/// A steered run.
#[derive(Serialize, Debug)]
pub struct Steered {
    #[serde(serialize_with = "crate::text::path")]
    pub log: PathBuf,
    pub origin: &'static str,
    #[serde(flatten)]
    pub wanted: Wanted,
    /// The means at its end; without keys if there is no attitude in the run.
    #[serde(flatten)]
    pub held: Option<Held>,
    /// Time since which the means have been near the target; `None` if they were not at the end.
    pub reached_s: Option<f64>,
    pub steps: u64,
    pub late_steps: u64,
    /// Time from an observation until its set-point is in force: median, and bound for 99 of 100 steps.
    pub latency_p50_s: Option<f64>,
    pub latency_p99_s: Option<f64>,
    /// The causes of the uncertainties of the steady angles.
    pub budget: Vec<AngleTerm>,
    pub findings: Vec<Finding>,
    pub notes: Vec<String>,
}

impl fmt::Display for Steered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Wanted { yaw_deg, pitch_deg } = self.wanted;
        write!(f, "{}: ", self.log.display())?;
        match &self.held {
            None => write!(f, "no attitude in the run")?,
            Some(held) => {
                let with = |value: f64, uncertainty: Option<f64>| {
                    let uncertainty = uncertainty.map_or_else(String::new, |u| format!(" ± {}°", decimal(u, 2)));
                    format!("{}°{uncertainty}", decimal(value, 2))
                };
                let yaw = with(held.mean_yaw_deg, held.mean_yaw_uncertainty_deg);
                let pitch = with(held.mean_pitch_deg, held.mean_pitch_uncertainty_deg);
                let over_s = decimal(held.mean_over_s, 1);
                write!(f, "mean yaw {yaw} of {yaw_deg}°, mean pitch {pitch} of {pitch_deg}° over the last {over_s} s")?;
            }
        }
        match self.reached_s {
            Some(reached_s) => write!(f, "; reached after {} s", decimal(reached_s, 1))?,
            None => write!(f, "; not reached")?,
        }
        write!(f, "\n{}, {} late", count(self.steps as usize, "set-point"), self.late_steps)?;
        if let (Some(p50), Some(p99)) = (self.latency_p50_s, self.latency_p99_s) {
            let [p50, p99] = [p50, p99].map(|latency_s| decimal(1e3 * latency_s, 0));
            write!(f, "; in force {p50} ms after the observation, {p99} ms at most in 99 of 100")?;
        }
        for finding in &self.findings {
            write!(f, "\n{}", finding_line(None, finding))?;
        }
        self.notes.iter().try_for_each(|note| write!(f, "\nnote: {note}"))
    }
}
