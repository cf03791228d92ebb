//! Tables of trials and sessions: columns with names, units and values.

use crate::attitude::{Reading, Track, euler_deg, rotation};
use crate::plan::{RobotFile, Trial};
use crate::text::{origin, word};
use crate::trial::{AngleTerm, Angles, Data, FRAME, Finding, Judged, SwingSpeeds, TRUTH, Zeroed};
use biflag_log::ImportMeta;
use sim::trial::quantity::{FLAGELLA, Place, Values as Quantities, columns as quantities, sample_columns};
use std::borrow::Cow;
use std::ops::Range;

/// Times that differ by no more than this are the same, s: the board's clock counts microseconds.
const SAME_S: f64 = 4e-6;

/// A column.
#[derive(Clone, PartialEq, Debug)]
pub struct Column {
    /// Name, with the unit.
    pub name: Cow<'static, str>,
    /// The unit alone, for the column's metadata; empty if the table has none.
    pub unit: Cow<'static, str>,
    /// Description, for the header.
    pub about: Cow<'static, str>,
    /// One value a row.
    pub values: Values,
}

impl Column {
    fn new(name: impl Into<Text>, unit: &'static str, about: impl Into<Text>, values: Values) -> Self {
        Self { name: name.into(), unit: unit.into(), about: about.into(), values }
    }
}

type Text = Cow<'static, str>;

/// The rows of a table, from which its columns take their values.
pub(crate) struct Rows<'a, T>(pub &'a [T]);

impl<T> Rows<'_, T> {
    fn all<V>(&self, of: impl Fn(&T) -> V) -> Vec<V> {
        self.0.iter().map(of).collect()
    }

    /// Returns a column of measured numbers; its name has the unit.
    fn real<V: Into<Option<f64>>>(
        &self,
        name: impl Into<Text>,
        about: impl Into<Text>,
        of: impl Fn(&T) -> V,
    ) -> Column {
        Column::new(name, "", about, Values::Real(self.all(|row| of(row).into().unwrap_or(f64::NAN))))
    }

    /// Returns a column of numbers with all their digits.
    pub fn exact<A: Into<Text>>(
        &self,
        name: impl Into<Text>,
        unit: &'static str,
        about: A,
        of: impl Fn(&T) -> f64,
    ) -> Column {
        Column::new(name, unit, about, Values::Exact(self.all(of)))
    }

    /// Returns a column of integers.
    pub fn int(&self, name: &'static str, unit: &'static str, about: &'static str, of: impl Fn(&T) -> i64) -> Column {
        Column::new(name, unit, about, Values::Int(self.all(of)))
    }

    /// Returns a column of texts.
    pub fn text(&self, name: &'static str, about: &'static str, of: impl Fn(&T) -> String) -> Column {
        Column::new(name, "", about, Values::Text(self.all(of)))
    }
}

/// The values of a column.
#[derive(Clone, PartialEq, Debug)]
pub enum Values {
    /// Measured real numbers, which CSV rounds to nine decimals; NaN is a missing value.
    Real(Vec<f64>),
    /// Real numbers with all their digits; NaN is a missing value.
    Exact(Vec<f64>),
    /// Integers.
    Int(Vec<i64>),
    /// Texts.
    Text(Vec<String>),
}

impl Values {
    /// Returns the values as real numbers. Text that is not a number gives NaN.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Real(values) | Self::Exact(values) => values.clone(),
            Self::Int(values) => values.iter().map(|value| *value as f64).collect(),
            Self::Text(values) => values.iter().map(|text| text.parse().unwrap_or(f64::NAN)).collect(),
        }
    }

    /// Returns the number of rows.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        match self {
            Self::Real(values) | Self::Exact(values) => values.len(),
            Self::Int(values) => values.len(),
            Self::Text(values) => values.len(),
        }
    }
}

/// A table with its header.
#[derive(Clone, PartialEq, Debug)]
pub struct Table {
    /// Header lines about the whole table.
    pub header: Vec<String>,
    /// The columns, of equal length.
    pub columns: Vec<Column>,
}

impl Table {
    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }
}

const ANGLES: [(&str, &str); 3] = [
    ("yaw_deg", "yaw about the vertical, unwrapped, offset and drift removed"),
    ("pitch_deg", "pitch about the y axis after the yaw, offset removed"),
    ("roll_deg", "roll about the x axis after yaw and pitch, offset removed"),
];

const BOARD_ANGLES: [(&str, &str); 3] = [
    ("board_yaw_deg", "yaw of the board's filter, as sent"),
    ("board_pitch_deg", "pitch of the board's filter, as sent"),
    ("board_roll_deg", "roll of the board's filter, as sent"),
];

const MOTORS: [(&str, &str); 6] = [
    ("target1_rpm", "target speed of flagellum 1, counter-clockwise seen from above"),
    ("speed1_rpm", "measured speed of flagellum 1"),
    ("target2_rpm", "target speed of flagellum 2"),
    ("speed2_rpm", "measured speed of flagellum 2"),
    ("turns1", "turns of flagellum 1, from its encoder"),
    ("turns2", "turns of flagellum 2, from its encoder"),
];

/// Returns the table of a trial: one row per reading of the sensor, or per sample of the model.
pub fn trial(trial: &Judged) -> Table {
    let Judged { data, angles: zeroed, .. } = trial;
    let run_s = data.times.run.start;
    let list = list(data, zeroed);
    let rows = Rows(&list);
    let mut columns = vec![
        rows.real("time_s", "time from the start of the run, s", |row| row.time_s - run_s),
        rows.text("phase", "calibrate, preroll, run, decay or end", |row| phase(data, row.frame_s).to_owned()),
    ];
    for (k, (name, about)) in ANGLES.into_iter().enumerate() {
        columns.push(rows.real(name, about, |row| row.angles_deg.map(|angles| angles[k])));
    }
    let known = |row: &Row| row.angles_deg.is_some() && !data.is_model();
    let about = "95 % uncertainty of the yaw; empty if unknown, and for a model";
    let uncertainty = |row: &Row| if known(row) { zeroed.yaw_uncertainty(row.time_s) } else { None };
    columns.push(rows.real("yaw_uncertainty_deg", about, uncertainty));
    let drift = |row: &Row| known(row).then(|| zeroed.yaw_drift(row.time_s));
    columns.push(rows.real("yaw_drift_deg", "gyroscope drift removed from the yaw", drift));
    for (k, (name, about)) in BOARD_ANGLES.into_iter().enumerate() {
        columns.push(rows.real(name, about, |row| row.board_deg[k]));
    }
    for (k, (name, about)) in MOTORS.into_iter().enumerate() {
        let motor = |row: &Row| index_at(&data.motors.time_s, row.frame_s).map(|i| data.motors.values[k][i]);
        columns.push(rows.real(name, about, motor));
    }
    if data.is_recorded() {
        let temperature_c = |row: &Row| (!data.temperature_c.is_nan()).then_some(row.temperature_c);
        columns.push(rows.real("temperature_c", "temperature of the sensor", temperature_c));
        for (field, values) in FRAME.iter().zip(&data.frames.values).filter(|(_, values)| !values.is_empty()) {
            columns.push(rows.real(field.name, field.about, |row| values[row.reading]));
        }
    }
    if !data.forces.is_empty() {
        for (k, column) in sample_columns(FLAGELLA).enumerate() {
            let about = column.about();
            columns.push(rows.real(column.name, about, |row| data.forces.track(k).at(row.time_s)));
        }
    }
    if let Some(interval_s) = data.truth.interval_s() {
        for (field, track) in TRUTH.iter().zip(data.truth.tracks()) {
            columns.push(rows.real(field.name, field.about, |row| between(track, 1.5 * interval_s, row.time_s)));
        }
    }
    Table { header: header(data, zeroed), columns }
}

/// A row of the table of a trial.
struct Row {
    /// Index of the reading.
    reading: usize,
    /// Time of the attitude.
    time_s: f64,
    /// Time of the frame.
    frame_s: f64,
    /// Angles relative to the zero; `None` before the gyroscope was calibrated.
    angles_deg: Option<[f64; 3]>,
    board_deg: [f64; 3],
    temperature_c: f64,
}

fn list(data: &Data, zeroed: &Zeroed) -> Vec<Row> {
    // Each reading since the calibration has one row of angles. A model's angles are separate messages, so damage to
    // its log may remove one and leave the other.
    let first = if data.is_model() { 0 } else { data.calibrated };
    let shift_s = data.readings.get(first).zip(zeroed.angles_deg.time_s.first()).map_or(0.0, |((t, _), s)| s - t);
    let row = |(i, (frame_s, reading)): (usize, &(f64, Reading))| {
        let at = match data.is_model() {
            true => index_at(&zeroed.angles_deg.time_s, *frame_s),
            false => i.checked_sub(first).filter(|at| *at < zeroed.angles_deg.len()),
        };
        Row {
            reading: i,
            time_s: at.map_or(frame_s + shift_s, |at| zeroed.angles_deg.time_s[at]),
            frame_s: *frame_s,
            angles_deg: at.map(|at| zeroed.angles_deg.row(at)),
            board_deg: euler_deg(&rotation(reading.attitude)),
            temperature_c: reading.temperature_c,
        }
    };
    data.readings.iter().enumerate().map(row).collect()
}

/// Returns the value at a time, if it is that of a sample, or between two samples that are not further apart than this.
fn between(track: Track, longest_s: f64, time_s: f64) -> Option<f64> {
    let after = track.time_s.partition_point(|time| *time < time_s);
    let next = track.time_s.get(after)?;
    let is_near = |before: usize| next - track.time_s[before] <= longest_s;
    track.at(time_s).filter(|_| *next == time_s || after.checked_sub(1).is_some_and(is_near))
}

/// Returns the index of a time, equal to within rounding.
fn index_at(times_s: &[f64], time_s: f64) -> Option<usize> {
    let index = times_s.partition_point(|time| *time < time_s - SAME_S);
    times_s.get(index).is_some_and(|time| (time - time_s).abs() <= SAME_S).then_some(index)
}

fn phase(data: &Data, time_s: f64) -> &str {
    let time_s = time_s + 1e-9;
    let times = &data.times;
    for (name, range) in [("preroll", &times.preroll), ("run", &times.run), ("decay", &times.decay)] {
        if range.contains(&time_s) {
            return name;
        }
    }
    let before = data.phases.iter().rev().find(|(_, start_s)| *start_s <= time_s);
    match before.map(|(name, _)| name.as_str()) {
        // A fault has stopped the motors.
        Some("run") if time_s > times.run.end + SAME_S && times.has_run() => "decay",
        name => name.unwrap_or_default(),
    }
}

fn header(data: &Data, zeroed: &Zeroed) -> Vec<String> {
    let trial = data.trial();
    let mut lines = vec![
        format!(
            "biflag {}: trial {} at {} and {} rpm",
            crate::program::FULL_VERSION,
            trial.name,
            trial.w1_rpm,
            trial.w2_rpm
        ),
        format!("log {}, {}", data.path.display(), origin(data.origin())),
        "angles rotate body axes into world axes: yaw about z, then pitch about y, then roll about x".to_owned(),
    ];
    lines.extend(data.sha256.as_ref().map(|sum| format!("SHA-256 of the log: {sum}")));
    let robot = RobotFile::of_log(data.records.robot.clone()).name;
    lines.push(match &data.records.model {
        Some(model) => format!("robot {robot}, closure {}", word(&model.closure)),
        None => format!("robot {robot}"),
    });
    lines.extend(data.notes().map(|(time_s, note)| format!("note at {:.2} s: {note}", time_s - data.times.run.start)));
    lines.extend(data.records.import.as_ref().map(|import| {
        let ImportMeta { source, source_sha256, columns, .. } = import;
        format!("imported from {source}, SHA-256 {source_sha256}: {columns}")
    }));
    lines.extend(data.truth.interval_s().map(|interval_s| {
        format!(
            "truth_*: the simulated robot at the time of the angles, linear between its states every {:.1} ms",
            interval_s * 1e3
        )
    }));
    if data.is_model() {
        lines.push("modelled angles have no correction: the robot starts upright with a yaw of zero".to_owned());
        return with_steady(lines, zeroed);
    }
    let [yaw, pitch, roll] = zeroed.zero_deg;
    lines.push(format!("offset removed: yaw {yaw:.4}, pitch {pitch:.4}, roll {roll:.4} deg"));
    if data.is_recorded() {
        let delay_s = data.readings.get(data.calibrated).zip(zeroed.angles_deg.time_s.first());
        let delay_s = delay_s.map_or(0.0, |((frame_s, _), time_s)| frame_s - time_s);
        lines.push(format!(
            "each row is a frame; its angles, rates and accelerations are {:.1} ms older than its speeds and turns (the delay \
             of the sensor's filter)",
            delay_s * 1e3
        ));
        lines.push(match zeroed.drift() {
            Some(_) => "drift of the yaw removed, estimated from the still phases".to_owned(),
            None => "no drift removed: there is no still phase to estimate it from".to_owned(),
        });
    }
    with_steady(lines, zeroed)
}

/// Adds the steady angles to the lines of a header.
fn with_steady(mut lines: Vec<String>, zeroed: &Zeroed) -> Vec<String> {
    if let (Some(angles), Some(steady)) = (zeroed.angles(), &zeroed.steady) {
        let Range { start, end } = steady.window;
        let [from, to] = [start, end].map(|time| time - zeroed.run.start);
        let means = angles.named().map(|(angle, deg, _)| format!("{angle} {deg:.4}")).join(", ");
        lines.push(format!("steady, from {from:.3} to {to:.3} s: {means} deg"));
        let of = angles.named().into_iter();
        let known: Vec<_> = of.filter_map(|(angle, _, deg)| Some(format!("{angle} {:.4}", deg?))).collect();
        if !known.is_empty() {
            lines.push(format!("95 % uncertainty of the steady angles: {} deg", known.join(", ")));
        }
        // Serialising names and numbers cannot fail.
        if let Some(budget) = serde_json::to_string(&angles.budget).ok().filter(|_| !angles.budget.is_empty()) {
            lines.push(format!("budget of the steady angles: {budget}"));
        }
    }
    lines
}

/// A row of the table of a session's trials.
pub struct Summary {
    name: String,
    origin: &'static str,
    speeds_rpm: [f64; 2],
    repeat: u32,
    complete: bool,
    angles: Option<Angles>,
    settle_s: Option<f64>,
    steady: Option<Quantities>,
    lost: u64,
    findings: Vec<Finding>,
    log: String,
    file: String,
}

impl Summary {
    /// `trial` comes from the plan, because the log may have lost it; `file` is the file that the trial was exported
    /// to.
    pub fn new(trial: &Trial, judged: Judged, file: String) -> Self {
        let Judged { data, angles: zeroed, findings, .. } = judged;
        let speeds = data.records.trial.as_ref().map_or(trial.speeds, |_| data.speeds());
        let speeds =
            trial.reverse.filter(|_| data.records.steer.is_none()).map_or(speeds, |reverse| reverse.of(speeds));
        Self {
            name: trial.name.clone(),
            origin: data.origin().name(),
            speeds_rpm: speeds.map(|speed| speed.rpm()),
            repeat: trial.repeat,
            complete: data.is_complete(),
            angles: zeroed.angles(),
            settle_s: zeroed.steady.as_ref().and_then(|steady| steady.settle_s),
            steady: data.records.steady.as_ref().map(|steady| steady.values.clone()),
            lost: data.link.lost,
            findings,
            log: data.path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            file,
        }
    }
}

/// What is said of an uncertainty beside the column of its value.
const UNCERTAINTY: &str = "its 95 % uncertainty";

/// Returns the table of a session: one row per trial.
pub fn session(name: &str, trials: &[Summary]) -> Table {
    let rows = Rows(trials);
    let angle = |value: fn(&Angles) -> Option<f64>| move |trial: &Summary| trial.angles.as_ref().and_then(value);
    let swing = |value: fn(&SwingSpeeds) -> Option<f64>| {
        move |trial: &Summary| trial.angles.as_ref().and_then(|angles| value(&angles.measured))
    };
    let mut columns = vec![
        rows.text("trial", "name of the trial", |trial| trial.name.clone()),
        rows.real("w1_rpm", "target speed of flagellum 1 at the end of the run", |trial| trial.speeds_rpm[0]),
        rows.real("w2_rpm", "target speed of flagellum 2 at the end of the run", |trial| trial.speeds_rpm[1]),
        rows.int("repeat", "", "repeat of the same speeds, from 1", |trial| trial.repeat.into()),
        rows.int("complete", "", "1 if the trial ended as planned", |trial| trial.complete.into()),
        rows.real("yaw_deg", "steady yaw: mean over the end of the run", angle(|angles| Some(angles.yaw_deg))),
        rows.real("yaw_uncertainty_deg", UNCERTAINTY, angle(|angles| angles.yaw_uncertainty_deg)),
        rows.real("pitch_deg", "steady pitch", angle(|angles| Some(angles.pitch_deg))),
        rows.real("pitch_uncertainty_deg", UNCERTAINTY, angle(|angles| angles.pitch_uncertainty_deg)),
        rows.real("roll_deg", "steady roll", angle(|angles| Some(angles.roll_deg))),
        rows.real("roll_uncertainty_deg", UNCERTAINTY, angle(|angles| angles.roll_uncertainty_deg)),
        rows.real(
            "tilt_deg",
            "steady tilt: the angle between the robot's axis and the vertical",
            angle(|angles| Some(angles.tilt_deg)),
        ),
        rows.real("tilt_uncertainty_deg", UNCERTAINTY, angle(|angles| angles.tilt_uncertainty_deg)),
        rows.real("yaw_drift_deg", "drift removed from the steady yaw", angle(|angles| angles.drift_deg)),
        rows.real(
            "measured_w1_rpm",
            "speed of flagellum 1 by the swing of the robot; empty if it cannot be told",
            swing(|swing| swing.measured_w1_rpm),
        ),
        rows.real("measured_w1_uncertainty_rpm", UNCERTAINTY, swing(|swing| swing.measured_w1_uncertainty_rpm)),
        rows.real(
            "measured_w2_rpm",
            "speed of flagellum 2 by the swing of the robot",
            swing(|swing| swing.measured_w2_rpm),
        ),
        rows.real("measured_w2_uncertainty_rpm", UNCERTAINTY, swing(|swing| swing.measured_w2_uncertainty_rpm)),
        rows.text("not_measured", "why these speeds cannot be told", |trial| {
            trial.angles.as_ref().and_then(|angles| angles.measured.not_measured).unwrap_or_default().to_owned()
        }),
        rows.real("window_s", "length of the averaging window", angle(|angles| Some(angles.steady_s))),
        rows.real(
            "settle_s",
            "settling time of yaw and pitch; empty if they did not settle or the model solved for the steady state",
            |trial| trial.settle_s,
        ),
        rows.int("lost", "", "telemetry frames lost", |trial| trial.lost.try_into().unwrap_or(i64::MAX)),
        rows.int("sound", "", "0 if a finding is grave: the numbers may be wrong", |trial| {
            (!trial.findings.iter().any(|finding| finding.grave)).into()
        }),
        rows.text("log", "log of the trial", |trial| trial.log.clone()),
        rows.text("file", "file of the trial in this folder", |trial| trial.file.clone()),
        rows.text("origin", "where it ran: rig, emulated (board), import or model", |trial| trial.origin.to_owned()),
        rows.text("findings", "what was found about the trial", |trial| {
            trial.findings.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
        }),
    ];
    for column in quantities(FLAGELLA).filter(|column| column.is_in(Place::Trials)) {
        let of = |trial: &Summary| trial.steady.as_ref().map(|steady| steady.numbers()[column.index()]);
        columns.push(rows.real(column.name.clone(), format!("{}; of a model", column.about()), of));
    }
    Table { header: session_header(name), columns }
}

fn session_header(name: &str) -> Vec<String> {
    vec![format!("biflag {}: session {name}", crate::program::VERSION)]
}

/// Returns the table of the causes of uncertainty in a session: one row per trial, angle and cause.
pub fn budget(name: &str, trials: &[Summary]) -> Table {
    let budget = |trial: &Summary| trial.angles.as_ref().map_or_else(Vec::new, |angles| angles.budget.clone());
    let list: Vec<(&str, AngleTerm)> =
        trials.iter().flat_map(|trial| budget(trial).into_iter().map(|term| (trial.name.as_str(), term))).collect();
    let rows = Rows(&list);
    let columns = vec![
        rows.text("trial", "name of the trial", |(trial, _)| (*trial).to_owned()),
        rows.text("angle", "yaw, pitch, roll or tilt", |(_, of)| of.angle.to_owned()),
        rows.text("name", "the cause of uncertainty", |(_, of)| of.term.name.to_owned()),
        rows.text("type", "A: from the scatter of readings, B: from other knowledge (JCGM 100:2008)", |(_, of)| {
            word(&of.term.evaluation)
        }),
        rows.real("u_deg", "standard uncertainty that it gives the angle", |(_, of)| of.term.u_deg),
        rows.real(
            "sensitivity",
            "degrees of the angle per unit of the cause, where it is a quantity of its own",
            |(_, of)| of.term.sensitivity,
        ),
        rows.real("share", "share of the variance of the angle", |(_, of)| of.term.share),
        rows.text("common_to", "which angles have the same error: those of the trial, or of the sensor", |(_, of)| {
            word(&of.term.common_to)
        }),
    ];
    Table { header: session_header(name), columns }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Collector, Records, Want};
    use biflag_log::schema::biflag::{Motor, Quaternion, Telemetry, Truth, event::Kind};
    use biflag_log::{FORMAT, Identity, Origin};

    /// Damage to a model's log may remove a sample's truth and leave its frame, or the reverse.
    #[test]
    fn values_of_different_times_are_never_in_one_row() {
        let mut collector = Collector::new(Want::default(), FORMAT);
        collector.event(0.0, Kind::Phase, "run");
        for i in 0..10 {
            let time_s = 0.05 * f64::from(i);
            let motor = Some(Motor { target_rpm: 50.0, turns: time_s, ..Motor::default() });
            let attitude = Some(Quaternion { w: 1.0, ..Quaternion::default() });
            let frame =
                Telemetry { time_s, attitude, imu_fresh: true, motor1: motor, motor2: motor, ..Telemetry::default() };
            if i != 3 {
                collector.telemetry(&frame);
            }
            if i != 6 {
                collector.truth(&Truth { time_s, yaw_deg: time_s, ..Truth::default() });
            }
        }
        let identity = Some(Identity { origin: Origin::Model, ..Identity::default() });
        let data = collector.finish("log".as_ref(), Records { identity, ..Records::default() });
        let table = trial(&Judged::of(data));
        let column = |name: &str| match &table.columns.iter().find(|column| column.name == name).unwrap().values {
            Values::Real(values) => values.clone(),
            _ => panic!("{name} is no number"),
        };
        let (times, yaw, turns) = (column("time_s"), column("yaw_deg"), column("turns1"));
        assert_eq!(times.len(), 9);
        for (i, time) in times.iter().enumerate() {
            assert!((turns[i] - time).abs() < 1e-9, "turns {} at {time} s", turns[i]);
            let is_lost = (time - 0.3).abs() < 1e-9;
            assert!(if is_lost { yaw[i].is_nan() } else { (yaw[i] - time).abs() < 1e-9 }, "yaw {} at {time} s", yaw[i]);
        }
    }
}
