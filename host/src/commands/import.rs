//! `biflag import`: a trial that other instruments measured, as a log.

use super::answer::{Answer, Outcome, are_slight, lines_of_logs, wrong_use};
use super::options::{pair, span, speeds, within, written_as};
use crate::import::{Beside, Conditions, Imported, Mapping, Table, write};
use crate::plan::robot;
use crate::text::{count, decimal, printable};
use crate::trial::{Judged, Want};
use protocol::units::CentiRpm;
use serde_json::{Value, json};
use std::path::PathBuf;
use system::shell::quoted;

/// Make a log of a trial that other instruments measured: a camera, another laboratory's rig, a published table.
///
/// The log holds the attitude and the turns of the motors. `biflag compare`, `calibrate`, `figure`, `report` and `export`
/// read it as they read a recording. The frames are those of Biflag: yaw, pitch and roll turn the body about z (up), then
/// about the new y, then about the new x. A minus before a column reverses its sign.
///
/// Angles are relative to the last second before the run. Without a rest in the table, the yaw starts at zero, and pitch and
/// roll are those of the table.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag import camera.csv --columns time=t,yaw=-psi:rad,pitch=theta:rad,roll=phi:rad --speeds 50,10 --run 20,140 \
    --uncertainty 0.5,0.2 -o camera.mcap\n  \
    biflag import camera.csv --columns time=t,yaw=psi,pitch=0,roll=0 --trial glycerin/001_w1+50_w2+10.mcap -o camera-001.mcap\n  \
    biflag import other-rig.csv --columns time=#1:ms,qw=#2,qx=#3,qy=#4,qz=#5,w1=#6,w2=#7 -o other-rig.mcap\n\
    Quantities: time (s, ms, us, min); yaw, pitch, roll (deg, rad) or qw, qx, qy, qz, the quaternion from body to world axes; w1, \
    w2 (rpm, rps, deg/s, rad/s) or turns1, turns2 (turns, deg, rad). The unit follows a colon; without it, the first one is \
    meant. `#3` is the third column. A number is a value that was not measured: roll=0.")]
pub struct Args {
    /// The table, with a comma, semicolon or tab between the cells.
    csv: PathBuf,
    /// Which column holds which quantity. Without it, the columns of the table are printed.
    #[arg(long, value_name = "QUANTITY=COLUMN,...", allow_hyphen_values = true)]
    columns: Option<String>,
    /// Lines before the names of the columns, such as a header of the instrument.
    #[arg(long, value_name = "LINES", default_value_t = 0)]
    skip: usize,
    /// The log to write, which must not exist yet; by default named after the table.
    #[arg(short, long = "out", alias = "output", value_name = "LOG", value_parser = written_as(&["mcap"]))]
    output: Option<PathBuf>,
    /// The log of a recording of the same trial. The clock of the table is then found from the yaw in both, and robot, speeds and
    /// run are the recording's: the table is a second source of its angles.
    #[arg(long, value_name = "LOG", conflicts_with_all = ["speeds", "run", "robot"])]
    trial: Option<PathBuf>,
    /// Times at which the LED of the board (D13), which is lit while a motor is on, went on and off in the pictures of a camera,
    /// in seconds by the table's clock: they give the clock instead of the yaw.
    #[arg(long, value_name = "ON,OFF", value_parser = span, allow_hyphen_values = true, requires = "trial")]
    sync: Option<[f64; 2]>,
    /// Speeds of flagella 1 and 2 in rpm; by default from the columns w1, w2, or turns1, turns2.
    #[arg(long, value_name = "W1,W2", value_parser = speeds, allow_hyphen_values = true)]
    speeds: Option<[CentiRpm; 2]>,
    /// The run, in seconds by the table's clock; by default the time in which the table's motors turn, or the whole table.
    #[arg(long, value_name = "FROM,TO", value_parser = span, allow_hyphen_values = true)]
    run: Option<[f64; 2]>,
    /// The robot file, `physical` or `published`.
    #[arg(long, value_name = "FILE", default_value = "physical")]
    robot: PathBuf,
    /// 95 % uncertainty of the instrument's yaw, and of its pitch and roll, in degrees.
    #[arg(long, value_name = "YAW,TILT", value_parser = uncertainty)]
    uncertainty: Option<[f64; 2]>,
    /// Temperature of the fluid in °C.
    #[arg(long, value_name = "C", value_parser = within("°C", -20.0..=100.0), allow_hyphen_values = true)]
    temperature: Option<f64>,
    /// Anything worth knowing later.
    #[arg(long, default_value = "")]
    note: String,
}

fn uncertainty(text: &str) -> Result<[f64; 2], String> {
    let form = "give two uncertainties in degrees, of the yaw and of pitch and roll, such as 0.5,0.2";
    let one = |text: &str| text.parse().ok().filter(|deg| (1e-6..=180.0).contains(deg)).ok_or_else(|| form.to_owned());
    pair(text, form, one)
}

/// Asks for the columns of a table.
fn which_columns(table: &str, header: &[String]) -> miette::Report {
    let has = match header {
        [] => "has no names of columns, so that they are #1, #2, ...".to_owned(),
        names => format!("has the columns {}", names.join(", ")),
    };
    let help = "say which is what with --columns, as in `time=t,yaw=-psi:rad,pitch=p,roll=0`; `biflag import --help` lists quantities and units";
    wrong_use(format!("{table} {has}"), help)
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let mapping: Option<Mapping> = args.columns.as_ref().map(|columns| columns.parse()).transpose()?;
    let output = args.output.clone().unwrap_or_else(|| args.csv.with_extension("mcap"));
    let table = args.csv.display().to_string();
    let rows = Table::read(&args.csv, args.skip)?;
    let mapping = mapping.ok_or_else(|| which_columns(&table, &rows.header))?;
    let mut states = rows.states(&mapping)?;
    let mut conditions = Conditions {
        speeds: args.speeds,
        run_s: args.run.map(|[from, to]| from..to),
        reverse: None,
        robot: robot::load(&args.robot)?,
        uncertainty_deg: args.uncertainty,
        temperature_c: args.temperature,
        note: args.note.clone(),
    };
    let mut beside = None;
    if let Some(log) = &args.trial {
        let recording = Judged::read(log, Want { hash: true, ..Want::default() })?;
        let (put, found) = Beside::put(states, &recording, &table, args.sync)?;
        (states, beside) = (put, Some(found));
        conditions = conditions.of_recording(&recording.data, &states, &table)?;
    }
    let Imported { speeds, run_s, samples } = write(&states, &conditions, &table, &output)?;
    let trial = Judged::read(&output, Want::default())?;
    let (data, angles, findings) = (&trial.data, trial.steady_angles(), trial.log_findings());
    let [w1_rpm, w2_rpm] = speeds.map(CentiRpm::rpm);
    let log = output.to_string_lossy();
    let mut body = json!({
        "log": log,
        "origin": data.origin().name(),
        "samples": samples,
        "left_out": states.about.left_out,
        "columns": mapping.to_string(),
        "duration_s": data.duration_s,
        "run_start_s": data.times.run.start,
        "run_end_s": data.times.run.end,
        "w1_rpm": w1_rpm,
        "w2_rpm": w2_rpm,
        "findings": findings,
        "not_judged": trial.not_judged,
    });
    if let (Value::Object(body), Ok(Value::Object(angles))) = (&mut body, serde_json::to_value(&angles)) {
        body.extend(angles);
    }
    let found = beside.as_ref().map_or_else(String::new, |beside| format!("\n{beside}"));
    let [from, to] = [run_s.start, run_s.end].map(|time| decimal(time, 2));
    let steady = angles.map_or_else(String::new, |angles| format!("\nsteady: {angles}"));
    let text = printable(&format!(
        "{log}: {}, {} s; the motors turn from {from} to {to} s at {w1_rpm} and {w2_rpm} rpm\nread as: {mapping}\npositive yaw: counter-clockwise seen from above{found}{steady}{}\n\
         next: biflag compare {}{}",
        count(samples, "sample"),
        decimal(data.duration_s, 2),
        lines_of_logs(&findings),
        args.trial.as_ref().map_or_else(String::new, |trial| format!("{} ", quoted(&trial.to_string_lossy()))),
        quoted(&log)
    ));
    let answer = Answer::new(Outcome::of(are_slight(&findings)), &body, text)?;
    Ok(match &beside {
        Some(beside) => answer.with("trial", &beside.trial).with("clock", beside.clock),
        None => answer,
    })
}
