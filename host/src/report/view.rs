//! A trial as the page shows it: figures and warnings as text, and series and shapes as data for the page's script.
//!
//! What the page needs of a trial is all read here, in [`View::new`], in `curves` and in `warnings`: the metadata and the
//! summary ([`Overview`]), the attitude with the uncertainty of the yaw, the speeds and turns of the flagella, the truth of
//! an emulated board, the events, the link per second and the shapes.

use super::curves::Curves;
use super::recording::{Event, Recording};
use super::warnings::{Warning, warnings};
use crate::log::schema::biflag::event::Kind;
use crate::log::{End, ModelMeta, Origin, ReplayMeta, RobotMeta};
use crate::overview::Overview;
use crate::twin::Comparison;
use serde_json::Value;
use sim::robot::closure::Closure;
use std::path::PathBuf;

/// The most events that a page lists and marks.
pub(super) const MAX_EVENTS: usize = 200;

/// The steady angles of a trial.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Steady {
    /// Yaw, pitch, roll.
    pub angles_deg: [f64; 3],
    /// 95 % uncertainty of the yaw.
    pub yaw_uncertainty_deg: Option<f64>,
    /// The same angles of the model, if the trial is compared with one.
    pub modelled_deg: Option<[f64; 3]>,
}

/// The robot and the closure that the model's curves beside a trial were computed with.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct ModelRobot {
    /// `published`, or the file's name.
    pub name: String,
    /// The file, with the comments that state its origin.
    pub file: String,
    /// Every parameter in force, as a robot's file.
    pub parameters: String,
    pub closure: Closure,
    /// The log whose measured speeds drove the model, if it was a replay.
    pub replay_of: Option<String>,
}

impl ModelRobot {
    /// From the metadata of the modelled log; `None` if no model computed it.
    pub fn new(model: Option<ModelMeta>, robot: Option<RobotMeta>, replay: Option<ReplayMeta>) -> Option<Self> {
        let (model, robot) = (model?, robot.unwrap_or_default());
        Some(Self {
            name: robot.name,
            file: robot.text,
            parameters: model.parameters,
            closure: model.closure,
            replay_of: replay.map(|replay| replay.source),
        })
    }
}

/// A trial on the page.
#[derive(Clone, Debug)]
pub(super) struct View {
    pub name: String,
    pub speeds_rpm: [f64; 2],
    pub log: PathBuf,
    pub overview: Overview,
    pub comparison: Option<Comparison>,
    pub model_robot: Option<ModelRobot>,
    pub steady: Option<Steady>,
    pub events: Vec<Event>,
    /// How many events are not listed.
    pub more_events: usize,
    pub warnings: Vec<Warning>,
    /// How the curves and the shapes were cut down to their room.
    pub curves: Curves,
    /// Whether the shapes are those of the log that the trial is compared with.
    pub borrowed_shapes: bool,
    pub has_truth: bool,
    /// The data of the page's script; `null` if the page has no room for it.
    pub data: Value,
}

/// The room for the data of a trial on a page, bytes of text.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct ByteBudget(pub usize);

impl ByteBudget {
    /// An equal share of `bytes` for each of so many trials. A page of one trial opens faster below the limit.
    pub fn of(bytes: usize, trials: usize) -> Self {
        Self((bytes / trials.max(1)).min(3_500_000))
    }

    /// Whether there is room for charts at all.
    pub fn is_enough(self) -> bool {
        self.0 >= 8_000
    }

    /// The room for curves; what they leave, and at least as much as this leaves, is for the shapes.
    pub fn series(self) -> usize {
        self.0 / 4 * 3
    }

    /// How many events to list.
    fn events(self) -> usize {
        (self.0 / 1_000).min(MAX_EVENTS)
    }

    /// How many shapes are worth reading.
    pub fn frames(self) -> usize {
        self.0 / 400
    }
}

impl View {
    /// Fits a trial into `budget`. `other` is the log that it is compared with, read if it has the shapes.
    pub fn new(
        recording: Recording,
        other: Option<&Recording>,
        comparison: Option<Comparison>,
        model_robot: Option<ModelRobot>,
        budget: ByteBudget,
    ) -> Self {
        let trial = recording.overview.trial.clone().unwrap_or_default();
        let mut view = Self {
            name: trial.name,
            speeds_rpm: [trial.w1_rpm, trial.w2_rpm],
            log: recording.path.clone(),
            steady: steady(&recording.overview, comparison.as_ref()),
            warnings: warnings(&recording, comparison.as_ref()),
            events: Vec::new(),
            more_events: 0,
            curves: Curves::default(),
            borrowed_shapes: recording.shapes.is_empty() && other.is_some_and(|other| !other.shapes.is_empty()),
            has_truth: !recording.truth.time_s.is_empty() && !recording.is_model(),
            data: Value::Null,
            overview: recording.overview.clone(),
            comparison,
            model_robot,
        };
        if budget.is_enough() {
            let shapes_of = other.filter(|_| view.borrowed_shapes).unwrap_or(&recording);
            let comparison = view.comparison.as_ref();
            (view.data, view.curves) = Curves::fit(&recording, shapes_of, comparison, budget);
            view.data["own"] = view.own_name().into();
        }
        let most = budget.events();
        view.more_events = recording.more_events + recording.events.len().saturating_sub(most);
        view.events = most_important(recording.events, most);
        view
    }

    /// Whether the trial ended as planned.
    pub fn is_complete(&self) -> bool {
        self.overview.summary.as_ref().is_some_and(|summary| summary.end == End::Complete)
    }

    /// Whether the attitude settled, as far as the log says.
    pub fn is_settled(&self) -> bool {
        self.overview.steady.as_ref().is_none_or(|steady| steady.settled)
    }

    /// Whether the trial was computed, not measured.
    pub fn is_model(&self) -> bool {
        self.overview.identity.as_ref().is_some_and(|identity| identity.origin == Origin::Model)
    }

    /// What the trial's own angles are called, beside those of the model.
    pub fn own_name(&self) -> &'static str {
        match (self.is_model(), self.comparison.is_some()) {
            (false, _) => "measured",
            (true, false) => "model",
            (true, true) => "this log",
        }
    }
}

/// Returns at most `most` events in the order of time: first of all phases, faults and warnings.
fn most_important(events: Vec<Event>, most: usize) -> Vec<Event> {
    let is_important = |event: &Event| matches!(event.kind, Kind::Phase | Kind::Fault | Kind::Warning);
    let (mut kept, others): (Vec<Event>, Vec<Event>) = events.into_iter().partition(is_important);
    kept.truncate(most);
    let room = most - kept.len();
    kept.extend(others.into_iter().take(room));
    kept.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    kept
}

fn steady(overview: &Overview, comparison: Option<&Comparison>) -> Option<Steady> {
    if let Some(comparison) = comparison {
        return Some(Steady {
            angles_deg: comparison.steady_measured_deg,
            yaw_uncertainty_deg: comparison.yaw_uncertainty_deg,
            modelled_deg: Some(comparison.steady_modelled_deg),
        });
    }
    if let Some(model) = &overview.steady {
        return Some(Steady { angles_deg: [model.yaw_deg, model.pitch_deg, model.roll_deg], ..Steady::default() });
    }
    let angles = overview.angles?;
    Some(Steady {
        angles_deg: [angles.yaw_deg, angles.pitch_deg, angles.roll_deg],
        yaw_uncertainty_deg: angles.yaw_uncertainty_deg,
        modelled_deg: None,
    })
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

    #[test]
    fn a_page_of_many_trials_lists_fewer_events() {
        assert_eq!(ByteBudget::of(7_000_000, 1).events(), MAX_EVENTS);
        assert_eq!(ByteBudget::of(7_000_000, 190).events(), 36);
    }
}
