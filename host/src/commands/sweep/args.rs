//! The arguments of `biflag sweep`.

use super::super::options::shard;
use crate::sweep::{EXAMPLE, Shard};
use std::path::PathBuf;

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
    pub action: Option<Action>,
    /// The plan: a TOML file like the one below, or the name of one inside biflag (`biflag plans`).
    #[arg(required = true)]
    pub plan: Option<PathBuf>,
    /// Compute the I-th of N parts of the points, and write no table. Shards may share a folder.
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<Shard>,
    /// Number of parallel points; by default the number of cores.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// The folder; by default named after the plan.
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Continue a sweep, skipping the points that are done.
    #[arg(long)]
    pub resume: bool,
    /// Take over the points that another sweep has, such as that of a smaller plan.
    #[arg(long, value_name = "DIR")]
    pub reuse: Option<PathBuf>,
}

#[derive(clap::Subcommand, Debug)]
pub enum Action {
    /// Write the table of a sweep whose shards are done. Points that are missing are an error.
    Merge {
        /// The folder of the sweep.
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        /// Write the table without the points that are missing.
        #[arg(long)]
        partial: bool,
    },
    /// Print the progress of a sweep: points done, missing and failed, and the time left.
    Status {
        /// The folder of the sweep.
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        /// Print why points failed: how many for each reason, and one of them.
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
pub struct SlurmArgs {
    /// The plan, in a folder that all nodes share.
    pub plan: PathBuf,
    /// Number of shards.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub shards: u32,
    /// The folder of the sweep, which all nodes share; by default named after the plan.
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Take over the points that another sweep has, such as that of a smaller plan.
    #[arg(long, value_name = "DIR")]
    pub reuse: Option<PathBuf>,
}
