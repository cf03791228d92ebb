//! The curves, shapes and marks of a trial as data for the page's script, within its [`ByteBudget`].
//!
//! A table that has no room for all of its samples keeps evenly chosen ones, which the playback shows, and the range and
//! the mean of every stretch, which the charts draw.

use super::recording::{Event, LinkSecond, Recording};
use super::table::{Column, Table, single, times};
use super::text::clip;
use super::view::{ByteBudget, MAX_EVENTS};
use crate::attitude::Track;
use crate::log::schema::biflag::event::Kind;
use crate::twin::Comparison;
use serde_json::{Value, json};
use std::ops::Range;

/// The most bars of the link's chart.
const MAX_BARS: usize = 400;

/// The most rows of the turns: a straight line between two of them is at most a few degrees off.
const MAX_TURNS: usize = 4_000;

/// Text of a row of the turns: three numbers in 32 bits.
const TURNS_ROW_BYTES: usize = 16;

const fn ranged(name: &'static str) -> Column {
    Column { name, has_range: true }
}

const fn mean(name: &'static str) -> Column {
    Column { name, has_range: false }
}

const ATTITUDE: [Column; 10] = [
    ranged("yaw"),
    ranged("pitch"),
    ranged("roll"),
    mean("uncertainty"),
    ranged("model_yaw"),
    ranged("model_pitch"),
    ranged("model_roll"),
    mean("true_yaw"),
    mean("true_pitch"),
    mean("true_roll"),
];

const UNCERTAINTY: usize = 3;

const MOTORS: [Column; 4] = [mean("target1"), ranged("speed1"), mean("target2"), ranged("speed2")];

/// How the curves and the shapes were cut down to their room.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Curves {
    /// Time between two samples of the attitude.
    pub sample_s: f64,
    /// Length of the stretches whose range the charts of the attitude show; `None` if they show every sample.
    pub attitude_range_s: Option<f64>,
    /// The same of the chart of the speeds.
    pub motors_range_s: Option<f64>,
    /// Shapes of the flagella per second; 0: rigid helices.
    pub shapes_per_s: f64,
    pub has_uncertainty: bool,
}

impl Curves {
    /// Returns the data of a trial's page, and how it was cut down. The shapes come from `shapes_of`, which is the recording
    /// or the log that it is compared with.
    pub fn fit(
        recording: &Recording,
        shapes_of: &Recording,
        comparison: Option<&Comparison>,
        budget: ByteBudget,
    ) -> (Value, Self) {
        let attitude = match comparison {
            Some(comparison) => compared(comparison, recording),
            None => alone(recording),
        };
        let attitude = attitude.broken_at_gaps().fitted(&ATTITUDE, budget.series() / 100 * 70);
        let [target1, speed1, target2, speed2, ..] = recording.motors.columns.clone();
        let motors = Table { time_s: recording.motors.time_s.clone(), columns: [target1, speed1, target2, speed2] };
        let motors = motors.broken_at_gaps().fitted(&MOTORS, budget.series() / 100 * 20);

        let (turns_time, [one, two]) = shapes_of.turns_source();
        let turns = Table { time_s: turns_time.to_vec(), columns: [one.to_vec(), two.to_vec()] };
        let turns = turns.sampled((budget.series() / 100 * 10 / TURNS_ROW_BYTES).min(MAX_TURNS));
        // The clock of another log is shifted so that both runs begin together.
        let shift_s = match comparison {
            Some(comparison) if shapes_of.path != recording.path => {
                let [measured, modelled] = comparison.run_start_s;
                measured - modelled
            }
            _ => 0.0,
        };
        let robot = shapes_of.robot();
        let mut data = json!({
            "end_s": recording.overview.duration_s,
            "phases": phases(recording),
            "marks": recording.events.iter().filter_map(mark).take(MAX_EVENTS).collect::<Vec<_>>(),
            "attitude": attitude.page(&ATTITUDE),
            "motors": motors.page(&MOTORS),
            "link": if recording.is_model() { Value::Null } else { link(&recording.link) },
            "turns": {
                "shift_s": shift_s,
                "time": times(&turns.time_s),
                "one": single(&turns.columns[0]),
                "two": single(&turns.columns[1]),
            },
            "body": {
                "radius_m": robot.base.radius_m,
                "height_m": robot.base.height_m,
                "rod_radius_m": robot.flagellum.rod_radius_m,
                "length_m": robot.flagellum.axial_length_m,
            },
        });
        let rest = budget.0.saturating_sub(data.to_string().len()).max(budget.0 - budget.series());
        let shapes = shapes_of.shapes.page(&robot, rest);
        let curves = Self {
            sample_s: attitude.samples.interval_s().unwrap_or(0.0),
            attitude_range_s: attitude.range_s(),
            motors_range_s: motors.range_s(),
            shapes_per_s: shapes["per_s"].as_f64().unwrap_or(0.0),
            has_uncertainty: attitude.samples.columns[UNCERTAINTY].iter().any(|value| value.is_finite()),
        };
        data["shapes"] = shapes;
        (data, curves)
    }
}

/// The measured angles of the comparison, those of the model, and the truth.
fn compared(comparison: &Comparison, recording: &Recording) -> Table<10> {
    let start = comparison.run_start_s[0];
    let truth = truth(recording);
    let mut table = Table::default();
    for point in &comparison.series {
        let time = point.time_s + start;
        let [yaw, pitch, roll] = point.measured_deg;
        let uncertainty = if point.yaw_uncertainty_deg > 0.0 { point.yaw_uncertainty_deg } else { f64::NAN };
        let [model_yaw, model_pitch, model_roll] = point.modelled_deg;
        let [true_yaw, true_pitch, true_roll] = truth.each_ref().map(|track| track.at(time).unwrap_or(f64::NAN));
        let row = [yaw, pitch, roll, uncertainty, model_yaw, model_pitch, model_roll, true_yaw, true_pitch, true_roll];
        table.push(time, row);
    }
    table
}

/// The angles of a log that is not compared.
fn alone(recording: &Recording) -> Table<10> {
    let Table { time_s, columns: [yaw, uncertainty] } = recording.yaw();
    let [pitch, roll] = [&recording.series.pitch.value, &recording.series.roll.value];
    let truth = truth(recording);
    let mut table = Table::default();
    for (i, time) in time_s.iter().enumerate() {
        let [true_yaw, true_pitch, true_roll] = truth.each_ref().map(|track| track.at(*time).unwrap_or(f64::NAN));
        let none = f64::NAN;
        let row = [yaw[i], pitch[i], roll[i], uncertainty[i], none, none, none, true_yaw, true_pitch, true_roll];
        table.push(*time, row);
    }
    table
}

/// The truth beside a measurement, its yaw from the start of the run; empty if there is none.
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

/// Names, starts and ends of the phases.
fn phases(recording: &Recording) -> Vec<(String, f64, f64)> {
    let begins: Vec<&Event> = recording.events.iter().filter(|event| event.kind == Kind::Phase).take(50).collect();
    let span = |i: usize| -> Range<f64> {
        begins[i].time_s..begins.get(i + 1).map_or(recording.overview.duration_s, |next| next.time_s)
    };
    let shown = |i: &usize| begins[*i].text != "end";
    (0..begins.len()).filter(shown).map(|i| (clip(&begins[i].text, 20), span(i).start, span(i).end)).collect()
}

/// An event's mark in the charts: its time, its kind and its first words. Only what went wrong and notes are marked.
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
    let width = seconds.len().div_ceil(MAX_BARS).max(1);
    let bars = |of: fn(&LinkSecond) -> u32| -> Vec<u64> {
        seconds.chunks(width).map(|bar| bar.iter().map(|second| u64::from(of(second))).sum()).collect()
    };
    // The last bar is cut off by the end of the log, which looks like a loss.
    let mut received: Vec<Option<u64>> = bars(|second| second.received).into_iter().map(Some).collect();
    if received.len() > 1 {
        received.pop();
        received.push(None);
    }
    json!({
        "width_s": width,
        "received": received,
        "lost": bars(|second| second.lost),
        "retries": bars(|second| second.retries),
        "board": bars(|second| second.board),
    })
}
