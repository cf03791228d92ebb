//! `biflag simulate`: runs a plan in the model.

use super::{Answer, Outcome, WRONG_USE, replay};
use crate::log::{self, Identity, ModelMeta, Origin, SteadyMeta};
use crate::model::{Batch, Course, Job, Model, ModelError, TrialRun};
use crate::plan::{self, MAX_PHASE_S, MIN_RUN_S, Plan, Trial};
use crate::rig::Progress;
use crate::session::{self, Session, SessionError, Sharing};
use miette::{IntoDiagnostic, WrapErr};
use protocol::units::CentiRpm;
use serde::Serialize;
use sim::robot::closure::Closure;
use sim::trial::Options;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Run the trials of a plan, or one pair of speeds, in the model and keep a log of each.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  \
    biflag simulate host/plans/published-points.toml --out points\n  \
    biflag simulate --speeds=-90,90 --duration 120 --closure lumped\n  \
    biflag simulate --from glycerin --robot fitted.toml --out fitted\n\
    Exit code 3: a trial has not settled, or a log that drives the model is not whole. 1: the solver could not end a trial; the others are there.\n\
    The logs do not depend on --jobs or --shard, nor on what was interrupted and gone on with.")]
pub struct Args {
    /// The plan: a TOML file like the one that `biflag record --help` shows.
    #[arg(required_unless_present_any = ["speeds", "duration", "from"], conflicts_with_all = ["speeds", "duration", "from"])]
    plan: Option<PathBuf>,
    /// A recorded log or session: its measured speeds drive the model of its own robot.
    #[arg(long, value_name = "LOG|SESSION", conflicts_with_all = ["speeds", "duration", "shard"])]
    pub(super) from: Option<PathBuf>,
    /// Speeds of flagella 1 and 2 in rpm instead of a plan; `--speeds=-90,90` where the first is negative.
    #[arg(long, value_name = "W1,W2", value_parser = speeds, allow_hyphen_values = true, requires = "duration")]
    speeds: Option<Speeds>,
    /// How long the motors turn at these speeds, in seconds.
    #[arg(long, value_name = "S", value_parser = duration, requires = "speeds")]
    duration: Option<f64>,
    /// How the flagella act on the base: all forces, both ways; the published couples with reaction torques; or the
    /// equations as printed, whose yaw never settles.
    ///
    /// By default `full`, and with `--from` that of the log's own model where it has one.
    #[arg(long, value_enum)]
    pub(super) closure: Option<ClosureName>,
    /// The robot's file, instead of the plan's or the log's.
    #[arg(long, value_name = "FILE")]
    pub(super) robot: Option<PathBuf>,
    /// Trials at a time; by default one on every core.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) jobs: Option<u16>,
    /// Compute every N-th trial from the I-th on. Shards may share a folder, or have one each.
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    /// Samples a second; the board's rate is 200.
    #[arg(long, value_name = "HZ", default_value = "20", value_parser = rate)]
    pub(super) rate: f64,
    /// Keep the shapes of the flagella.
    #[arg(long)]
    pub(super) shapes: bool,
    /// The session's folder; by default named after the plan, the speeds, or the session that is replayed.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Go on with a session, leaving out the trials that are complete.
    #[arg(long)]
    pub(super) resume: bool,
}

#[derive(Clone, Copy, Debug)]
struct Speeds([CentiRpm; 2]);

fn speeds(text: &str) -> Result<Speeds, String> {
    let one = |text: &str| {
        let rpm: f64 = text.trim().parse().map_err(|_| format!("{text:?} is not a speed"))?;
        plan::board_speed(rpm).map_err(|(what, cure)| format!("{what}; {cure}"))
    };
    let (w1, w2) = text.split_once(',').ok_or("give two speeds in rpm, such as 50,10")?;
    Ok(Speeds([one(w1)?, one(w2)?]))
}

fn duration(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "give seconds")?;
    if (MIN_RUN_S..=MAX_PHASE_S).contains(&seconds) {
        Ok(seconds)
    } else {
        Err(format!("give {MIN_RUN_S} to {MAX_PHASE_S} s"))
    }
}

fn rate(text: &str) -> Result<f64, String> {
    let hertz: f64 = text.parse().map_err(|_| "give samples a second")?;
    if (0.01..=1000.0).contains(&hertz) { Ok(hertz) } else { Err("give 0.01 to 1000 samples a second".into()) }
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
pub(super) enum ClosureName {
    Full,
    Lumped,
    Paper,
}

impl From<ClosureName> for Closure {
    fn from(name: ClosureName) -> Self {
        match name {
            ClosureName::Full => Self::Full,
            ClosureName::Lumped => Self::Lumped,
            ClosureName::Paper => Self::Paper,
        }
    }
}

/// Every `of`-th trial from `first` on, counted from 0.
#[derive(Clone, Copy, Debug)]
struct Shard {
    first: usize,
    of: usize,
}

fn shard(text: &str) -> Result<Shard, String> {
    let form = "give the shard's number and how many there are, such as 1/8";
    let (number, of) = text.split_once('/').ok_or(form)?;
    let (number, of): (usize, usize) = (number.parse().map_err(|_| form)?, of.parse().map_err(|_| form)?);
    if (1..=of).contains(&number) { Ok(Shard { first: number - 1, of }) } else { Err(form.into()) }
}

#[derive(Debug, Serialize)]
pub(super) struct Simulated {
    pub session: PathBuf,
    /// Simulated over wall seconds of the whole command; `null` where all was complete already.
    pub real_time_factor: Option<f64>,
    pub trials: Vec<SimulatedTrial>,
}

#[derive(Debug, Serialize)]
pub(super) struct SimulatedTrial {
    pub name: String,
    pub w1_rpm: f64,
    pub w2_rpm: f64,
    pub log: PathBuf,
    #[serde(flatten)]
    pub steady: Option<SteadyMeta>,
    /// `null` where the trial was computed by an earlier run.
    pub wall_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    if let Some(from) = &args.from {
        return replay::run(args, from);
    }
    let begun = Instant::now();
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = interrupted.clone();
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).into_diagnostic().wrap_err("Ctrl-C")?;

    let plan = plan(args)?;
    let options = Options { rate_hz: args.rate, shapes: args.shapes };
    let model = Model::of_plan(&plan, args.closure.map_or(Closure::Full, Closure::from), options)?;
    let mine: Vec<&Trial> = match args.shard {
        Some(Shard { first, of }) => plan.trials.iter().skip(first).step_by(of).collect(),
        None => plan.trials.iter().collect(),
    };
    let folder = args.out.clone().unwrap_or_else(|| session::default_folder(&plan));
    let session = open(&folder, &plan, &mine, args)?;

    let _lock = session.lock(if args.shard.is_some() { Sharing::WithShards } else { Sharing::Alone })?;
    session.expect_same_rig(&session.states()?, Origin::Model, None)?;
    let mut trials = Vec::new();
    let mut todo = Vec::new();
    for trial in mine {
        match session.state(trial)?.complete() {
            Some(attempt) => trials.push(computed_before(trial, &attempt.path, &model)?),
            None => todo.push(trial),
        }
    }
    let jobs = args.jobs.map_or_else(cores, usize::from);
    let progress = Progress::new(todo.iter().map(|trial| trial.phases.total_s()).sum());
    let count = todo.len();
    progress.phase(&format!("{count} trials"), &format!("{jobs} at a time"));
    let progress = Mutex::new(progress);
    let work = |trial| Ok(Job { trial, course: Course::planned(trial)?, model: &model, plan: session.plan() });
    let work: Vec<_> = todo.into_iter().map(work).collect::<Result<_, ModelError>>()?;
    let batch = Batch { session: &session, progress: &progress, interrupted: &interrupted, jobs };
    let runs = batch.run(&work, |run| SimulatedTrial::from(run).to_string());
    progress.into_inner().unwrap_or_else(PoisonError::into_inner).finish();
    let runs = runs?;

    let wall_s = begun.elapsed().as_secs_f64();
    let simulated_s: f64 = runs.iter().filter_map(|run| Some(run.result.as_ref().ok()?.simulated_s)).sum();
    let real_time_factor = (simulated_s > 0.0).then(|| simulated_s / wall_s);
    let done = runs.len();
    trials.extend(runs.iter().map(SimulatedTrial::from));
    trials.sort_by(|a, b| a.name.cmp(&b.name));
    let outcome = if trials.iter().any(|trial| trial.error.is_some()) {
        Outcome::Failed
    } else if done < count {
        Outcome::Interrupted
    } else if trials.iter().any(|trial| trial.steady.as_ref().is_some_and(|steady| !steady.settled)) {
        Outcome::WithLoss
    } else {
        Outcome::Done
    };
    let speed = real_time_factor.map_or(String::new(), |factor| format!(", {factor:.0} times real time"));
    let rest = if done < count { "; interrupted, go on with --resume" } else { "" };
    let text = format!("session {}: {done} trials computed{speed}{rest}", folder.display());
    Answer::new(outcome, &Simulated { session: folder, real_time_factor, trials }, text)
}

/// The plan, or one made of the speeds, with the robot that the user names.
fn plan(args: &Args) -> miette::Result<Plan> {
    let mut plan = match (&args.plan, args.speeds, args.duration) {
        (Some(path), ..) => Plan::load(path)?,
        (None, Some(Speeds(speeds)), Some(run)) => {
            let [w1, w2] = speeds.map(CentiRpm::rpm);
            let text = format!(
                "[session]\nname = \"w1{w1:+}_w2{w2:+}\"\n\n[trial]\ncalibrate = 0\npreroll = 0\nrun = {run}\ndecay = 0\n\n\
                 [speeds]\npairs = [[{w1}, {w2}]]\n"
            );
            Plan::parse(&text, "--speeds")?
        }
        _ => return Err(miette::miette!(code = WRONG_USE, "neither a plan nor speeds are given")),
    };
    if let Some(path) = &args.robot {
        plan.robot = plan::robot::load(path)?;
    }
    Ok(plan)
}

/// Begins the session, or goes on with it. Shards share one, so each joins it; but none takes what it has to compute as
/// done unless told so.
fn open(folder: &Path, plan: &Plan, mine: &[&Trial], args: &Args) -> miette::Result<Session> {
    if !args.resume && args.shard.is_none() {
        return Ok(Session::create(folder, plan)?);
    }
    let session = match Session::resume(folder, plan) {
        // Another shard began it a moment ago.
        Err(SessionError::Exists { .. }) => Session::resume(folder, plan)?,
        other => other?,
    };
    if !args.resume {
        for trial in mine {
            if !session.state(trial)?.attempts.is_empty() {
                return Err(SessionError::Exists { folder: folder.to_owned() }.into());
            }
        }
    }
    Ok(session)
}

/// A trial that an earlier run of the same model computed.
fn computed_before(trial: &Trial, log: &Path, model: &Model) -> miette::Result<SimulatedTrial> {
    let help = "name another folder with --out, or go on as the session began";
    if !log::last_meta::<Identity>(log)?.is_some_and(|identity| identity.is_of_this_program()) {
        let what = "by another version of biflag";
        return Err(miette::miette!(code = WRONG_USE, help = help, "{}: computed {what}", log.display()));
    }
    match log::last_meta::<ModelMeta>(log)? {
        Some(meta) if meta == *model.meta() => {}
        Some(meta) => {
            let what = difference(&meta, model.meta());
            return Err(miette::miette!(code = WRONG_USE, help = help, "{}: computed with {what}", log.display()));
        }
        None => {
            return Err(miette::miette!(code = WRONG_USE, help = help, "{}: is not of the model", log.display()));
        }
    }
    Ok(SimulatedTrial { steady: log::last_meta(log)?, ..SimulatedTrial::new(trial, log) })
}

/// In what a log's model differs from the present one.
fn difference(then: &ModelMeta, now: &ModelMeta) -> String {
    if then.closure != now.closure {
        format!("the closure {}", format!("{:?}", then.closure).to_lowercase())
    } else if then.rate_hz != now.rate_hz {
        format!("{} samples a second", then.rate_hz)
    } else if then.shapes != now.shapes {
        format!("{}shapes", if then.shapes { "" } else { "no " })
    } else {
        "other parameters of the robot".to_owned()
    }
}

/// Trials at a time unless the user says otherwise.
pub(super) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

impl SimulatedTrial {
    pub(super) fn new(trial: &Trial, log: &Path) -> Self {
        let [w1_rpm, w2_rpm] = trial.speeds.map(CentiRpm::rpm);
        Self { name: trial.name.clone(), w1_rpm, w2_rpm, log: log.to_owned(), steady: None, wall_s: None, error: None }
    }
}

impl From<&TrialRun> for SimulatedTrial {
    fn from(run: &TrialRun) -> Self {
        Self {
            steady: run.result.as_ref().ok().cloned(),
            wall_s: Some(run.wall_s),
            error: run.result.as_ref().err().map(ToString::to_string),
            ..Self::new(&run.trial, &run.log)
        }
    }
}

impl fmt::Display for SimulatedTrial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(error) = &self.error {
            return write!(f, "error: {error}");
        }
        write!(f, "{}", self.name)?;
        let Some(steady) = &self.steady else { return Ok(()) };
        let SteadyMeta { yaw_deg, pitch_deg, roll_deg, settle_s, .. } = steady;
        write!(f, ": yaw {yaw_deg:.2}°, pitch {pitch_deg:.2}°, roll {roll_deg:.2}°")?;
        match steady.settled {
            true => write!(f, ", settled after {settle_s:.0} s")?,
            false => write!(f, ", not settled")?,
        }
        if let Some(wall_s) = self.wall_s {
            write!(f, "; {:.0} times real time", steady.simulated_s / wall_s)?;
        }
        Ok(())
    }
}
