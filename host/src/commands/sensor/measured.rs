//! What a measurement came to, and its answer.

use super::super::answer::{Answer, Outcome};
use super::bench::{Bench, Kept};
use crate::run::rig::Followed;
use miette::Report;
use serde_json::{Map, Value, json};
use std::path::Path;
use study::sensor::{AXES, Estimate, MeasuredSensor};
use study::text::signed;

/// The result of a measurement.
#[derive(Debug, Default)]
pub struct Measured {
    /// What it found, in lines.
    pub text: String,
    /// The same for `--json`, beside the values of the file.
    pub json: Map<String, Value>,
    pub warnings: Vec<String>,
}

/// Writes the file and returns the answer.
pub fn finish(bench: &mut Bench, measured: Measured, followed: &Followed) -> miette::Result<Answer> {
    let Measured { mut text, json, mut warnings } = measured;
    if followed.link.lost > 0 {
        warnings.push(format!("{} frames were lost", followed.link.lost));
    }
    let kept = bench.save()?;
    if kept == Kept::Failed {
        warnings.push("the board's memory does not keep the scales: name the file in your plans".to_owned());
    }
    for warning in &warnings {
        text += &format!("warning: {warning}\n");
    }
    if kept == Kept::Scales {
        text += "the board keeps the scales\n";
    }
    text += &format!("written to {}; readings in {}", bench.path.display(), bench.log_path.display());
    let shown = |path: &Path| crate::text::printable(&path.display().to_string());
    let answer = Answer::new(Outcome::of(warnings.is_empty()), &json, text)?
        .with("kept_on_board", kept == Kept::Scales)
        .with("sensor", values(&bench.file))
        .with("file", shown(&bench.path))
        .with("log", shown(&bench.log_path))
        .with("warnings", warnings);
    Ok(answer)
}

/// Returns the answer to a measurement that ended early: an interrupted one is no failure.
pub fn ended(error: Report) -> miette::Result<Answer> {
    match error.to_string().as_str() {
        "interrupted" => Answer::new(Outcome::Interrupted, &json!({ "sensor": null }), "interrupted"),
        _ => Err(error),
    }
}

/// Returns the values of the file: the gyroscope's scales as lists, and every table.
fn values(file: &MeasuredSensor) -> Value {
    let scale = |part: fn(&Estimate) -> f64| AXES.map(|axis| file.get("gyro_scale", axis).as_ref().map(part));
    let mut values = Map::new();
    values.insert("scale".to_owned(), json!(scale(|scale| scale.value)));
    values.insert("scale_u".to_owned(), json!(scale(|scale| scale.u)));
    for (name, table) in file.tables() {
        let table: Map<_, _> =
            table.iter().map(|(key, one)| (key.clone(), json!({ "value": one.value, "u": one.u }))).collect();
        values.insert(name.to_owned(), Value::Object(table));
    }
    Value::Object(values)
}

/// Formats a value of each axis with its 95 % uncertainty, as a line. `scale`: that of the unit.
pub fn row(title: &str, values: &[Estimate; 3], scale: f64, places: usize, unit: &str) -> String {
    let cell = |(axis, one): (&str, &Estimate)| {
        format!("{axis} {} ± {:.places$}", signed(scale * one.value, places), 1.96 * scale * one.u)
    };
    let cells: Vec<_> = AXES.into_iter().zip(values).map(cell).collect();
    format!("{title}: {} {unit} (95 %)\n", cells.join(", "))
}

/// Formats a percentage with its 95 % uncertainty.
pub fn percent(estimate: Estimate) -> String {
    format!("{} ± {:.3} %", signed(100.0 * estimate.value, 3), 196.0 * estimate.u)
}
