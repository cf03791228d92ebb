//! Sweeps: one table of steady states over speeds, parameters of the robot and groups.
//!
//! A [`SweepPlan`] defines what varies. Its points are not stored: each follows from its index ([`Sweep::point`]) and
//! is named by a hash of everything that it depends on. Workers compute shards of the points, chosen by these names,
//! and append results to parts in a [`Folder`], which are merged into one table, in Parquet and CSV.
//! `host/book/src/sweep.md` describes the columns, and how to run the shards on a cluster.

mod axis;
mod buckets;
mod claims;
mod clock;
mod compute;
mod design;
mod error;
mod folder;
mod key;
mod manifest;
mod merge;
mod part;
mod plan;
mod point;
mod read;
mod results;
mod reuse;
mod slurm;
mod sobol;
mod status;
mod table;
mod vary;
mod worker;

pub use axis::{Axis, Range, Scale, Values};
pub use compute::{Cost, Origin, Outcome, Record, Steady};
pub use design::{Design, MAX_POINTS};
pub use error::SweepError;
pub use folder::{Counts, Folder, Parts};
pub use key::{Group, Key};
pub use merge::{Merged, Missing};
pub use plan::{EXAMPLE, SweepPlan};
pub use point::{Name, Point, Points, Shard, Sweep};
pub use read::{columns_of, of_csv, read_table};
pub use results::RESULTS;
pub use slurm::script;
pub use status::{Reason, ShardCounts};
pub use table::{ROBOT, VARIES};

use std::path::{Path, PathBuf};

/// Returns whether a folder contains a sweep.
pub fn is_folder(path: &Path) -> bool {
    crate::plan::error::is_sweep(path)
}

/// Returns the path of the table in a sweep's folder, as Parquet.
pub fn parquet_path(folder: &Path) -> PathBuf {
    folder.join("table.parquet")
}

/// Returns the path of the same table as CSV.
pub fn csv_path(folder: &Path) -> PathBuf {
    folder.join("table.csv")
}

/// Returns the path of the table of each point's cost, as CSV.
pub fn cost_path(folder: &Path) -> PathBuf {
    folder.join("cost.csv")
}
