//! `biflag sweep`: computes many points into one table.

mod args;
mod output;
mod progress;

pub use args::Args;

use super::answer::{Answer, Outcome};
use super::options::cores;
use crate::session;
use crate::signals::interruption;
use crate::sweep::{self, Folder, Missing, Shard, SweepError, SweepPlan};
use crate::text::count;
use args::{Action, SlurmArgs};
use miette::{IntoDiagnostic, WrapErr};
use output::{Failed, ShardStatus, Status, Swept};
use progress::Counter;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

pub fn run(args: &Args) -> miette::Result<Answer> {
    match (&args.action, &args.plan) {
        (Some(Action::Merge { folder, partial }), _) => {
            merge(folder, if *partial { Missing::LeftOut } else { Missing::Refused })
        }
        (Some(Action::Status { folder, failed, shards }), _) => status(folder, *failed, *shards),
        (Some(Action::Slurm(args)), _) => slurm(args),
        (None, Some(plan)) => compute(args, plan),
        (None, None) => {
            Err(miette::miette!(code = super::answer::WRONG_USE, help = "see biflag sweep --help", "no plan is given"))
        }
    }
}

fn compute(args: &Args, plan: &Path) -> miette::Result<Answer> {
    let interrupted = interruption()?;
    let plan = SweepPlan::load(plan)?;
    let path = args.out.clone().unwrap_or_else(|| session::folder_named(&plan.name));
    let folder = Folder::of_plan(&path, plan)?;
    let shard = args.shard.unwrap_or(Shard::ALL);
    let mut before = folder.counts(shard)?;
    if before.done.count() > 0 && !args.resume {
        return Err(SweepError::Exists { folder: path }.into());
    }
    if let Some(other) = &args.reuse {
        folder.reuse(other, shard, &mut before)?;
    }
    let points = folder.points(shard);
    let counter = Counter::new(&folder.sweep.plan.name, shard, points, &before);
    let jobs = args.jobs.map_or_else(cores, usize::from);
    let worked = folder.work(shard, &before.done, jobs, &interrupted, &|record| counter.count(record));
    counter.finish();
    worked?;
    // Other workers may have helped.
    let after = folder.counts(shard)?;
    let (done, failed) = (after.done.count(), after.failed.count());
    let swept = Swept {
        table: None,
        csv: None,
        cost: None,
        points,
        done,
        missing: points - done,
        failed,
        warnings: Vec::new(),
        notes: folder.sweep.notes(),
    };
    if interrupted.load(Ordering::Relaxed) && done < points {
        let text = format!(
            "{}: interrupted after {done} of {}, go on with --resume",
            path.display(),
            count(points as usize, "point")
        );
        return Answer::new(Outcome::Interrupted, &swept, text);
    }
    match args.shard {
        Some(_) => swept.answer(&path),
        None => merge(&path, Missing::Refused),
    }
}

fn merge(path: &Path, missing: Missing) -> miette::Result<Answer> {
    let folder = Folder::open(path)?;
    let merged = folder.merge(missing)?;
    let points = folder.sweep.plan.points();
    // What was lost with a part may have been computed again.
    let is_whole = merged.done == points;
    let mut warnings: Vec<_> = merged.damaged.iter().filter(|_| !is_whole).map(|part| damaged(part)).collect();
    if merged.different > 0 {
        let points = count(merged.different as usize, "point");
        warnings.push(format!("{points} computed twice with different results, which is an error: one is kept"));
    }
    let swept = Swept {
        table: Some(shown(&sweep::parquet_path(path))),
        csv: Some(shown(&sweep::csv_path(path))),
        cost: Some(shown(&sweep::cost_path(path))),
        points,
        done: merged.done,
        missing: points - merged.done,
        failed: merged.failed,
        warnings,
        notes: folder.sweep.notes().into_iter().chain(not_found(merged.not_found)).collect(),
    };
    swept.answer(path)
}

fn status(path: &Path, failed: bool, shards: Option<u32>) -> miette::Result<Answer> {
    let folder = Folder::open(path)?;
    let counts = folder.counts(Shard::ALL)?;
    let (points, done) = (folder.sweep.plan.points(), counts.done.count());
    let written = |file: PathBuf| file.exists().then(|| shown(&file));
    let missing = points - done;
    let swept = Swept {
        table: written(sweep::parquet_path(path)),
        csv: written(sweep::csv_path(path)),
        cost: written(sweep::cost_path(path)),
        points,
        done,
        missing,
        failed: counts.failed.count(),
        warnings: counts.parts.damaged.iter().filter(|_| missing > 0).map(|part| damaged(part)).collect(),
        notes: folder.sweep.notes(),
    };
    let time_left_s = if missing == 0 { Some(0.0) } else { counts.parts.rate.map(|rate| missing as f64 / rate) };
    let reasons = if failed { Some(folder.reasons()?) } else { None };
    let reasons = reasons.map(|all| all.into_iter().map(|reason| Failed::new(reason, &folder.sweep)).collect());
    let shards =
        shards.map(|of| folder.shards(of.into(), &counts).into_iter().zip(1..).map(ShardStatus::from).collect());
    let status = Status { swept, time_left_s, reasons, shards };
    Answer::new(Outcome::Done, &status, status.text(path))
}

fn not_found(points: u64) -> Option<String> {
    let what = "of which no steady state was found in `run` seconds: their means are not known (`kind`)";
    (points > 0).then(|| format!("{}, {what}", count(points as usize, "point")))
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn damaged(part: &Path) -> String {
    format!("{}: cut off or damaged, its remaining points are missing", part.display())
}

fn slurm(args: &SlurmArgs) -> miette::Result<Answer> {
    let plan = SweepPlan::load(&args.plan)?;
    let folder = args.out.clone().unwrap_or_else(|| session::folder_named(&plan.name));
    let absolute = |path: &Path| std::path::absolute(path).into_diagnostic().wrap_err("the current folder");
    let program: PathBuf = std::env::current_exe().into_diagnostic().wrap_err("the path of this program")?;
    // A plan that is no file is inside the program.
    let file = if args.plan.exists() { absolute(&args.plan)? } else { args.plan.clone() };
    let folder = absolute(&folder)?;
    let script = sweep::script(&program, &file, &folder, args.shards.into(), &plan.name);
    // The shards find their manifest, and a folder of another sweep is refused before anything is submitted.
    let folder = Folder::of_plan(&folder, plan)?;
    if let Some(other) = &args.reuse {
        folder.reuse(other, Shard::ALL, &mut folder.counts(Shard::ALL)?)?;
    }
    Answer::new(Outcome::Done, &serde_json::json!({ "script": script }), script)
}
