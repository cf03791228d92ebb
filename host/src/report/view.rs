//! A trial as the page shows it: its figures and warnings as text, and its series and shapes as data for the page's
//! script, within a given size.

use super::recording::{Event, LinkSecond, Recording};
use super::table::{Table, Thinned, quantised, single};
use super::text::clip;
use crate::attitude::Track;
use crate::log::schema::biflag::event::Kind;
use crate::log::{Condition, End, Origin};
use crate::overview::Overview;
use crate::twin::Comparison;
use serde_json::{Value, json};
use std::ops::Range;
use std::path::PathBuf;

/// The most samples of a series that a page holds: more slow it down and are not seen.
const MOST_SAMPLES: usize = 20_000;

/// The most bars of the link's chart.
const MOST_BARS: usize = 400;

/// The most events that a page lists and marks.
const MOST_EVENTS: usize = 200;

/// Text of a sample of every series: 15 in 16 bits and two times in 32.
const SAMPLE_BYTES: usize = (15 * 2 + 2 * 4) * 4 / 3;

/// The steady angles of a trial.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Steady {
    /// Yaw, pitch, roll.
    pub angles_deg: [f64; 3],
    /// 95 % uncertainty of the yaw.
    pub yaw_uncertainty_deg: Option<f64>,
    /// The same angles of the model, where the trial is compared with one.
    pub modelled_deg: Option<[f64; 3]>,
}

/// A trial on the page.
#[derive(Clone, Debug)]
pub(super) struct View {
    pub name: String,
    pub speeds_rpm: [f64; 2],
    pub log: PathBuf,
    pub overview: Overview,
    pub comparison: Option<Comparison>,
    pub steady: Option<Steady>,
    pub events: Vec<Event>,
    /// Events beyond those that are listed.
    pub more_events: usize,
    pub warnings: Vec<Warning>,
    /// The length of time that two drawn samples stand for; 0 where all are drawn.
    pub every_s: f64,
    /// How often there is a shape of the flagella; 0: helices that do not bend.
    pub shapes_per_s: f64,
    /// Whether the shapes are those of the log that the trial is compared with.
    pub borrowed_shapes: bool,
    pub has_truth: bool,
    pub has_yaw_band: bool,
    /// What the page's script draws; `null` where the page has no room for it.
    pub data: Value,
}

/// How much room a trial has on a page, bytes of text.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Room {
    pub series: usize,
    pub shapes: usize,
}

impl Room {
    /// The room of each of so many trials, such that all stay within `bytes`.
    pub fn of(bytes: usize, trials: usize) -> Self {
        let each = (bytes / trials.max(1)).min(3_500_000);
        Self { series: each / 2, shapes: each / 2 }
    }

    /// Whether there is room for charts at all.
    pub fn is_enough(self) -> bool {
        self.series >= 6_000
    }

    /// Shapes that are worth reading.
    pub fn frames(self) -> usize {
        self.shapes / 200
    }
}

impl View {
    /// Puts a log, and the one that it is compared with, into `room`.
    pub fn new(recording: Recording, other: Option<&Recording>, comparison: Option<Comparison>, room: Room) -> Self {
        let trial = recording.overview.trial.clone().unwrap_or_default();
        let mut view = Self {
            name: trial.name,
            speeds_rpm: [trial.w1_rpm, trial.w2_rpm],
            log: recording.path.clone(),
            steady: steady(&recording.overview, comparison.as_ref()),
            warnings: warnings(&recording, comparison.as_ref()),
            events: Vec::new(),
            more_events: 0,
            every_s: 0.0,
            shapes_per_s: 0.0,
            borrowed_shapes: recording.shapes.is_empty() && other.is_some_and(|other| !other.shapes.is_empty()),
            has_truth: !recording.truth.time_s.is_empty() && !recording.is_model(),
            has_yaw_band: false,
            data: Value::Null,
            overview: recording.overview.clone(),
            comparison,
        };
        if room.is_enough() {
            view.data = view.page_data(&recording, other, room);
        }
        view.more_events = recording.more_events + recording.events.len().saturating_sub(MOST_EVENTS);
        view.events = recording.events;
        view.events.truncate(MOST_EVENTS);
        view
    }

    /// Whether all of its phases were gone through.
    pub fn is_complete(&self) -> bool {
        self.overview.summary.as_ref().is_some_and(|summary| summary.end == End::Complete)
    }

    /// Whether nothing says that its steady values are no steady values.
    pub fn is_settled(&self) -> bool {
        self.overview.steady.as_ref().is_none_or(|steady| steady.settled)
    }

    /// Whether the trial was computed, not measured.
    pub fn is_model(&self) -> bool {
        self.overview.identity.as_ref().is_some_and(|identity| identity.origin == Origin::Model)
    }

    fn page_data(&mut self, recording: &Recording, other: Option<&Recording>, room: Room) -> Value {
        let most = (room.series / SAMPLE_BYTES).min(MOST_SAMPLES);
        let attitude = match &self.comparison {
            Some(comparison) => compared(comparison, recording),
            None => alone(recording),
        };
        let Thinned { table: attitude, every_s } = attitude.broken_at_gaps().thinned(most);
        self.every_s = every_s;
        self.has_yaw_band = attitude.columns[3].iter().any(|value| value.is_finite());
        let [asked1, speed1, asked2, speed2, ..] = recording.motors.columns.clone();
        let motors = Table { time_s: recording.motors.time_s.clone(), columns: [asked1, speed1, asked2, speed2] };
        let Thinned { table: motors, .. } = motors.broken_at_gaps().thinned(most);

        let shown = if self.borrowed_shapes { other.unwrap_or(recording) } else { recording };
        let (turns_time, [one, two]) = shown.turns_source();
        let turns = Table { time_s: turns_time.to_vec(), columns: [one.to_vec(), two.to_vec()] };
        let turns = turns.sampled(most.min(4_000));
        // The clock of another log is moved so that both runs begin together.
        let shift = match &self.comparison {
            Some(Comparison { run_start_s: [measured, modelled], .. }) if self.borrowed_shapes => measured - modelled,
            _ => 0.0,
        };
        let robot = shown.robot();
        let shapes = shown.shapes.page(&robot, room.shapes);
        self.shapes_per_s = shapes["per_s"].as_f64().unwrap_or(0.0);
        let names = [
            "yaw",
            "pitch",
            "roll",
            "band",
            "model_yaw",
            "model_pitch",
            "model_roll",
            "true_yaw",
            "true_pitch",
            "true_roll",
        ];
        json!({
            "end_s": recording.overview.duration_s,
            "phases": phases(recording),
            "marks": recording.events.iter().filter_map(mark).take(MOST_EVENTS).collect::<Vec<_>>(),
            "attitude": page_table(&attitude, &names),
            "motors": page_table(&motors, &["asked1", "speed1", "asked2", "speed2"]),
            "link": if recording.is_model() { Value::Null } else { link(&recording.link) },
            "shapes": shapes,
            "turns": { "shift_s": shift, "time": single(&turns.time_s), "one": single(&turns.columns[0]),
                       "two": single(&turns.columns[1]) },
            "body": {
                "radius_m": robot.base.radius_m,
                "height_m": robot.base.height_m,
                "rod_radius_m": robot.flagellum.rod_radius_m,
                "length_m": robot.flagellum.axial_length_m,
            },
        })
    }
}

fn page_table<const N: usize>(table: &Table<N>, names: &[&str; N]) -> Value {
    let mut page = serde_json::Map::new();
    page.insert("time".to_owned(), single(&table.time_s));
    for (name, column) in names.iter().zip(&table.columns) {
        if column.iter().any(|value| value.is_finite()) {
            page.insert((*name).to_owned(), quantised(column));
        }
    }
    page.into()
}

/// The measured angles as the comparison has them, the model's, and the truth.
fn compared(comparison: &Comparison, recording: &Recording) -> Table<10> {
    let start = comparison.run_start_s[0];
    let truth = truth(recording);
    let mut table = Table::default();
    for point in &comparison.series {
        let time = point.time_s + start;
        let [yaw, pitch, roll] = point.measured_deg;
        let band = if point.yaw_uncertainty_deg > 0.0 { point.yaw_uncertainty_deg } else { f64::NAN };
        let [model_yaw, model_pitch, model_roll] = point.modelled_deg;
        let [true_yaw, true_pitch, true_roll] = truth.each_ref().map(|track| track.at(time).unwrap_or(f64::NAN));
        let row = [yaw, pitch, roll, band, model_yaw, model_pitch, model_roll, true_yaw, true_pitch, true_roll];
        table.push(time, row);
    }
    table
}

/// The angles of a log by itself.
fn alone(recording: &Recording) -> Table<10> {
    let Table { time_s, columns: [yaw, band] } = recording.yaw();
    let [pitch, roll] = [&recording.series.pitch.value, &recording.series.roll.value];
    let truth = truth(recording);
    let mut table = Table::default();
    for (i, time) in time_s.iter().enumerate() {
        let [true_yaw, true_pitch, true_roll] = truth.each_ref().map(|track| track.at(*time).unwrap_or(f64::NAN));
        let none = f64::NAN;
        let row = [yaw[i], pitch[i], roll[i], band[i], none, none, none, true_yaw, true_pitch, true_roll];
        table.push(*time, row);
    }
    table
}

/// The truth beside a measurement, its yaw from the start of the run; empty where there is none.
fn truth(recording: &Recording) -> [Track; 3] {
    if recording.is_model() {
        return [const { Track { time_s: Vec::new(), value: Vec::new() } }; 3];
    }
    let [yaw, pitch, roll, ..] = &recording.truth.columns;
    let mut tracks =
        [yaw, pitch, roll].map(|column| Track { time_s: recording.truth.time_s.clone(), value: column.clone() });
    let zero = tracks[0].at(recording.overview.times.run.start).unwrap_or(0.0);
    tracks[0].value.iter_mut().for_each(|value| *value -= zero);
    tracks
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

/// Names, beginnings and ends of the phases.
fn phases(recording: &Recording) -> Vec<(String, f64, f64)> {
    let begins: Vec<&Event> = recording.events.iter().filter(|event| event.kind == Kind::Phase).take(50).collect();
    let span = |i: usize| -> Range<f64> {
        begins[i].time_s..begins.get(i + 1).map_or(recording.overview.duration_s, |next| next.time_s)
    };
    let shown = |i: &usize| begins[*i].text != "end";
    (0..begins.len()).filter(shown).map(|i| (clip(&begins[i].text, 20), span(i).start, span(i).end)).collect()
}

/// What of an event stands in the charts: its time, how bad it is, and its first words.
fn mark(event: &Event) -> Option<(f64, &'static str, String)> {
    let kind = match event.kind {
        Kind::Fault => "fault",
        Kind::Warning => "warning",
        Kind::Retry => "retry",
        Kind::Note => "note",
        Kind::Phase | Kind::State | Kind::Calibration | Kind::Clock => return None,
    };
    Some((event.time_s, kind, clip(&event.text, 80)))
}

/// The link over time, in as many bars as a chart has room for.
fn link(seconds: &[LinkSecond]) -> Value {
    let width = seconds.len().div_ceil(MOST_BARS).max(1);
    let bars = |of: fn(&LinkSecond) -> u32| -> Vec<u64> {
        seconds.chunks(width).map(|bar| bar.iter().map(|second| u64::from(of(second))).sum()).collect()
    };
    json!({
        "width_s": width,
        "received": bars(|second| second.received),
        "lost": bars(|second| second.lost),
        "retries": bars(|second| second.retries),
        "board": bars(|second| second.board),
    })
}

/// What whoever reads the figures should know first.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Warning {
    /// In a word or two, for the table.
    pub brief: String,
    /// In full.
    pub text: String,
}

impl Warning {
    pub fn new(brief: &str, text: impl Into<String>) -> Self {
        Self { brief: brief.to_owned(), text: text.into() }
    }
}

fn warnings(recording: &Recording, comparison: Option<&Comparison>) -> Vec<Warning> {
    let overview = &recording.overview;
    let mut warnings = Vec::new();
    let mut warn = |brief: &str, text: String| warnings.push(Warning::new(brief, text));
    match overview.condition {
        Condition::Clean => {}
        Condition::CutOff => warn("cut off", "The log is cut off: this is what reads of it.".to_owned()),
        Condition::Damaged => warn("damaged", "The log is damaged: this is what reads of it.".to_owned()),
    }
    if let Some(summary) = &overview.summary {
        let why = if summary.reason.is_empty() { String::new() } else { format!(": {}", clip(&summary.reason, 300)) };
        match summary.end {
            End::Complete => {}
            End::Aborted => warn("aborted", format!("The trial was aborted{why}.")),
            End::Faulted => warn("faulted", format!("The board latched a fault{why}.")),
            End::Failed => warn("failed", format!("The trial failed{why}.")),
        }
    } else {
        warn("no end", "The log does not say how the trial ended.".to_owned());
    }
    if let Some(recovery) = &overview.recovery {
        let (source, lost) = (clip(&recovery.source, 200), clip(&recovery.lost, 300));
        warn("recovered", format!("Recovered from {source}; lost: {lost}."));
    }
    let link = overview.link;
    if link.lost > 0 {
        let all = link.lost + link.samples;
        warn(&format!("{} lost", link.lost), format!("{} of {all} frames of telemetry were lost.", link.lost));
    }
    if overview.steady.as_ref().is_some_and(|steady| !steady.settled) {
        warn("not settled", "The attitude has not settled: its steady values are means of a motion.".to_owned());
    }
    if overview.calibration.as_ref().is_some_and(|calibration| !calibration.still) {
        let text = "The sensor moved while the gyroscope was calibrated: the bias found is not in force.";
        warn("not calibrated", text.to_owned());
    }
    if !recording.is_model() && overview.angles.is_some_and(|angles| angles.yaw_uncertainty_deg.is_none()) {
        warn("yaw’s error unknown", "No still phase tells how well the yaw is known.".to_owned());
    }
    for text in comparison.iter().flat_map(|comparison| &comparison.warnings) {
        warn(&clip(text, 80), clip(text, 500));
    }
    warnings
}
