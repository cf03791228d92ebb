//! `biflag record`: runs a plan on the rig.

use super::{Answer, Outcome};
use crate::link::{self, Link};
use crate::log::{End, Origin, Start};
use crate::plan::{Plan, Trial};
use crate::rig::{self, Image, Progress, RecordError, VirtualNano};
use crate::session::{self, Session};
use crate::stats::LinkStats;
use miette::{IntoDiagnostic, Report, WrapErr};
use protocol::{Command, Settings};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

/// Run the trials of a plan on the rig and keep a log of each.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag record plan.toml --port /dev/ttyUSB0 --out glycerin-day-1")]
pub struct Args {
    /// The plan.
    plan: PathBuf,
    /// The board's serial port; may be left out where there is only one.
    #[arg(long, conflicts_with = "virtual")]
    port: Option<String>,
    /// Record on the emulated board instead; with a file, its sensor replays these counts of a real one.
    #[arg(long = "virtual", value_name = "IMU.csv", num_args = 0..=1, require_equals = true)]
    #[expect(clippy::option_option, reason = "the flag may come without its file")]
    r#virtual: Option<Option<PathBuf>>,
    /// How much faster than real time the emulated board runs: a factor, or `max`.
    #[arg(long, default_value = "max", requires = "virtual")]
    speed: String,
    /// The session's folder; by default named after the plan.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with a session, leaving out the trials that are complete.
    #[arg(long)]
    resume: bool,
}

#[derive(Debug, Serialize)]
struct Recorded {
    session: PathBuf,
    trials: Vec<RecordedTrial>,
}

#[derive(Debug, Serialize)]
struct RecordedTrial {
    name: String,
    w1_rpm: f64,
    w2_rpm: f64,
    log: PathBuf,
    #[serde(flatten)]
    link: LinkStats,
    yaw_deg: Option<f64>,
    pitch_deg: Option<f64>,
    yaw_uncertainty_deg: Option<f64>,
    complete: bool,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = interrupted.clone();
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).into_diagnostic().wrap_err("Ctrl-C")?;

    let plan = Plan::load(&args.plan)?;
    let mut nano = match &args.r#virtual {
        Some(imu) => Some(start_virtual(imu.as_ref(), &args.speed)?),
        None => None,
    };
    let port = match &nano {
        Some(nano) => nano.port().to_owned(),
        None => link::choose_port(args.port.as_deref())?,
    };
    let link = Link::open(&port)?;
    let settings = prepare(&link, &plan)?;
    // Last, so that a board that does not answer leaves no folder behind.
    let folder = args.out.clone().unwrap_or_else(|| session::default_folder(&plan));
    let session = match args.resume {
        true => Session::resume(&folder, &plan)?,
        false => Session::create(&folder, &plan)?,
    };

    let mut todo = Vec::new();
    let mut recorded = Recorded { session: folder, trials: Vec::new() };
    for trial in &plan.trials {
        match session.state(trial)?.complete() {
            Some(_) => {}
            None => todo.push(trial),
        }
    }
    let mut progress = Progress::new(todo.iter().map(|trial| trial.phases.total_s()).sum());
    let mut text = String::new();
    let mut outcome = Outcome::Done;
    for trial in todo {
        let (attempt, path) = session.next_attempt(trial)?;
        if let (Some(nano), Some(Some(_))) = (&mut nano, &args.r#virtual) {
            nano.control("play")?;
        }
        let origin = if nano.is_some() { Origin::VirtualRig } else { Origin::Rig };
        let board = Some((*link.info(), settings));
        let start = Start { plan: &plan, trial, attempt, origin, board, time: SystemTime::now() };
        let run = rig::run(&link, &path, &start, &progress, &interrupted)?;
        progress.end_trial(trial.phases.total_s());
        let line = format!("{}: {}", trial.name, run.summary.link);
        progress.line(&line);
        text += &line;
        text.push('\n');
        if !run.summary.link.is_lossless() {
            outcome = Outcome::WithLoss;
        }
        recorded.trials.push(recorded_trial(trial, path, &run.summary));
        match run.error {
            None => {}
            Some(RecordError::Interrupted) => {
                outcome = Outcome::Interrupted;
                break;
            }
            Some(error) => return Err(Report::from(error)),
        }
    }
    progress.finish();
    Answer::new(outcome, &recorded, text)
}

/// Puts the plan's settings in force, and answers all of those that are.
fn prepare(link: &Link, plan: &Plan) -> miette::Result<Settings> {
    link.command(Command::Stop)?;
    let settings = super::settings::read(link)?;
    if plan.board.is_empty() {
        return Ok(settings);
    }
    link.command(Command::WriteSettings(plan.board.apply(settings)?))?;
    super::settings::read(link)
}

fn start_virtual(imu: Option<&PathBuf>, speed: &str) -> miette::Result<VirtualNano> {
    let image = Image::build()?;
    let mut arguments = vec!["--firmware".into(), image.elf.into_os_string(), "--speed".into(), speed.into()];
    if let Some(imu) = imu {
        arguments.extend(["--imu".into(), imu.clone().into_os_string()]);
    }
    Ok(VirtualNano::start(&VirtualNano::program()?, arguments)?)
}

fn recorded_trial(trial: &Trial, log: PathBuf, summary: &crate::log::Summary) -> RecordedTrial {
    let [w1_rpm, w2_rpm] = trial.speeds.map(|speed| speed.rpm());
    RecordedTrial {
        name: trial.name.clone(),
        w1_rpm,
        w2_rpm,
        log,
        link: summary.link,
        yaw_deg: summary.yaw_deg,
        pitch_deg: summary.pitch_deg,
        yaw_uncertainty_deg: summary.yaw_uncertainty_deg,
        complete: summary.end == End::Complete,
    }
}
