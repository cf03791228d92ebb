//! A recorded trial in the model: its measured speeds drive the simulator, from its own robot's parameters.
//!
//! Replays go into a session of their own beside the recorded one, under the same names. A replay that was made from the
//! same log with the same model is not made again.

use super::{Recording, Skipped, TwinError, hash, speeds};
use crate::log::{self, Identity, ModelMeta, ReplayMeta, SteadyMeta};
use crate::model::{Batch, Course, Job, Model, ModelError, TrialRun, Turn};
use crate::plan::{self, Plan, Trial};
use crate::rig::Progress;
use crate::session::{MANIFEST, Session};
use rayon::prelude::*;
use sim::params::Robot;
use sim::robot::closure::Closure;
use sim::trial::Options;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, PoisonError};

/// Logs that belong together: a session, or one log of it.
#[derive(Clone, Debug)]
pub struct Source {
    /// The session's folder, or the log.
    pub path: PathBuf,
    /// The plan of all of them.
    pub plan: Plan,
    /// Trials and their logs: the complete attempt, or the last one where none is.
    pub logs: Vec<(Trial, PathBuf)>,
    /// Trials without a log.
    pub skipped: Vec<Skipped>,
}

impl Source {
    /// Finds the logs of a session, or makes a session of one log.
    ///
    /// # Errors
    /// [`TwinError::Session`], [`TwinError::Log`], [`TwinError::Plan`], [`TwinError::Unusable`].
    pub fn open(path: &Path) -> Result<Self, TwinError> {
        if path.is_dir() { Self::session(path) } else { Self::log(path) }
    }

    fn session(folder: &Path) -> Result<Self, TwinError> {
        let session = Session::open(folder)?;
        let (mut logs, mut skipped) = (Vec::new(), Vec::new());
        for state in session.states()? {
            match state.complete().or(state.attempts.last()) {
                Some(attempt) => logs.push((state.trial.clone(), attempt.path.clone())),
                None => skipped.push(Skipped { name: state.trial.name.clone(), reason: "it has no log".to_owned() }),
            }
        }
        Ok(Self { path: folder.to_owned(), plan: session.plan().clone(), logs, skipped })
    }

    fn log(path: &Path) -> Result<Self, TwinError> {
        let recording = Recording::read(path)?;
        let unusable = |reason: &str| TwinError::Unusable {
            path: path.to_owned(),
            reason: reason.to_owned(),
            help: "name the session's folder instead of the log",
        };
        let meta = recording.plan.as_ref().ok_or_else(|| unusable("the record of its plan does not read"))?;
        let mut plan = Plan::parse(&meta.text, &format!("plan in {}", path.display()))?;
        if let Some(robot) = &recording.robot_meta {
            plan.robot = plan::RobotFile { name: robot.name.clone(), text: robot.text.clone() };
        }
        let trial = plan.trials.iter().find(|trial| trial.name == recording.trial.name).cloned();
        let trial = trial.ok_or_else(|| unusable("its trial is not in its plan"))?;
        Ok(Self { path: path.to_owned(), plan, logs: vec![(trial, path.to_owned())], skipped: Vec::new() })
    }

    /// Where its replays go unless the user says otherwise: beside the session, or beside a log that is in none.
    pub fn replay_folder(&self) -> PathBuf {
        let folder = match self.path.parent() {
            _ if self.path.is_dir() => self.path.clone(),
            Some(folder) if folder.join(MANIFEST).exists() => folder.to_owned(),
            Some(folder) if folder.as_os_str().is_empty() && Path::new(MANIFEST).exists() => PathBuf::from("."),
            _ => self.path.with_extension(""),
        };
        let full = if folder.file_name().is_some() { folder } else { folder.canonicalize().unwrap_or(folder) };
        let name = full.file_name().unwrap_or("trial".as_ref()).to_string_lossy().into_owned();
        full.with_file_name(format!("{name}-replay"))
    }
}

/// How trials are replayed.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The closure; `None`: that of the log's own model, and `full` where it has none.
    pub closure: Option<Closure>,
    /// A robot's file in the place of the logs' own parameters.
    pub robot: Option<plan::RobotFile>,
    /// Rate and shapes.
    pub options: Options,
    /// Whether a replay with another rate or without shapes is good enough.
    pub any_rate: bool,
    /// Trials at a time.
    pub jobs: usize,
}

/// A trial and its replay.
#[derive(Debug)]
pub struct Replayed {
    /// The trial.
    pub trial: Trial,
    /// Its log.
    pub source: PathBuf,
    /// The log of the replay.
    pub log: PathBuf,
    /// What the replay came to, or why the solver could not end it.
    pub result: Result<SteadyMeta, String>,
    /// How long it took; `None` where it was there already.
    pub wall_s: Option<f64>,
    /// What is wrong with the log.
    pub warnings: Vec<String>,
}

/// What became of the logs of a source.
#[derive(Debug, Default)]
pub struct Replays {
    /// In the order of the plan.
    pub trials: Vec<Replayed>,
    /// Trials that could not be replayed, and why.
    pub skipped: Vec<Skipped>,
    /// Whether the user stopped before all were replayed.
    pub interrupted: bool,
}

/// A log that is ready to be replayed.
struct Prepared {
    trial: Trial,
    source: PathBuf,
    model: Model,
    course: Course,
    warnings: Vec<String>,
}

/// Replays all trials of a source into a session; those that are there already stay. One whose log cannot be used is
/// skipped, unless it is the only one. `line` is printed for each that ends.
///
/// # Errors
/// [`TwinError`]; what the solver cannot end is not one.
pub fn replay(
    source: &Source,
    session: &Session,
    settings: &Settings,
    interrupted: &AtomicBool,
    line: &(dyn Fn(&TrialRun) -> String + Sync),
) -> Result<Replays, TwinError> {
    let robot = match &settings.robot {
        Some(file) => Some(
            file.parse()
                .map_err(|error| TwinError::Robot { path: PathBuf::from(&file.name), source: Box::new(error) })?,
        ),
        None => None,
    };
    let plan =
        Plan { robot: settings.robot.clone().unwrap_or_else(|| source.plan.robot.clone()), ..source.plan.clone() };
    let pool = pool(settings.jobs)?;
    let prepared: Vec<_> =
        pool.install(|| source.logs.par_iter().map(|(trial, path)| prepare(trial, path, &robot, settings)).collect());

    let mut replays = Replays { skipped: source.skipped.clone(), ..Replays::default() };
    let (mut todo, mut warnings) = (Vec::new(), Vec::new());
    for (prepared, (trial, _)) in prepared.into_iter().zip(&source.logs) {
        let prepared: Prepared = match prepared {
            Ok(prepared) => prepared,
            Err(error) if source.logs.len() == 1 => return Err(error),
            Err(error) => {
                replays.skipped.push(Skipped { name: trial.name.clone(), reason: error.to_string() });
                continue;
            }
        };
        match made_before(session, &prepared, settings)? {
            Some((log, steady)) => replays.trials.push(Replayed {
                trial: prepared.trial,
                source: prepared.source,
                log,
                result: Ok(steady),
                wall_s: None,
                warnings: prepared.warnings,
            }),
            None => todo.push(prepared),
        }
    }
    let progress = Progress::new(todo.iter().map(|prepared| prepared.course.end_s).sum());
    if !todo.is_empty() {
        progress.phase(&format!("{} replays", todo.len()), &format!("{} at a time", settings.jobs));
    }
    let progress = Mutex::new(progress);
    let jobs: Vec<_> = todo
        .iter()
        .map(|prepared| Job {
            trial: &prepared.trial,
            course: prepared.course.clone(),
            model: &prepared.model,
            plan: &plan,
        })
        .collect();
    let runs = Batch { session, progress: &progress, interrupted, jobs: settings.jobs }.run(&jobs, line);
    progress.into_inner().unwrap_or_else(PoisonError::into_inner).finish();
    let runs = runs?;
    replays.interrupted = runs.len() < todo.len();
    for prepared in &mut todo {
        warnings.push((prepared.trial.index, prepared.source.clone(), std::mem::take(&mut prepared.warnings)));
    }
    for run in runs {
        let Some(at) = warnings.iter().position(|(index, ..)| *index == run.trial.index) else { continue };
        let (_, source, warnings) = warnings.swap_remove(at);
        let result = run.result.map_err(|error| error.to_string());
        let (trial, log, wall_s) = (run.trial, run.log, Some(run.wall_s));
        replays.trials.push(Replayed { trial, source, log, result, wall_s, warnings });
    }
    replays.trials.sort_by_key(|replayed| replayed.trial.index);
    Ok(replays)
}

/// Threads to work on trials.
pub(super) fn pool(jobs: usize) -> Result<rayon::ThreadPool, TwinError> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(jobs).build().map_err(ModelError::Threads)?)
}

fn prepare(trial: &Trial, path: &Path, robot: &Option<Robot>, settings: &Settings) -> Result<Prepared, TwinError> {
    let recording = Recording::read(path)?;
    let course = course(&recording, trial)?;
    let robot = match robot {
        Some(robot) => robot.clone(),
        None => recording.robot()?,
    };
    let own = recording.model.as_ref().map(|model| model.closure);
    let closure = settings.closure.or(own).unwrap_or(Closure::Full);
    let board = recording.board.as_ref().and_then(|board| board.settings()).unwrap_or_default();
    let model = Model::new(robot, board, closure, settings.options);
    Ok(Prepared { trial: trial.clone(), source: path.to_owned(), model, course, warnings: recording.warnings })
}

/// What the model goes through in the place of a recorded robot.
fn course(recording: &Recording, trial: &Trial) -> Result<Course, TwinError> {
    let own = |name: &str| !["run", "end"].contains(&name);
    let others = recording.phases.iter().filter(|(name, _)| own(name)).cloned();
    // The run begins with the motors, a moment after it was asked for.
    let run_start_s = recording.times.run.start;
    let run = ("run".to_owned(), run_start_s);
    let mut turns: Vec<_> =
        others.chain([run]).map(|(name, start_s)| Turn::phase(&name, start_s, trial.speeds)).collect();
    turns.extend(trial.reverse.map(|reverse| Turn::reversal(reverse, run_start_s, trial.speeds)));
    turns.sort_by(|a, b| a.start_s().total_cmp(&b.start_s()));
    let name = recording.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Course {
        profile: speeds::profile(recording)?,
        turns,
        end_s: recording.end_s,
        replay: Some(ReplayMeta { source: name, source_sha256: hash::of_file(&recording.path)? }),
    })
}

/// A replay of the same log by the same model, if there is one.
fn made_before(
    session: &Session,
    prepared: &Prepared,
    settings: &Settings,
) -> Result<Option<(PathBuf, SteadyMeta)>, TwinError> {
    for attempt in session.state(&prepared.trial)?.attempts.iter().rev() {
        let same_source = log::last_meta::<ReplayMeta>(&attempt.path)? == prepared.course.replay;
        let same_model = log::last_meta::<ModelMeta>(&attempt.path)?.is_some_and(|then| {
            let now = prepared.model.meta();
            let same_output = settings.any_rate || (then.rate_hz == now.rate_hz && then.shapes == now.shapes);
            same_output && then.closure == now.closure && then.parameters == now.parameters
        });
        let same_program = log::last_meta::<Identity>(&attempt.path)?.is_some_and(|then| then.is_of_this_program());
        if same_source
            && same_model
            && same_program
            && let Some(steady) = log::last_meta::<SteadyMeta>(&attempt.path)?
        {
            return Ok(Some((attempt.path.clone(), steady)));
        }
    }
    Ok(None)
}
