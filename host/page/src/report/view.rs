//! A trial as the page shows it: figures and warnings as text, and series and shapes as data for the page's script.
//!
//! [`View::new`], `curves` and `warnings` extract everything that the page needs, so that the trial itself need not
//! stay in memory.

use super::budget::ByteBudget;
use super::curves::Curves;
use super::text::clip;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::{LinkStats, ModelMeta, Origin, ReplayMeta, RobotMeta};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use study::text::capitalised;
use study::trial::{Angles, Event, Finding, FindingKind, Judged, LogFinding, Records, Repeat};
use study::twin::{Compared, Comparison};

/// The robot and the closure behind the model's curves beside a trial.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct ModelRobot {
    /// Its file, with the comments that state the origin of the parameters.
    pub robot: RobotMeta,
    pub model: ModelMeta,
    /// The log whose measured speeds drove the model, if it was a replay.
    pub replay: Option<ReplayMeta>,
}

impl ModelRobot {
    /// Reads them from the metadata of the modelled log; `None` if no model computed it.
    pub fn new(records: &Records) -> Option<Self> {
        let model = records.model.clone().filter(|_| records.origin() == Origin::Model)?;
        Some(Self { robot: records.robot.clone().unwrap_or_default(), model, replay: records.replay.clone() })
    }
}

/// A trial on the page.
#[derive(Clone, Debug)]
pub struct View {
    pub(super) name: String,
    pub(super) speeds_rpm: [f64; 2],
    pub(super) log: PathBuf,
    pub(super) records: Records,
    pub(super) link: LinkStats,
    pub(super) duration_s: f64,
    pub(super) channels: BTreeMap<String, u64>,
    pub(super) comparison: Option<Comparison>,
    pub(super) model_robot: Option<ModelRobot>,
    /// Its own steady angles.
    pub(super) angles: Option<Angles>,
    /// The trial as one of several at its speeds.
    pub(super) repeat: Option<Repeat>,
    pub(super) events: Vec<Event>,
    /// Number of events that are not listed.
    pub(super) more_events: usize,
    pub(super) warnings: Vec<Warning>,
    pub(super) findings: Vec<LogFinding>,
    /// How the curves and the shapes were reduced to fit the budget.
    pub(super) curves: Curves,
    /// Whether the shapes come from the log that the trial is compared with; the same for the forces.
    pub(super) borrowed_shapes: bool,
    pub(super) borrowed_forces: bool,
    pub(super) has_truth: bool,
    /// Whether the trial ended as planned and its log is intact.
    pub(super) is_complete: bool,
    /// The data of the page's script; `null` if the page has no room for it.
    pub(super) data: Value,
}

impl View {
    /// Fits a trial into `budget`, beside the trial that it is compared with.
    pub fn new(trial: &Judged, compared: Option<(&Compared, &Judged)>, budget: ByteBudget) -> Self {
        let Judged { data, angles: zeroed, .. } = trial;
        let compared = compared.map(|(compared, other)| (compared, &other.data));
        let other = compared.map(|(_, other)| other);
        let comparison = compared.map(|(compared, _)| &compared.comparison);
        let own = data.trial();
        let mut view = Self {
            name: own.name,
            speeds_rpm: [own.w1_rpm, own.w2_rpm],
            log: data.path.clone(),
            angles: zeroed.angles(),
            repeat: Repeat::new(trial),
            warnings: warnings(trial, comparison),
            findings: comparison.map_or_else(|| trial.log_findings(), |comparison| comparison.findings.clone()),
            events: most_important(data.events.clone(), budget.events()),
            more_events: data.more_events + data.events.len().saturating_sub(budget.events()),
            curves: Curves::default(),
            borrowed_shapes: data.shapes.is_empty() && other.is_some_and(|other| !other.shapes.is_empty()),
            borrowed_forces: data.forces.is_empty() && other.is_some_and(|other| !other.forces.is_empty()),
            has_truth: !data.truth.is_empty() && !data.is_model(),
            is_complete: data.is_complete(),
            data: Value::Null,
            records: data.records.clone(),
            link: data.link,
            duration_s: data.duration_s,
            channels: data.channels.clone(),
            comparison: comparison.cloned(),
            model_robot: other.and_then(|other| ModelRobot::new(&other.records)),
        };
        if budget.is_enough() {
            (view.data, view.curves) = Curves::fit(data, zeroed, compared, budget);
            view.data["own"] = view.own_name().into();
            view.data["other"] = view.other_name().into();
        }
        view
    }

    /// Returns the steady yaw, pitch and roll, from the comparison if there is one.
    pub(super) fn steady_deg(&self) -> Option<[f64; 3]> {
        let alone = || self.angles.as_ref().map(|angles| [angles.yaw_deg, angles.pitch_deg, angles.roll_deg]);
        self.comparison.as_ref().map(Comparison::measured_deg).or_else(alone)
    }

    /// Returns their 95 % uncertainties; with a comparison, the uncertainties of the difference.
    pub(super) fn uncertainties_deg(&self) -> [Option<f64>; 3] {
        let Some(angles) = &self.angles else { return [None; 3] };
        let all = [angles.yaw_uncertainty_deg, angles.pitch_uncertainty_deg, angles.roll_uncertainty_deg];
        all.map(|deg| deg.filter(|deg| *deg > 0.0))
    }

    /// Returns whether the attitude settled; with `of_other`, the attitude of the other side of the comparison.
    pub(super) fn is_settled(&self, of_other: bool) -> bool {
        let own = self.log.to_string_lossy();
        !self.findings.iter().any(|one| one.finding.kind == FindingKind::Window && (one.log != own) == of_other)
    }

    /// Returns whether the trial was computed, not measured.
    pub(super) fn is_model(&self) -> bool {
        self.records.origin() == Origin::Model
    }

    /// Returns whether a board recorded the trial.
    pub(super) fn is_recorded(&self) -> bool {
        self.records.origin().is_recorded()
    }

    /// Returns the name of the trial's own angles.
    pub(super) fn own_name(&self) -> &'static str {
        let alone = if self.is_model() { "model" } else { "measured" };
        self.comparison.as_ref().map_or(alone, |comparison| comparison.sides.names()[0])
    }

    /// Returns the name of the angles of the other side of the comparison.
    pub(super) fn other_name(&self) -> Option<&'static str> {
        self.comparison.as_ref().map(|comparison| comparison.sides.names()[1])
    }
}

/// Returns at most `most` events in the order of time. Phases, faults and warnings take precedence over others.
fn most_important(events: Vec<Event>, most: usize) -> Vec<Event> {
    let is_important = |event: &Event| matches!(event.kind, Kind::Phase | Kind::Fault | Kind::Warning);
    let (mut kept, others): (Vec<Event>, Vec<Event>) = events.into_iter().partition(is_important);
    kept.truncate(most);
    let room = most - kept.len();
    kept.extend(others.into_iter().take(room));
    kept.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    kept
}

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

    /// Returns a finding as a warning; `log` names its log if it is not the page's own.
    pub fn of(finding: &Finding, log: Option<&str>) -> Self {
        let log = log.map_or_else(String::new, |log| format!("{log}: "));
        let brief = finding.text.split([':', ';']).next().unwrap_or_default();
        let text = clip(&format!("{}{}", log, capitalised(&finding.to_string())), 500);
        Self { brief: clip(brief, 80), text, is_grave: finding.grave }
    }
}

/// Returns the warnings of a trial, and of its comparison.
fn warnings(trial: &Judged, comparison: Option<&Comparison>) -> Vec<Warning> {
    let mut warnings: Vec<Warning> = trial.findings.iter().map(|finding| Warning::of(finding, None)).collect();
    let path = trial.data.path.to_string_lossy();
    if let Some(comparison) = comparison {
        let other = comparison.other;
        for of_log in comparison.findings.iter().filter(|of_log| of_log.log != path) {
            let warning = Warning::of(&of_log.finding, Some(&capitalised(&format!("{other} {}", of_log.log))));
            warnings.push(Warning { brief: format!("{other}: {}", warning.brief), ..warning });
        }
    }
    let further = comparison.iter().flat_map(|comparison| &comparison.warnings);
    warnings.extend(further.map(|text| Warning::new(&clip(text, 80), clip(text, 500))));
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_notes_hide_no_fault() {
        let event = |i: u32, kind| Event { time_s: i.into(), kind, text: String::new() };
        let notes = (0..100).map(|i| event(i, Kind::Note));
        let events: Vec<Event> = notes.chain([event(100, Kind::Fault), event(101, Kind::Phase)]).collect();
        let kept = most_important(events, 10);
        let times: Vec<f64> = kept.iter().map(|event| event.time_s).collect();
        assert_eq!(times, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 100.0, 101.0]);
    }
}
