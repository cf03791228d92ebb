//! The table of a trial, with its header.

use super::table::{Rows, Table};
use crate::attitude::{Reading, euler_deg, rotation};
use crate::plan::RobotFile;
use crate::program::FULL_VERSION;
use crate::text::{origin, word};
use crate::trial::{Data, FRAME, Judged, TRUTH, Zeroed};
use biflag_log::{ImportMeta, TrialMeta};
use sim::trial::quantity::{FLAGELLA, SAMPLE_COLUMNS, sample_columns};
use std::ops::Range;

/// Times that differ by no more than this are the same, s: the board's clock counts microseconds.
const SAME_S: f64 = 4e-6;

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
    ("speed1_rpm", "speed of flagellum 1, by its encoder; without one by the swing, or as commanded"),
    ("target2_rpm", "target speed of flagellum 2"),
    ("speed2_rpm", "speed of flagellum 2, likewise"),
    ("turns1", "turns of flagellum 1, from its encoder, or from that speed"),
    ("turns2", "turns of flagellum 2, likewise"),
];

/// Returns the table of a trial: one row per reading of the sensor, or per sample of the model.
pub fn table(trial: &Judged) -> Table {
    let Judged { data, angles: zeroed, .. } = trial;
    let run_s = data.times.run.start;
    let list = list(data, zeroed);
    let rows = Rows(&list);
    let mut columns = vec![
        rows.real("time_s", "time from the start of the run, s", |row| row.time_s - run_s),
        rows.text("phase", "wait, calibrate, preroll, run, decay or end", |row| phase(data, row.frame_s).to_owned()),
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
        let motor = |row: &Row| row.motors.map(|i| data.motors.values[k][i]);
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
            columns.push(rows.real(column.name, about, |row| row.forces[k]));
        }
    }
    if data.truth.interval_s().is_some() {
        for (k, field) in TRUTH.iter().enumerate() {
            columns.push(rows.real(field.name, field.about, |row| row.truth.map(|truth| truth[k])));
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
    /// Index of the motors' state at this time.
    motors: Option<usize>,
    /// Angles relative to the zero; `None` before the gyroscope was calibrated.
    angles_deg: Option<[f64; 3]>,
    board_deg: [f64; 3],
    temperature_c: f64,
    forces: [f64; SAMPLE_COLUMNS],
    /// The truth at this time, if it is known at it or around it.
    truth: Option<[f64; TRUTH.len()]>,
}

fn list(data: &Data, zeroed: &Zeroed) -> Vec<Row> {
    // Each reading since the calibration has one row of angles. A model's angles are separate messages, so damage to
    // its log may remove one and leave the other.
    let first = if data.is_model() { 0 } else { data.calibrated };
    let shift_s = data.readings.get(first).zip(zeroed.angles_deg.time_s.first()).map_or(0.0, |((t, _), s)| s - t);
    let longest_s = data.truth.interval_s().map_or(0.0, |interval_s| 1.5 * interval_s);
    let row = |(i, (frame_s, reading)): (usize, &(f64, Reading))| {
        let at = match data.is_model() {
            true => index_at(&zeroed.angles_deg.time_s, *frame_s),
            false => i.checked_sub(first).filter(|at| *at < zeroed.angles_deg.len()),
        };
        let time_s = at.map_or(frame_s + shift_s, |at| zeroed.angles_deg.time_s[at]);
        Row {
            reading: i,
            time_s,
            frame_s: *frame_s,
            motors: index_at(&data.motors.time_s, *frame_s),
            angles_deg: at.map(|at| zeroed.angles_deg.row(at)),
            board_deg: euler_deg(&rotation(reading.attitude)),
            temperature_c: reading.temperature_c,
            forces: data.forces.at(time_s),
            truth: data.truth.within(longest_s, time_s),
        }
    };
    data.readings.iter().enumerate().map(row).collect()
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
    let TrialMeta { name, w1_rpm, w2_rpm, .. } = data.trial();
    let mut lines = vec![
        format!("biflag {FULL_VERSION}: trial {name} at {w1_rpm} and {w2_rpm} rpm"),
        format!("log {}, {}", data.path.display(), origin(data.origin())),
        "angles rotate body axes into world axes: yaw about z, then pitch about y, then roll about x".to_owned(),
    ];
    lines.extend(data.sha256.as_ref().map(|sum| format!("SHA-256 of the log: {sum}")));
    let robot = RobotFile::of_log(data.records.robot.clone()).name;
    let closure = data.records.model.as_ref().map(|model| format!(", closure {}", word(&model.closure)));
    lines.push(format!("robot {robot}{}", closure.unwrap_or_default()));
    lines.extend(data.notes().map(|(time_s, note)| format!("note at {:.2} s: {note}", time_s - data.times.run.start)));
    lines.extend(data.records.import.as_ref().map(|import| {
        let ImportMeta { source, source_sha256, columns, .. } = import;
        format!("imported from {source}, SHA-256 {source_sha256}: {columns}")
    }));
    lines.extend(data.truth.interval_s().map(|interval_s| {
        let ms = interval_s * 1e3;
        format!("truth_*: the simulated robot at the time of the angles, linear between its states every {ms:.1} ms")
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::table::Values;
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
        let table = table(&Judged::of(data));
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
