//! `biflag sweep`: computes many points into one table.

mod output;
mod progress;

use super::answer::{Answer, Outcome, wrong_use};
use super::options::{cores, shard};
use crate::session;
use crate::signals::interruption;
use crate::sweep::{self, Counts, EXAMPLE, Folder, Missing, Shard, SweepError, SweepPlan};
use crate::text::count;
use miette::{IntoDiagnostic, WrapErr};
use output::{Failed, Status, Swept};
use progress::Counter;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Compute a table of steady states over speeds, robot parameters and dimensionless groups.
#[derive(clap::Args, Debug)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = format!(
        "Examples:\n  \
        biflag sweep groups --out groups-of-robots\n  \
        biflag sweep plan.toml --shard 1/3 --out softer; biflag sweep merge softer\n\
        The table (table.parquet and table.csv in the folder) has one row per point. It does not depend on --jobs, \
        --shard or interruptions. The book describes its columns and how to use a cluster (host/book/src/sweep.md).\n\n\
        A plan:\n\n{EXAMPLE}"
    )
)]
pub struct Args {
    #[command(subcommand)]
    action: Option<Action>,
    /// The plan: a TOML file like the one below, or the name of one inside biflag (`biflag plans`).
    #[arg(required = true)]
    plan: Option<PathBuf>,
    /// Compute the I-th of N parts of the points, and write no table. Shards may share a folder.
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    /// Number of parallel points; by default the number of cores.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// The folder; by default named after the plan.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Continue a sweep, skipping the points that are done.
    #[arg(long)]
    resume: bool,
    /// Take over the points that another sweep has, such as that of a smaller plan.
    #[arg(long, value_name = "DIR")]
    reuse: Option<PathBuf>,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Write the table of a sweep whose shards are done. Missing points are an error.
    Merge {
        /// The folder of the sweep.
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        /// Write the table without the missing points.
        #[arg(long)]
        partial: bool,
    },
    /// Print the progress of a sweep: points done, missing and failed, and the time left.
    Status {
        /// The folder of the sweep.
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        /// Print why points failed: their number for each reason, and one of them.
        #[arg(long)]
        failed: bool,
        /// Print the progress of each of N shards.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
        shards: Option<u32>,
    },
    /// Print a script that runs a sweep on a cluster with Slurm: a job array over the shards, then the merge.
    Slurm(SlurmArgs),
}

#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag sweep slurm plan.toml --shards 64 > sweep.sh; bash sweep.sh")]
struct SlurmArgs {
    /// The plan, in a folder that all nodes share.
    plan: PathBuf,
    /// Number of shards.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    shards: u32,
    /// The folder of the sweep, which all nodes share; by default named after the plan.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Take over the points that another sweep has, such as that of a smaller plan.
    #[arg(long, value_name = "DIR")]
    reuse: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    match (&args.action, &args.plan) {
        (Some(Action::Merge { folder, partial }), _) => {
            merge(folder, if *partial { Missing::LeftOut } else { Missing::Refused })
        }
        (Some(Action::Status { folder, failed, shards }), _) => status(folder, *failed, *shards),
        (Some(Action::Slurm(args)), _) => slurm(args),
        (None, Some(plan)) => compute(args, plan),
        (None, None) => Err(wrong_use("no plan is given", "see biflag sweep --help")),
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
    folder.work(shard, &before.done, jobs, &interrupted, &|record| counter.count(record))?;
    counter.finish();
    // Other workers may have helped.
    let after = folder.counts(shard)?;
    let (done, failed) = (after.done.count(), after.failed.count());
    let missing = points - done;
    let swept = Swept { points, done, missing, failed, notes: folder.sweep.notes(), ..Swept::default() };
    if interrupted.load(Ordering::Relaxed) && done < points {
        let points = count(points as usize, "point");
        let text = format!("{}: interrupted after {done} of {points}, go on with --resume", path.display());
        return Answer::new(Outcome::Interrupted, &swept, text);
    }
    if args.shard.is_some() { swept.answer(&path) } else { merge(&path, Missing::Refused) }
}

fn merge(path: &Path, missing: Missing) -> miette::Result<Answer> {
    let folder = Folder::open(path)?;
    let (merged, counts) = (folder.merge(missing)?, folder.counts(Shard::ALL)?);
    let mut swept = swept(&folder, &counts);
    if merged.different > 0 {
        let points = count(merged.different as usize, "point");
        swept.warnings.push(format!("{points} computed twice with different results, which is an error: one is kept"));
    }
    swept.answer(path)
}

fn status(path: &Path, failed: bool, shards: Option<u32>) -> miette::Result<Answer> {
    let folder = Folder::open(path)?;
    let counts = folder.counts(Shard::ALL)?;
    let swept = swept(&folder, &counts);
    let missing = swept.missing as f64;
    let time_left_s = if missing == 0.0 { Some(0.0) } else { counts.parts.rate.map(|rate| missing / rate) };
    let reasons = if failed { Some(folder.reasons()?) } else { None };
    let reasons = reasons.map(|all| all.into_iter().map(|reason| Failed::new(reason, &folder.sweep)).collect());
    let shards = shards.map(|of| folder.shards(of.into(), &counts));
    Status { swept, time_left_s, reasons, shards }.answer(path)
}

/// Returns how much of a sweep is done, and which of its tables are written.
fn swept(folder: &Folder, counts: &Counts) -> Swept {
    let written = |file: PathBuf| file.exists().then(|| file.display().to_string());
    let (points, done) = (folder.sweep.plan.points(), counts.done.count());
    let missing = points - done;
    // Points lost with a part may have been computed again.
    let damaged = counts.parts.damaged.iter().filter(|_| missing > 0);
    let warning = |part: &PathBuf| format!("{}: cut off or damaged, its remaining points are missing", part.display());
    Swept {
        table: written(sweep::parquet_path(&folder.path)),
        csv: written(sweep::csv_path(&folder.path)),
        cost: written(sweep::cost_path(&folder.path)),
        points,
        done,
        missing,
        failed: counts.failed.count(),
        warnings: damaged.map(warning).collect(),
        notes: folder.sweep.notes().into_iter().chain(folder.sweep.note_on_not_found(&counts.not_found)).collect(),
    }
}

fn slurm(args: &SlurmArgs) -> miette::Result<Answer> {
    let plan = SweepPlan::load(&args.plan)?;
    let folder = args.out.clone().unwrap_or_else(|| session::folder_named(&plan.name));
    let absolute = |path: &Path| std::path::absolute(path).into_diagnostic().wrap_err("the current folder");
    let program: PathBuf = std::env::current_exe().into_diagnostic().wrap_err("the path of this program")?;
    // A plan that is not a file is inside the program.
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
