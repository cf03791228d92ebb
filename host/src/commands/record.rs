//! `biflag record`: runs a plan on the rig.

use super::{Answer, Outcome};
use crate::link::{self, Link, LinkError};
use crate::live::{self, Live};
use crate::log::{BoardMeta, End, Origin, Start, Summary};
use crate::plan::{EXAMPLE, PUBLISHED, Plan, Trial};
use crate::rig::{self, Bench, Image, Progress, RecordError, SimulatedRobot, TrialRun, VirtualNano};
use crate::session::{self, Session, Sharing};
use crate::stats::LinkStats;
use miette::{IntoDiagnostic, Report, WrapErr};
use protocol::Command;
use serde::Serialize;
use std::fmt;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::SystemTime;

/// Run the trials of a plan on the rig and keep a log of each.
#[derive(clap::Args, Debug)]
#[command(after_help = format!(
    "Example: biflag record plan.toml --port /dev/ttyUSB0 --out glycerin-day-1\n\nA plan:\n\n{EXAMPLE}"
))]
pub struct Args {
    /// The plan: a TOML file like the one below.
    plan: PathBuf,
    /// The board's serial port; may be left out where there is only one.
    #[arg(long, conflicts_with = "virtual")]
    port: Option<String>,
    /// Record on the emulated board instead, which turns the simulated robot of the plan; with a file, its sensor replays
    /// these counts of a real one.
    #[arg(long = "virtual", value_name = "IMU.csv", num_args = 0..=1, require_equals = true)]
    #[expect(clippy::option_option, reason = "the flag may come without its file")]
    r#virtual: Option<Option<PathBuf>>,
    /// How much faster than real time the emulated board runs: a factor, or `max`.
    #[arg(long, default_value = "max", requires = "virtual")]
    speed: String,
    /// What the imperfections of the emulated sensor are drawn by; by default the plan's seed, or 1.
    #[arg(long, requires = "virtual")]
    seed: Option<u64>,
    /// Show what is recorded to Foxglove meanwhile, at this address.
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, require_equals = true, default_missing_value = live::ADDRESS)]
    live: Option<SocketAddr>,
    /// The session's folder; by default named after the plan.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with a session, leaving out the trials that are complete.
    #[arg(long)]
    resume: bool,
}

#[derive(Debug, Default, Serialize)]
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
    /// Angle turned about each body axis over the whole trial; only right after it.
    turned_deg: Option<[f64; 3]>,
    /// What whoever uses the trial should know; only right after it.
    warnings: Vec<String>,
    complete: bool,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = interrupted.clone();
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).into_diagnostic().wrap_err("Ctrl-C")?;

    let plan = Plan::load(&args.plan)?;
    // First, so that an address that is taken is known before anything moves.
    let live = args.live.map(Live::listen).transpose()?;
    let nano = match &args.r#virtual {
        Some(imu) => Some(start_virtual(args, imu.as_ref(), &plan)?),
        None => None,
    };
    let port = match &nano {
        Some(nano) => nano.port().to_owned(),
        None => link::choose_port(args.port.as_deref())?,
    };
    let (mut player, robot) = match (nano, &args.r#virtual) {
        (Some(nano), Some(None)) => (None, Some(SimulatedRobot::new(nano, &plan, seed(args, &plan))?)),
        (nano, _) => (nano, None),
    };
    let link = match Link::open_unless(&port, &interrupted) {
        Err(LinkError::Interrupted) => return Answer::new(Outcome::Interrupted, &Recorded::default(), "interrupted"),
        link => link?,
    };
    prepare(&link, &plan)?;
    // Last, so that a board that does not answer leaves no folder behind.
    let folder = args.out.clone().unwrap_or_else(|| session::default_folder(&plan));
    let session = match args.resume {
        true => Session::resume(&folder, &plan)?,
        false => Session::create(&folder, &plan)?,
    };

    let _lock = session.lock(Sharing::Alone)?;
    let origin = if args.r#virtual.is_some() { Origin::VirtualRig } else { Origin::Rig };
    let states = session.checked_states()?;
    let board = BoardMeta::new(link.info(), &super::settings::read(&link)?);
    let note = session.expect_same_rig(&states, origin, Some(&board))?;

    let mut recorded = Recorded { session: folder, trials: Vec::new() };
    let mut todo = Vec::new();
    let mut outcome = Outcome::Done;
    for state in states {
        let Some(attempt) = state.complete() else {
            todo.push(state.trial);
            continue;
        };
        let summary = attempt.summary.clone().unwrap_or_default();
        if !summary.link.is_lossless() {
            outcome = Outcome::WithLoss;
        }
        recorded.trials.push(RecordedTrial::new(&state.trial, attempt.path.clone(), &summary));
    }
    let mut progress = Progress::new(todo.iter().map(|trial| trial.phases.total_s()).sum());
    if let Some(note) = note {
        progress.line(&format!("note: {note}"));
    }
    if let Some(live) = &live {
        progress.line(&live.invitation());
    }
    let mut failure = None;
    for trial in &todo {
        if interrupted.load(Ordering::Relaxed) {
            outcome = Outcome::Interrupted;
            break;
        }
        let mut bench = Bench {
            link: &link,
            progress: &progress,
            interrupted: &interrupted,
            live: live.as_ref(),
            player: player.as_mut(),
            robot: robot.as_ref(),
        };
        let (path, run) = match run_trial(&mut bench, &session, trial, &plan, origin) {
            Ok(run) => run,
            Err(report) => {
                failure = Some(report);
                break;
            }
        };
        progress.end_trial(trial.phases.total_s());
        let mut row = RecordedTrial::new(trial, path, &run.summary);
        row.turned_deg = run.angles.map(|angles| angles.turned_deg);
        row.warnings = run.warnings;
        progress.line(&row.to_string());
        if !run.summary.link.is_lossless() || !row.warnings.is_empty() {
            outcome = Outcome::WithLoss;
        }
        recorded.trials.push(row);
        match run.error {
            None => {}
            Some(RecordError::Interrupted) => {
                outcome = Outcome::Interrupted;
                break;
            }
            Some(error) => {
                failure = Some(Report::from(error));
                break;
            }
        }
    }
    progress.finish();
    recorded.trials.sort_by(|a, b| a.name.cmp(&b.name));
    match failure {
        Some(report) => Answer::failed(&recorded, &report),
        None => Answer::new(outcome, &recorded, format!("session {}", recorded.session.display())),
    }
}

/// Runs a trial into a log of its own.
fn run_trial(
    bench: &mut Bench,
    session: &Session,
    trial: &Trial,
    plan: &Plan,
    origin: Origin,
) -> miette::Result<(PathBuf, TrialRun)> {
    let (attempt, path) = session.next_attempt(trial)?;
    // A calibration changes the board's settings, so each log has those that were in force at its beginning.
    let board = Some((*bench.link.info(), super::settings::read(bench.link)?));
    let start = Start { plan, trial, attempt, origin, board, time: SystemTime::now() };
    let run = rig::run(bench, &path, &start)?;
    Ok((path, run))
}

/// Puts the plan's settings in force.
fn prepare(link: &Link, plan: &Plan) -> miette::Result<()> {
    link.command(Command::Stop)?;
    if !plan.board.is_empty() {
        let settings = plan.board.apply(super::settings::read(link)?)?;
        link.command(Command::WriteSettings(settings))?;
    }
    Ok(())
}

fn seed(args: &Args, plan: &Plan) -> u64 {
    args.seed.or(plan.seed).unwrap_or(1)
}

/// The emulated board, with a recording for its sensor or the plan's robot.
fn start_virtual(args: &Args, imu: Option<&PathBuf>, plan: &Plan) -> miette::Result<VirtualNano> {
    let image = Image::build()?;
    let mut arguments = vec!["--firmware".into(), image.elf.into_os_string()];
    arguments.extend(["--speed".into(), args.speed.clone().into()]);
    arguments.extend(["--seed".into(), seed(args, plan).to_string().into()]);
    match imu {
        Some(imu) => arguments.extend(["--imu".into(), imu.clone().into_os_string()]),
        None => {
            let robot = match plan.robot.name.as_str() {
                PUBLISHED => PathBuf::from(PUBLISHED),
                name => args.plan.parent().unwrap_or(Path::new("")).join(name),
            };
            arguments.extend(["--robot".into(), robot.into_os_string()]);
        }
    }
    Ok(VirtualNano::start(&VirtualNano::program()?, arguments)?)
}

impl RecordedTrial {
    fn new(trial: &Trial, log: PathBuf, summary: &Summary) -> Self {
        let [w1_rpm, w2_rpm] = trial.speeds.map(|speed| speed.rpm());
        Self {
            name: trial.name.clone(),
            w1_rpm,
            w2_rpm,
            log,
            link: summary.link,
            yaw_deg: summary.yaw_deg,
            pitch_deg: summary.pitch_deg,
            yaw_uncertainty_deg: summary.yaw_uncertainty_deg,
            turned_deg: None,
            warnings: Vec::new(),
            complete: summary.end == End::Complete,
        }
    }
}

impl fmt::Display for RecordedTrial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.link)?;
        if let (Some(yaw), Some(pitch)) = (self.yaw_deg, self.pitch_deg) {
            write!(f, "; yaw {yaw:.2}")?;
            if let Some(uncertainty) = self.yaw_uncertainty_deg {
                write!(f, " ± {uncertainty:.2}")?;
            }
            write!(f, "°, pitch {pitch:.2}°")?;
        }
        if let Some([x, y, z]) = self.turned_deg {
            write!(f, "; turned {x:.1}°, {y:.1}°, {z:.1}° about x, y, z")?;
        }
        if !self.complete {
            write!(f, "; not complete")?;
        }
        self.warnings.iter().try_for_each(|warning| write!(f, "\n  warning: {warning}"))
    }
}
