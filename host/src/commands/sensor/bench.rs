//! The board on the bench: its link, its settings, the file of its sensor, and the log of the readings.

use super::super::options::written_as;
use super::super::virtual_board::SensorArgs;
use crate::commands::answer::{Answer, Outcome, wrong_use};
use crate::commands::{settings, virtual_board};
use crate::link::{Link, LinkError};
use crate::output::OutputError;
use crate::plan::board;
use crate::program;
use crate::progress::Progress;
use crate::run::rig::{Followed, RecordError, VirtualNano, follow, note as board_note};
use crate::signals::interruption;
use biflag_log::{End, Origin, PlanMeta, Start, Summary, TrialMeta, Writer};
use miette::Report;
use protocol::Settings;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::SystemTime;
use study::sensor::{AXES, Estimate, FILE_NAME, MeasuredSensor, RawReading, note};
use study::text::signed;

/// Time between two texts of the figures, s.
const SHOWN_S: f64 = 0.2;

/// The board and the file.
#[derive(clap::Args, Debug)]
pub struct Common {
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
    /// The sensor's file. Its values stay, unless they are measured again.
    #[arg(short, long = "out", alias = "output", value_name = "FILE", default_value = FILE_NAME, value_parser = written_as(&["toml"]))]
    output: PathBuf,
}

/// The message to the user after a reading.
pub struct Told {
    /// What to do.
    pub instruction: String,
    /// The figures so far.
    pub figures: String,
    /// Whether nothing is left to do.
    pub is_done: bool,
}

/// The board on the bench.
pub struct Bench {
    /// The emulated board.
    pub nano: Option<VirtualNano>,
    /// Whether the emulated board replays a recording.
    pub is_replay: bool,
    pub link: Link,
    pub settings: Settings,
    pub file: MeasuredSensor,
    pub path: PathBuf,
    pub log_path: PathBuf,
    name: String,
    interrupted: Arc<AtomicBool>,
}

impl Bench {
    /// Opens the board for a measurement with this name, and the file of its sensor.
    pub fn open(common: &Common, name: &str) -> miette::Result<Self> {
        let interrupted = interruption()?;
        let now = program::timestamp(SystemTime::now());
        let stored = common.output.exists().then(|| MeasuredSensor::load(&common.output)).transpose()?;
        let (nano, is_replay) = match &common.r#virtual {
            Some(imu) => {
                let mut arguments = common.sensor.arguments(None);
                arguments.extend(["--speed".into(), "max".into()]);
                if let Some(imu) = imu {
                    arguments.extend(["--imu".into(), imu.clone().into_os_string()]);
                }
                (Some(virtual_board::start(arguments, &[])?), imu.is_some())
            }
            None => (None, false),
        };
        let port = virtual_board::port(nano.as_ref(), common.port.as_deref())?;
        let link = match Link::open_unless(&port, &interrupted) {
            Err(LinkError::Interrupted) => return Err(RecordError::Interrupted.into()),
            link => link?,
        };
        let settings = settings::read(&link)?;
        let mut file = stored.unwrap_or_else(|| MeasuredSensor::new(&settings));
        if let Some(why) = file.mismatch(&settings) {
            let what = format!("{} cannot be continued: {why}", common.output.display());
            return Err(wrong_use(what, "name another file with -o, or move this one away"));
        }
        now.get(..10).unwrap_or_default().clone_into(&mut file.date);
        let stamp: String = now.chars().take(19).filter(char::is_ascii_digit).collect();
        let log_path = common.output.with_file_name(format!("sensor-{}-{stamp}.mcap", name.replace(' ', "-")));
        let (path, name) = (common.output.clone(), format!("sensor {name}"));
        Ok(Self { nano, is_replay, link, settings, file, path, log_path, name, interrupted })
    }

    /// Passes every reading to `take` until nothing is left to do, and shows its message and its progress towards `total`. The
    /// readings are logged even if the measurement fails.
    pub fn follow(
        &mut self,
        total: f64,
        mut take: impl FnMut(&RawReading, Option<&mut VirtualNano>, &mut Progress) -> miette::Result<Told>,
    ) -> miette::Result<Followed> {
        let mut progress = Progress::new(total);
        let (mut said, mut shown_s) = (String::new(), f64::NEG_INFINITY);
        let origin = if self.nano.is_some() { Origin::VirtualRig } else { Origin::Rig };
        let start = Start {
            identity: program::identity(origin, SystemTime::now()),
            plan: PlanMeta { name: self.name.clone(), trials: 1, ..PlanMeta::default() },
            trial: TrialMeta { name: self.name.replace(' ', "-"), repeat: 1, attempt: 1, ..TrialMeta::default() },
            board: Some(board::to_log(self.link.info(), &self.settings)),
            ..Start::default()
        };
        let mut log = Writer::create(&self.log_path, &start, SystemTime::now())?;
        if let Some(nano) = &self.nano {
            log.meta(&nano.sensor)?;
        }
        let (nano, what) = (&mut self.nano, self.name.trim_start_matches("sensor "));
        let followed: miette::Result<_> =
            follow(&self.link, &self.settings, &mut log, &self.interrupted, |reading, _| {
                let told = take(reading, nano.as_mut(), &mut progress)?;
                if told.instruction != said {
                    progress.phase(what, &told.instruction);
                    said = told.instruction;
                }
                if reading.time_s > shown_s + SHOWN_S {
                    shown_s = reading.time_s;
                    progress.figures(&told.figures);
                }
                Ok(!told.is_done)
            });
        progress.finish();
        let summary = match &followed {
            Ok(followed) => Summary { end: End::Complete, link: followed.link, ..Summary::default() },
            Err(report) => Summary { end: End::Failed, reason: report.to_string(), ..Summary::default() },
        };
        log.finish(&summary)?;
        followed
    }

    /// Writes the file of the sensor, and the scales of the gyroscope to the board.
    fn save(&self) -> miette::Result<Kept> {
        self.file.save(&self.path).map_err(|error| OutputError::new(&self.path, error))?;
        let Some((copy, bytes)) = note::next(&board_note::read(&self.link)?, &self.file) else {
            return Ok(Kept::Nothing);
        };
        let is_kept = board_note::write(&self.link, copy as u8, &bytes)?;
        Ok(if is_kept { Kept::Scales } else { Kept::Failed })
    }
}

/// The part of a measurement that the board keeps.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kept {
    /// Nothing new.
    Nothing,
    /// The scales of the gyroscope.
    Scales,
    /// Its memory does not contain the written values.
    Failed,
}

/// The result of a measurement.
#[derive(Debug, Default)]
pub struct Measured {
    /// The findings, in lines.
    pub text: String,
    /// The same for `--json`, beside the values of the file.
    pub json: Value,
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
    text.extend(warnings.iter().map(|warning| format!("warning: {warning}\n")));
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

/// Returns the answer to a measurement that ended early: an interruption is not a failure.
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

/// Formats a value of each axis with its 95 % uncertainty, as a line. `scale`: factor to the unit.
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
