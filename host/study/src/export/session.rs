//! The tables of a session: its trials, and the causes of their uncertainty.

use super::table::{Rows, Table};
use crate::plan::Trial;
use crate::text::word;
use crate::trial::{AngleTerm, Angles, Finding, Judged, SwingSpeeds};
use sim::trial::quantity::{FLAGELLA, Place, Values as Quantities, columns as quantities};

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

/// Description of an uncertainty's column, beside the column of its value.
const UNCERTAINTY: &str = "its 95 % uncertainty";

/// Returns the table of a session: one row per trial.
pub fn table(name: &str, trials: &[Summary]) -> Table {
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
        let of = |trial: &Summary| trial.steady.as_ref().map(|steady| steady.numbers[column.index()]);
        columns.push(rows.real(column.name.clone(), format!("{}; of a model", column.about()), of));
    }
    Table { header: header(name), columns }
}

fn header(name: &str) -> Vec<String> {
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
    Table { header: header(name), columns }
}
