//! The curves, shapes and marks of a trial as data for the page's script, within its [`ByteBudget`].
//!
//! If not all samples of a table fit, the page keeps evenly chosen samples for the playback, and for the charts the
//! range and the mean over intervals of equal length.

use super::budget::{ByteBudget, MAX_EVENTS};
use super::table::{fitted, single, times};
use super::text::clip;
use super::{ribbon, shapes};
use crate::points::points;
use biflag_log::schema::biflag::event::Kind;
use serde_json::{Value, json};
use sim::contact::bundling::Bundling;
use sim::params::{Face, Robot, Tank};
use sim::trial::quantity::{CONTACT, FORCE, MIN_GAP, Quantity, WINDING};
use std::ops::Range;
use study::attitude::Columns;
use study::trial::{Data, Event, LinkSecond, Shapes, Zeroed};
use study::twin::{Compared, Point};

/// Largest number of bars of the link's chart.
const MAX_BARS: usize = 400;

/// Largest number of rows of motor angles: linear interpolation between two rows is at most a few degrees off.
const MAX_TURNS: usize = 4_000;

/// Bytes of text of a row of motor angles: three numbers of 32 bits.
const TURNS_ROW_BYTES: usize = 16;

const ATTITUDE: [&str; 13] = [
    "yaw",
    "pitch",
    "roll",
    "uncertainty",
    "model_yaw",
    "model_pitch",
    "model_roll",
    "true_yaw",
    "true_pitch",
    "true_roll",
    "error_yaw",
    "error_pitch",
    "error_roll",
];

/// Forces of both flagella on the base in body axes (mN), the least gap of their surfaces (mm), the turns by which they
/// are wound around each other, and whether they touch (0 or 1).
const FORCES: [&str; 9] = ["x1", "y1", "z1", "x2", "y2", "z2", "gap", "winding", "contact"];

const MOTORS: [&str; 4] = ["target1", "speed1", "target2", "speed2"];

/// How the curves and the shapes were reduced to fit the budget.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Curves {
    /// Time between two samples of the attitude, s.
    pub sample_s: f64,
    /// Length of the stretches whose range the charts of the attitude show; `None` if they show every sample.
    pub attitude_range_s: Option<f64>,
    /// The same for the chart of the speeds.
    pub motors_range_s: Option<f64>,
    /// The same for the charts of the forces.
    pub forces_range_s: Option<f64>,
    /// Shapes of the flagella per second; 0: rigid helices.
    pub shapes_per_s: f64,
    pub has_uncertainty: bool,
    pub has_forces: bool,
    /// Whether the robot file has the size of the tank.
    pub has_tank: bool,
}

impl Curves {
    /// Returns the data of a trial's page, and how it was reduced. Shapes and forces come from the trial's own log, or
    /// from the log that it is compared with if only that log has them.
    pub fn fit(
        data: &Data,
        zeroed: &Zeroed,
        compared: Option<(&Compared, &Data)>,
        budget: ByteBudget,
    ) -> (Value, Self) {
        let (compared, other) = compared.unzip();
        let source = |has: fn(&Data) -> bool| other.filter(|other| !has(data) && has(other)).unwrap_or(data);
        let shapes_of = source(|data| !data.shapes.is_empty());
        let forces_of = source(|data| !data.forces.is_empty());
        // The clock of another log is shifted so that both runs begin together.
        let shift_s = |of: &Data| match compared {
            Some(compared) if of.path != data.path => {
                let [measured, modelled] = compared.comparison.run_start_s;
                measured - modelled + compared.comparison.time_shift_s
            }
            _ => 0.0,
        };
        let attitude = attitude(&points(zeroed, &zeroed.angles_deg, compared), data);
        let forces = forces(forces_of, shift_s(forces_of));
        // Without forces, the attitude gets their share.
        let shares = if forces.is_empty() { [70, 0] } else { [50, 20] };
        let [attitude_bytes, forces_bytes] = shares.map(|share| budget.series() / 100 * share);
        let attitude = fitted(&attitude.broken_at_gaps(), &ATTITUDE, attitude_bytes);
        let forces = (!forces.is_empty()).then(|| fitted(&forces.broken_at_gaps(), &FORCES, forces_bytes));
        let [target1, speed1, target2, speed2, ..] = data.motors.values.clone();
        let motors = Columns { time_s: data.motors.time_s.clone(), values: [target1, speed1, target2, speed2] };
        let motors = fitted(&motors.broken_at_gaps(), &MOTORS, budget.series() / 100 * 20);

        let bundling = bundling(forces_of, shift_s(forces_of));
        let mut page = json!({
            "end_s": data.duration_s,
            "phases": phases(data),
            "marks": data.events.iter().filter_map(ribbon::mark).take(MAX_EVENTS).collect::<Vec<_>>(),
            "attitude": attitude.page(&ATTITUDE),
            "motors": motors.page(&MOTORS),
            "forces": forces.as_ref().map(|forces| forces.page(&FORCES)),
            "named": ribbon::named(data, &bundling),
            "bundling": bundling,
            "link": if data.is_recorded() { link(&data.link_seconds) } else { Value::Null },
        });
        let rest =
            budget.0.saturating_sub(page.to_string().len() + budget.series() / 10).max(budget.0 - budget.series());
        // The robot, and the robot of the other log if that log has its own shapes.
        let ghost = other.filter(|other| other.path != shapes_of.path && !other.shapes.is_empty());
        let shown: Vec<&Data> = std::iter::once(shapes_of).chain(ghost).collect();
        let turns_bytes = budget.series() / 100 * 10;
        let robots: Vec<Value> =
            shown.iter().map(|of| robot(of, shift_s(of), turns_bytes / shown.len(), rest / shown.len())).collect();
        let curves = Self {
            sample_s: attitude.samples.interval_s().unwrap_or(0.0),
            attitude_range_s: attitude.range_s(),
            motors_range_s: motors.range_s(),
            forces_range_s: forces.as_ref().and_then(super::table::Fitted::range_s),
            has_forces: forces.is_some(),
            has_tank: !robots[0]["tank"].is_null(),
            shapes_per_s: robots[0]["shapes"]["per_s"].as_f64().unwrap_or(0.0),
            has_uncertainty: !page["attitude"]["uncertainty"].is_null(),
        };
        page["robots"] = robots.into();
        (page, curves)
    }
}

/// Returns a robot of the view: its measures, the turns of its shafts, and the shapes of its flagella.
fn robot(of: &Data, shift_s: f64, turns_bytes: usize, shapes_bytes: usize) -> Value {
    let turns = of.turns().sampled((turns_bytes / TURNS_ROW_BYTES).min(MAX_TURNS));
    drawn(&of.robot().unwrap_or_default(), shift_s, &turns, &of.shapes, shapes_bytes)
}

/// Returns a robot of the view from the turns of its shafts and the shapes of its flagella.
pub(super) fn drawn(
    robot: &Robot,
    shift_s: f64,
    turns: &Columns<2>,
    of_flagella: &Shapes,
    shapes_bytes: usize,
) -> Value {
    let corner = |tank: &Tank, faces: [Face; 3]| faces.map(|face| tank.place(face));
    let tank = robot.tank.as_ref().map(|tank| {
        json!({
            "low_m": corner(tank, [Face::MinusX, Face::MinusY, Face::MinusZ]),
            "high_m": corner(tank, [Face::PlusX, Face::PlusY, Face::PlusZ]),
        })
    });
    json!({
        "shift_s": shift_s,
        "tank": tank,
        "turns": { "time": times(&turns.time_s), "one": single(&turns.values[0]), "two": single(&turns.values[1]) },
        "shapes": shapes::page(of_flagella, robot, shapes_bytes),
        "body": {
            "radius_m": robot.base.radius_m,
            "height_m": robot.base.height_m,
            "rod_radius_m": robot.flagellum.rod_radius_m,
            "length_m": robot.flagellum.axial_length_m,
        },
    })
}

/// Returns the columns of [`FORCES`] over the time of the page.
fn forces(data: &Data, shift_s: f64) -> Columns<9> {
    let mut table = Columns::default();
    for (i, time) in data.forces.time_s.iter().enumerate() {
        let row = data.forces.row(i);
        let of = |quantity: &Quantity| &row[quantity.in_sample()];
        let touches = of(&CONTACT).iter().any(|part| *part != 0.0);
        let milli = of(&FORCE).iter().chain(of(&MIN_GAP)).map(|value| value * 1e3);
        let values: Vec<f64> = milli.chain([of(&WINDING)[0], f64::from(u8::from(touches))]).collect();
        table.push(time + shift_s, std::array::from_fn(|k| values[k]));
    }
    table
}

/// Returns the columns of [`ATTITUDE`].
fn attitude(points: &[(f64, Point)], data: &Data) -> Columns<13> {
    let truth = truth(data);
    let mut table = Columns::default();
    for (time_s, Point { measured_deg, modelled_deg, yaw_uncertainty_deg, .. }) in points {
        let uncertainty = if *yaw_uncertainty_deg > 0.0 { *yaw_uncertainty_deg } else { f64::NAN };
        let errors = [0, 1, 2].map(|k| modelled_deg[k] - measured_deg[k]);
        let row = [&measured_deg[..], &[uncertainty], modelled_deg, &truth.at(*time_s), &errors].concat();
        table.push(*time_s, std::array::from_fn(|k| row[k]));
    }
    table
}

/// The truth beside a measurement, its yaw from the start of the run; empty if there is none.
fn truth(data: &Data) -> Columns<3> {
    if data.is_model() {
        return Columns::default();
    }
    let [mut yaw, pitch, roll, ..] = data.truth.values.clone();
    let zero = data.truth.track(0).at(data.times.run.start).unwrap_or(0.0);
    yaw.iter_mut().for_each(|value| *value -= zero);
    Columns { time_s: data.truth.time_s.clone(), values: [yaw, pitch, roll] }
}

/// Names, starts and ends of the phases.
fn phases(data: &Data) -> Vec<(String, f64, f64)> {
    let begins: Vec<&Event> = data.events.iter().filter(|event| event.kind == Kind::Phase).take(50).collect();
    let span =
        |i: usize| -> Range<f64> { begins[i].time_s..begins.get(i + 1).map_or(data.duration_s, |next| next.time_s) };
    let shown = |i: &usize| begins[*i].text != "end";
    (0..begins.len()).filter(shown).map(|i| (clip(&begins[i].text, 20), span(i).start, span(i).end)).collect()
}

/// Returns the changes between flagella apart, in touch and bundled: time and new state.
fn bundling(data: &Data, shift_s: f64) -> Vec<(f64, Bundling)> {
    let changes = data.records.steady.as_ref().map(|steady| steady.bundling_changes.as_slice()).unwrap_or_default();
    changes.iter().map(|change| (change.time_s + shift_s, change.bundling)).take(MAX_EVENTS).collect()
}

/// Returns the link over time, in at most [`MAX_BARS`] bars.
fn link(seconds: &[LinkSecond]) -> Value {
    let width = seconds.len().div_ceil(MAX_BARS).max(1);
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
