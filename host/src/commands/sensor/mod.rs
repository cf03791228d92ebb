//! `biflag sensor`: measures the sensor of a board, with the operator's hand as the reference.

mod bench;
mod poses;
mod still;
mod turn;

use super::options::written_as;
use super::virtual_board::SensorArgs;
use super::{Answer, Outcome};
use bench::{Bench, Kept};
use clap::Subcommand;
use miette::Report;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use study::sensor::{AXES, FILE_NAME, MeasuredSensor};

/// Measure the sensor: its scales, axes, sensitivity to gravity and noise. Start with `poses`, then turn about each axis.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag sensor poses; biflag sensor turn z; biflag sensor still 600")]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Debug)]
enum What {
    Turn(turn::Args),
    Poses(poses::Args),
    Still(still::Args),
}

/// The board and the file.
#[derive(clap::Args, Debug)]
struct Common {
    /// The serial port of the board; not needed if only one board is plugged in.
    #[arg(long, conflicts_with = "virtual")]
    port: Option<String>,
    /// Measure the emulated board, which an emulated hand moves; with a file, its sensor replays the counts recorded from a
    /// real sensor.
    #[arg(long = "virtual", value_name = "IMU.csv", num_args = 0..=1, require_equals = true)]
    #[expect(clippy::option_option, reason = "the flag may come without its file")]
    r#virtual: Option<Option<PathBuf>>,
    #[command(flatten)]
    sensor: SensorArgs,
    /// The sensor's file. What is in it already stays, unless it is measured again.
    #[arg(short, long = "out", alias = "output", value_name = "FILE", default_value = FILE_NAME, value_parser = written_as(&["toml"]))]
    output: PathBuf,
}

/// The result of a measurement.
#[derive(Debug, Default)]
struct Measured {
    /// What it found, in lines.
    text: String,
    /// The same for `--json`, beside the values of the file.
    json: Map<String, Value>,
    warnings: Vec<String>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    match &args.what {
        What::Turn(args) => turn::run(args),
        What::Poses(args) => poses::run(args),
        What::Still(args) => still::run(args),
    }
}

/// Writes the file and returns the answer.
fn finish(bench: &mut Bench, measured: Measured) -> miette::Result<Answer> {
    let Measured { mut text, mut json, mut warnings } = measured;
    let kept = bench.save()?;
    if kept == Kept::Failed {
        warnings.push("the board's memory does not keep the scales: name the file in your plans".to_owned());
    }
    json.insert("kept_on_board".to_owned(), json!(kept == Kept::Scales));
    json.insert("sensor".to_owned(), values(&bench.file));
    json.insert("file".to_owned(), json!(crate::text::printable(&bench.path.display().to_string())));
    json.insert("log".to_owned(), json!(crate::text::printable(&bench.log_path.display().to_string())));
    json.insert("warnings".to_owned(), json!(warnings));
    for warning in &warnings {
        text += &format!("warning: {warning}\n");
    }
    if kept == Kept::Scales {
        text += "the board keeps the scales\n";
    }
    text += &format!("written to {}; readings in {}", bench.path.display(), bench.log_path.display());
    Answer::new(if warnings.is_empty() { Outcome::Done } else { Outcome::WithLoss }, &json, text)
}

/// Returns the answer to a measurement that ended early: an interrupted one is no failure.
fn ended(error: Report) -> miette::Result<Answer> {
    match error.to_string().as_str() {
        "interrupted" => Answer::new(Outcome::Interrupted, &json!({ "sensor": null }), "interrupted"),
        _ => Err(error),
    }
}

/// Returns the values of the file: the gyroscope's scales as lists, and every table.
fn values(file: &MeasuredSensor) -> Value {
    #[derive(Serialize)]
    struct One {
        value: f64,
        u: f64,
    }
    let scale =
        |part: fn(&study::sensor::Estimate) -> f64| AXES.map(|axis| file.get("gyro_scale", axis).as_ref().map(part));
    let mut values = Map::new();
    values.insert("scale".to_owned(), json!(scale(|scale| scale.value)));
    values.insert("scale_u".to_owned(), json!(scale(|scale| scale.u)));
    for (name, table) in file.tables() {
        let table: Map<_, _> =
            table.iter().map(|(key, one)| (key.clone(), json!(One { value: one.value, u: one.u }))).collect();
        values.insert(name.to_owned(), Value::Object(table));
    }
    Value::Object(values)
}

/// Formats a percentage with its 95 % uncertainty.
pub(super) fn percent(estimate: study::sensor::Estimate) -> String {
    format!("{} ± {:.3} %", study::text::signed(100.0 * estimate.value, 3), 196.0 * estimate.u)
}
