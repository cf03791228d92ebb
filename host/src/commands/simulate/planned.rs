//! `biflag simulate PLAN`: simulates the trials of a plan, or one pair of speeds.

use super::super::answer::{Answer, WRONG_USE, wrong_use};
use super::super::options::cores;
use super::Args;
use super::output::{Row, Simulated, SimulatedTrial, ended};
use crate::plan::{Plan, Trial, note_on_grid, robot};
use crate::progress::Progress;
use crate::run::model::{Batch, Course, Job, Model, ModelError, note_on_phases};
use crate::session::{self, Session, SessionError, Sharing};
use crate::signals::interruption;
use crate::sweep::Shard;
use crate::{program, text};
use biflag_log::{Identity, Method, ModelMeta, Origin, last_meta};
use sim::trial::Options;
use std::path::Path;
use std::time::Instant;

pub fn run(args: &Args) -> miette::Result<Answer> {
    let begun = Instant::now();
    let interrupted = interruption()?;
    let plan = plan(args)?;
    let options = Options { rate_hz: args.rate, shapes: args.shapes };
    let model = Model::of_plan(&plan, args.closure.unwrap_or_default(), options)?;
    let Shard { index, of } = args.shard.unwrap_or(Shard::ALL);
    let mine: Vec<&Trial> = plan.trials.iter().skip(index as usize).step_by(of as usize).collect();
    let folder = args.out.clone().unwrap_or_else(|| session::folder_named(&plan.name));
    let session = open(&folder, &plan, &mine, args)?;

    let _lock = session.lock(if args.shard.is_some() { Sharing::WithShards } else { Sharing::Alone })?;
    session.expect_same_rig(&session.states()?, Origin::Model, None, None)?;
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
    progress.phase(&text::count(count, "trial"), &format!("{jobs} at a time"));
    let work = |trial| Ok(Job { trial, course: Course::planned(trial)?, model: &model, plan: session.plan() });
    let work: Vec<_> = todo.into_iter().map(work).collect::<Result<_, ModelError>>()?;
    let batch = Batch::new(&session, &progress, &interrupted);
    let runs = batch.run(&work, jobs, &|run| SimulatedTrial::from(run).to_string())?;
    progress.finish();

    let is_cut = runs.len() < count;
    trials.extend(runs.iter().map(SimulatedTrial::from));
    trials.sort_by(|a, b| a.name.cmp(&b.name));
    let (outcome, real_time_factor, computed) = ended("computed", begun, &trials, is_cut, true);
    let trials = Row::of(session.plan(), trials);
    let means = trials.iter().filter_map(Row::mean);
    let notes: Vec<_> =
        note_on_phases(&session.plan().trials, means).into_iter().chain(note_on_grid(&session.plan().text)).collect();
    let mut text: String = trials.iter().filter_map(Row::mean).map(|mean| format!("{mean}\n")).collect();
    text += &format!("session {}: {computed}", folder.display());
    text.extend(notes.iter().map(|note| format!("\nnote: {note}")));
    Answer::new(outcome, &Simulated { session: folder, real_time_factor, trials, notes }, text)
}

/// Returns the plan, or one made from the speeds, with the robot named by the user.
fn plan(args: &Args) -> miette::Result<Plan> {
    let mut plan = match (&args.plan, args.speeds, args.duration) {
        (Some(path), ..) => Plan::load(path)?,
        (None, Some(speeds), Some(run)) => {
            let (phase, suffix) = args.phase.map_or_else(Default::default, |[one, two]| {
                (format!("\nphase_deg = [{one}, {two}]"), format!("_p{one}_{two}"))
            });
            let trial = format!("calibrate = 0\npreroll = 0\nrun = {run}\ndecay = 0{phase}");
            Plan::of_speeds(speeds, &trial, &suffix)?
        }
        _ => return Err(miette::miette!(code = WRONG_USE, "give a plan or --speeds")),
    };
    if let Some(path) = &args.robot {
        plan.robot = robot::load(path)?;
    }
    if let Some(method) = args.method {
        plan.method = method;
    }
    if plan.method == Method::Steady && plan.trials.iter().any(|trial| trial.reverse.is_some()) {
        let help = "leave out --method, or remove reverse from the plan";
        return Err(wrong_use("the method `steady` cannot compute a reversal", help));
    }
    Ok(plan)
}

/// Starts the session, or continues it with `--resume`. Shards of a plan share a session, so each of them opens it, but
/// a shard skips complete trials of its own only with `--resume`.
fn open(folder: &Path, plan: &Plan, mine: &[&Trial], args: &Args) -> miette::Result<Session> {
    if !args.resume && args.shard.is_none() {
        return Ok(Session::create(folder, plan)?);
    }
    let session = match Session::resume(folder, plan) {
        // Another shard has just created it.
        Err(SessionError::Exists { .. }) => Session::resume(folder, plan)?,
        other => other?,
    };
    if !args.resume {
        for trial in mine {
            if !session.state(trial)?.attempts.is_empty() {
                return Err(SessionError::Exists { folder: folder.to_owned(), what: "a session" }.into());
            }
        }
    }
    Ok(session)
}

/// Returns a trial that was computed by an earlier run of the same model.
fn computed_before(trial: &Trial, log: &Path, model: &Model) -> miette::Result<SimulatedTrial> {
    let differs = |how: &str| {
        let help = "name another folder with --out, or continue as the session began";
        Err(wrong_use(format!("{}: {how}", log.display()), help))
    };
    if !last_meta::<Identity>(log)?.is_some_and(|identity| program::wrote(&identity)) {
        return differs("computed by another version of biflag");
    }
    match last_meta::<ModelMeta>(log)? {
        Some(meta) if meta == *model.meta() => {
            Ok(SimulatedTrial { steady: last_meta(log)?, ..SimulatedTrial::new(trial, log) })
        }
        Some(meta) => differs(&format!("computed with {}", difference(&meta, model.meta()))),
        None => differs("was not computed by the model"),
    }
}

/// Describes the difference between the model of a log and the current one.
fn difference(then: &ModelMeta, now: &ModelMeta) -> String {
    if then.closure != now.closure {
        format!("the closure {}", text::word(&then.closure))
    } else if then.method != now.method {
        format!("the method {}", text::word(&then.method))
    } else if then.rate_hz != now.rate_hz {
        format!("{} samples per second", then.rate_hz)
    } else if then.shapes != now.shapes {
        format!("{}shapes", if then.shapes { "" } else { "no " })
    } else {
        "other parameters of the robot".to_owned()
    }
}
