//! Preview of a plan on the rig, before anything runs: its trials, its duration, and findings about them.

use crate::plan::{Plan, note_on_grid};
use crate::run::model::note_on_unknown_angles;
use crate::text;
use crate::trial::{Finding, FindingKind};
use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};
use protocol::units::CentiRpm;
use serde::Serialize;
use std::fmt;
use std::time::SystemTime;

/// Preview of a plan.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Preview {
    /// Name of the plan.
    pub name: String,
    /// The trials, in the order in which they run.
    pub trials: Vec<PlannedTrial>,
    /// Duration of all phases, s.
    pub duration_s: f64,
    /// The same with the longest wait for a still robot before each trial.
    pub at_most_s: f64,
    /// Findings about the plan.
    pub findings: Vec<Finding>,
}

/// A trial of a plan.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct PlannedTrial {
    /// Its name.
    pub name: String,
    /// Speed of flagellum 1, rpm.
    pub w1_rpm: f64,
    /// Speed of flagellum 2, rpm.
    pub w2_rpm: f64,
    /// Duration of its phases, s.
    pub duration_s: f64,
}

impl Preview {
    /// Returns the preview of a plan. `knows_angles`: whether the board certainly knows the starting angles of the flagella.
    pub fn of(plan: &Plan, knows_angles: bool) -> Self {
        let trials = plan.trials.iter().map(|trial| {
            let [w1_rpm, w2_rpm] = trial.speeds.map(CentiRpm::rpm);
            PlannedTrial { name: trial.name.clone(), w1_rpm, w2_rpm, duration_s: trial.phases.total_s() }
        });
        let duration_s = plan.trials.iter().map(|trial| trial.phases.total_s()).sum();
        let waits_s: f64 = plan.trials.iter().map(|trial| trial.phases.rest_at_most_s).sum();
        Self {
            name: plan.name.clone(),
            trials: trials.collect(),
            duration_s,
            at_most_s: duration_s + waits_s,
            findings: findings(plan, knows_angles),
        }
    }

    /// Returns the number of trials and their duration, in words.
    pub fn amount(&self) -> String {
        amount(self.trials.len(), self.duration_s)
    }
}

/// Returns a number of trials and their duration, in words.
pub fn amount(trials: usize, duration_s: f64) -> String {
    format!("{}, {}", text::count(trials, "trial"), text::duration(duration_s))
}

/// Returns the local time `duration_s` from now, with the date if it is not today.
pub fn end_after(duration_s: f64) -> String {
    end(SystemTime::now(), duration_s).unwrap_or_else(|| "a time that no calendar has".to_owned())
}

/// Like [`end_after`]; `None` if the computer's clock is wrong by millennia.
fn end(now: SystemTime, duration_s: f64) -> Option<String> {
    let now = Timestamp::try_from(now).ok()?.to_zoned(TimeZone::system());
    let end = now.checked_add(SignedDuration::try_from_secs_f64(duration_s).ok()?).ok()?;
    let format = if end.date() == now.date() { "%H:%M" } else { "%Y-%m-%d %H:%M" };
    Some(end.strftime(format).to_string())
}

/// One line for the plan, and one for each trial.
impl fmt::Display for Preview {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", text::line(&self.name), self.amount())?;
        if self.at_most_s > self.duration_s {
            write!(f, "; at most {} if the robot takes long to come to rest", text::duration(self.at_most_s))?;
        }
        let width = self.trials.iter().map(|trial| trial.name.len()).max().unwrap_or_default();
        for trial in &self.trials {
            write!(f, "\n  {:width$}  {}", trial.name, text::duration(trial.duration_s))?;
        }
        Ok(())
    }
}

fn findings(plan: &Plan, knows_angles: bool) -> Vec<Finding> {
    let text = "the plan names no sensor file, so the sensor's errors are those of the data sheet";
    let cure = "`biflag sensor` measures them, which makes the ± smaller";
    let sensor = plan.sensor.is_none().then(|| Finding::slight(FindingKind::Conduct, text, cure));
    let run =
        plan.note_on_run().map(|text| Finding::slight(FindingKind::Window, text, "set a longer run under [trial]"));
    let rest = plan.note_on_rest().map(|text| Finding::slight(FindingKind::Rest, text, ""));
    // A plan with phases turns the flagella to known angles.
    let angles = note_on_unknown_angles(&plan.trials).filter(|_| !knows_angles && !plan.has_phases());
    let angles = angles.map(|text| Finding::slight(FindingKind::Conduct, text, ""));
    let grid = note_on_grid(&plan.text).map(|text| Finding::slight(FindingKind::Conduct, text, ""));
    [sensor, run, rest, angles, grid].into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn clock_of_another_millennium_has_no_end() {
        let at = |year: u64| SystemTime::UNIX_EPOCH + Duration::from_secs((year - 1970) * 31_556_952);
        assert!(end(at(2600), 60.0).is_some_and(|end| end.contains(':')));
        // The last hours of 9999 are not in every time zone.
        assert_eq!(
            [253_402_300_000, 1 << 40].map(|s| end(SystemTime::UNIX_EPOCH + Duration::from_secs(s), 60.0)),
            [None, None]
        );
        assert_eq!(end(at(2600), 1e300), None);
    }
}
