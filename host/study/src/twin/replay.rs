//! Replays recorded trials in the simulator: their measured speeds drive a model with the parameters of their robot.
//!
//! Replays are written to a separate session beside the recorded one, with the same names. An existing replay of the
//! same log with the same model is reused; others are moved into its folder `attempts`, so that the plain name always
//! belongs to the last one used.

use super::{Skipped, Source, TwinError, replay_folder, speeds};
use crate::plan::{Phase, Plan, RobotFile, Schedule, Trial};
use crate::program;
use crate::progress::Progress;
use crate::run::model::{Batch, Course, Job, Model, ModelError, ModelRun, pool};
use crate::session::{Attempt, Session};
use crate::trial::{Data, Finding, Judged, LogFinding, Want};
use biflag_log::{Identity, Method, ModelMeta, Origin, ReplayMeta, RobotMeta, SteadyMeta, last_meta};
use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::Options;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Sampling rate of replays for comparisons, Hz. The fastest wobble takes half a second.
pub const REPLAY_HZ: f64 = 20.0;

/// Settings of a replay.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The closure; `None` for the closure of the log's model, or `full` if the log has no model.
    pub closure: Option<Closure>,
    /// A robot's file to use instead of the parameters in the logs.
    pub robot: Option<RobotFile>,
    /// Rate and shapes.
    pub options: Options,
    /// Whether an existing replay with another rate or without shapes may be used.
    pub any_rate: bool,
    /// Number of trials computed in parallel.
    pub jobs: usize,
    /// Whether nothing is printed.
    pub quiet: bool,
}

/// A trial and its replay.
#[derive(Debug)]
pub struct Replayed {
    /// The trial.
    pub trial: Trial,
    /// Log of the trial.
    pub source: PathBuf,
    /// Log of the replay.
    pub log: PathBuf,
    /// The steady state of the replay, or the failure of the solver.
    pub result: Result<SteadyMeta, String>,
    /// Wall time, s; `None` if the replay already existed.
    pub wall_s: Option<f64>,
    /// Findings about the recording.
    pub findings: Vec<Finding>,
    /// How to find the helix angles, if the result depends on them. The encoders do not measure them, because they count from
    /// the start of the board.
    pub needs_phase: Option<&'static str>,
}

/// Remedies for unknown helix angles: a fit to the trial, or its missing inputs, because a fit needs all angles with an
/// uncertainty.
const FIT: &str = "`biflag calibrate --fit phase` finds it";
const STATE: &str =
    "a fit that finds it needs yaw, pitch and roll with an --uncertainty; or name a --robot with `phase_deg`";

/// The replays of a source, each with the caller's result for it.
#[derive(Debug)]
pub struct Replays<T> {
    /// The replays in the plan's order.
    pub trials: Vec<(Replayed, T)>,
    /// Trials that could not be replayed, with reasons.
    pub skipped: Vec<Skipped>,
    /// Findings about logs that belong to no trial.
    pub left_out: Vec<LogFinding>,
    /// Whether the user interrupted the replay.
    pub interrupted: bool,
    /// A note about replays of another robot that these have replaced under the same names.
    pub replaced: Option<String>,
}

impl<T> Replays<T> {
    /// Returns notes on the replays for the user.
    pub fn notes(&self) -> Vec<String> {
        self.replaced.iter().cloned().chain(self.note_on_phases()).collect()
    }

    /// Returns a note about helix angles that the encoders do not measure.
    fn note_on_phases(&self) -> Option<String> {
        let needing = self.trials.iter().filter_map(|(one, _)| Some((&one.trial.name, one.needs_phase?)));
        let needing: Vec<_> = needing.collect();
        let (first, _) = needing.first()?;
        let and_others = match needing.len() {
            1 => String::new(),
            count => format!(" and {}", crate::text::count(count - 1, "other trial")),
        };
        let cure = if needing.iter().any(|(_, cure)| *cure == FIT) { FIT } else { STATE };
        Some(format!(
            "the results of {first}{and_others} depend on how the flagella stood at the start, which nothing has measured; {cure}"
        ))
    }
}

/// One trial of a source.
enum Outcome<T> {
    Replayed(Box<Replayed>, T),
    /// The name of the trial, and why it was skipped.
    Skipped(String, TwinError),
    Interrupted,
}

/// Replays all trials of a source into a session, using replays that already exist. A trial whose log cannot be used is
/// skipped, unless it is the only one. As each replay ends, prints its `line` and calls `then` with the replay and its
/// recording. Each recording is read once, with the optional parts in `want`.
///
/// # Errors
/// [`TwinError`]; a failure of the solver is returned in the replay's result instead.
pub fn replay<T: Send>(
    source: &Source,
    session: &Session,
    settings: &Settings,
    want: Want,
    interrupted: &AtomicBool,
    line: &(dyn Fn(&ModelRun) -> String + Sync),
    then: &(dyn Fn(&Replayed, Judged) -> T + Sync),
) -> Result<Replays<T>, TwinError> {
    let robot = settings.robot.as_ref().map(RobotFile::parse).transpose()?;
    let robot_of_plan = settings.robot.clone().unwrap_or_else(|| source.plan.robot.clone());
    let plan = Plan { robot: robot_of_plan, ..source.plan.clone() };
    let total_s = source.logs.iter().map(|(trial, _)| trial.phases.total_s()).sum();
    let progress = if settings.quiet { Progress::quiet() } else { Progress::new(total_s) };
    progress.phase(&crate::text::count(source.logs.len(), "replay"), &format!("{} at a time", settings.jobs));
    let batch = Batch::new(session, &progress, interrupted);
    let one = |(trial, attempt): &(Trial, Attempt)| {
        let recording = attempt.read(Want { hash: true, ..want }).map_err(TwinError::from);
        let prepared = recording.and_then(|recording| Ok((prepare(trial, &recording, &robot, settings)?, recording)));
        let ((model, course, needs_phase), recording) = match prepared {
            Ok(prepared) => prepared,
            Err(error) => return Ok(Outcome::Skipped(trial.name.clone(), error)),
        };
        let replayed = |log, result, wall_s| Replayed {
            trial: trial.clone(),
            source: attempt.path.clone(),
            log,
            result,
            wall_s,
            findings: recording.findings.clone(),
            needs_phase,
        };
        let replayed = match cached_replay(session, trial, &model, &course, settings)? {
            Some((log, steady)) => {
                batch.pass(trial.phases.total_s());
                replayed(log, Ok(steady), None)
            }
            None => {
                replay_folder::retire(session, trial)?;
                match batch.compute(&Job { trial, course, model: &model, plan: &plan }, line) {
                    Ok(run) => replayed(run.log, run.result.map_err(|error| error.to_string()), Some(run.wall_s)),
                    Err(ModelError::Interrupted) => return Ok(Outcome::Interrupted),
                    Err(error) => return Err(error.into()),
                }
            }
        };
        let made = then(&replayed, recording);
        Ok(Outcome::Replayed(Box::new(replayed), made))
    };
    let before = robot_of_replays(source, session);
    let outcomes: Result<Vec<_>, TwinError> =
        pool(settings.jobs)?.install(|| source.logs.iter().par_bridge().map(one).collect());
    progress.finish();
    let mut replays = Replays {
        trials: Vec::new(),
        skipped: source.skipped.clone(),
        left_out: source.left_out.clone(),
        interrupted: false,
        replaced: replaced(before, source, session),
    };
    for outcome in outcomes? {
        match outcome {
            Outcome::Replayed(replayed, made) => replays.trials.push((*replayed, made)),
            Outcome::Skipped(_, error) if source.logs.len() == 1 => return Err(error),
            Outcome::Skipped(name, error) => replays.skipped.push(Skipped { name, reason: error.to_string() }),
            Outcome::Interrupted => replays.interrupted = true,
        }
    }
    replays.trials.sort_by_key(|(replayed, _)| replayed.trial.index);
    replays.skipped.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(replays)
}

/// Returns the robot of the replays that a session has.
fn robot_of_replays(source: &Source, session: &Session) -> Option<RobotMeta> {
    let robot = |log: &PathBuf| last_meta::<RobotMeta>(log).ok()?;
    source.logs.iter().find_map(|(trial, _)| robot(replay_folder::all(session, trial).ok()?.first()?))
}

/// Returns what to say if the session had replays of another robot, `before`.
fn replaced(before: Option<RobotMeta>, source: &Source, session: &Session) -> Option<String> {
    let (before, after) = (before?, robot_of_replays(source, session)?);
    let (name, folder) = (&before.name, session.folder().display());
    (after != before).then(|| {
        format!("{folder} had replays of the robot {name}, which are now in {folder}/{}", replay_folder::ATTEMPTS)
    })
}

/// Returns the model and the course of a replay, and how its helix angles can be found if the result depends on them.
fn prepare(
    trial: &Trial,
    recording: &Judged,
    robot: &Option<Robot>,
    settings: &Settings,
) -> Result<(Model, Course, Option<&'static str>), TwinError> {
    let Judged { data, angles: zeroed, .. } = recording;
    data.check().map_err(|error| TwinError::unusable(data, error))?;
    let course = course(data, trial)?;
    let robot = robot.clone().map_or_else(|| data.robot().map_err(|source| TwinError::robot(data, source)), Ok)?;
    let is_known = data.records.board.as_ref().is_some_and(|board| board.angle_deg.is_some());
    let needs_phase = data.ratio().is_some()
        && !is_known
        && [Origin::Rig, Origin::Imported].contains(&data.origin())
        && robot.flagellum.phase_deg == [0.0; 2];
    let is_weighed =
        data.origin() != Origin::Imported || zeroed.budgets(&zeroed.seen_run()).iter().all(Option::is_some);
    let needs_phase = needs_phase.then_some(if is_weighed { FIT } else { STATE });
    let own = data.records.model.as_ref().map(|model| model.closure);
    let closure = settings.closure.or(own).unwrap_or(Closure::Full);
    let model = Model::new(robot, data.settings().unwrap_or_default(), closure, Method::Trial, settings.options);
    Ok((model, course, needs_phase))
}

/// Returns the course of a recorded trial for the model. The run begins with the motors, shortly after its phase.
fn course(data: &Data, trial: &Trial) -> Result<Course, TwinError> {
    let own = |(name, start_s): &(String, f64)| {
        let phase = Phase::of_name(name).filter(|phase| ![Phase::Run, Phase::End].contains(phase))?;
        Some((phase, *start_s))
    };
    let ends = [(Phase::Run, data.times.run.start), (Phase::End, data.duration_s)];
    let name = data.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let source_sha256 = data.sha256.clone().unwrap_or_default();
    Ok(Course {
        schedule: Schedule::of_phases(data.phases.iter().filter_map(own).chain(ends), trial),
        profile: speeds::profile(data)?,
        replay: Some(ReplayMeta { source: name, source_sha256 }),
    })
}

/// Returns an existing replay of the same log with the same model, if there is one.
fn cached_replay(
    session: &Session,
    trial: &Trial,
    model: &Model,
    course: &Course,
    settings: &Settings,
) -> Result<Option<(PathBuf, SteadyMeta)>, TwinError> {
    let is_same = |path: &Path| -> Result<bool, TwinError> {
        let same_source = last_meta::<ReplayMeta>(path)? == course.replay;
        let same_model = last_meta::<ModelMeta>(path)?.is_some_and(|then| {
            let now = model.meta();
            let same_output = settings.any_rate || (then.rate_hz == now.rate_hz && then.shapes == now.shapes);
            same_output && then.closure == now.closure && then.parameters == now.parameters
        });
        let same_program = last_meta::<Identity>(path)?.is_some_and(|then| program::wrote(&then));
        Ok(same_source && same_model && same_program)
    };
    for log in replay_folder::all(session, trial)? {
        if is_same(&log)?
            && let Some(steady) = last_meta::<SteadyMeta>(&log)?
        {
            return Ok(Some((replay_folder::put_first(session, trial, &log)?, steady)));
        }
    }
    Ok(None)
}
