//! The folder of a sweep.
//!
//! ```text
//! softer/
//!   sweep.toml       the plan, the robot, and the version of the results, see [`super::manifest`]
//!   part-*           results of the workers, see [`super::part`]
//!   table.parquet    all points, once merged
//!   table.csv        the same
//!   cost.csv         what each point cost, and where it was computed
//! ```
//!
//! Any number of workers, on any computers, can write into one folder; each writes its own part. Parts can also be
//! written into separate folders and copied into one.

use super::clock::now_s;
use super::compute::{Origin, Outcome, Record};
use super::manifest::{self, Manifest};
use super::part::{self, PartReader};
use super::point::{Points, Shard, Sweep};
use super::{RESULTS, SweepError, SweepPlan};
use crate::plan::RobotFile;
use sim::steady::Kind;
use std::path::{Path, PathBuf};

/// The folder of a sweep.
#[derive(Clone, Debug)]
pub struct Folder {
    /// The folder.
    pub path: PathBuf,
    /// Its sweep.
    pub sweep: Sweep,
}

/// State of a sweep, from its parts.
#[derive(Clone, PartialEq, Debug)]
pub struct Counts {
    /// The finished points, including failed ones.
    pub done: Points,
    /// The failed points.
    pub failed: Points,
    /// The points whose means are not known.
    pub not_found: Points,
    /// State of the parts.
    pub parts: Parts,
}

/// State of the parts, found while reading their points.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Parts {
    /// Points per second of the active workers; `None` if there are none, or none has finished a point.
    pub rate: Option<f64>,
    /// Closed parts that are cut off or damaged.
    pub damaged: Vec<PathBuf>,
}

impl Counts {
    /// Adds the result of a point; returns whether the point is new.
    pub fn add(&mut self, index: u64, outcome: &Outcome) -> bool {
        let is_new = self.done.add(index);
        if is_new && outcome.is_err() {
            self.failed.add(index);
        }
        if is_new && outcome.as_ref().is_ok_and(|steady| steady.kind == Kind::NotFound) {
            self.not_found.add(index);
        }
        is_new
    }
}

impl Folder {
    /// Opens the folder of a plan, or creates it.
    ///
    /// # Errors
    /// [`SweepError::Other`] if the folder has the sweep of another plan, or of another version of the results.
    pub fn of_plan(path: &Path, plan: SweepPlan) -> Result<Self, SweepError> {
        let RobotFile { name: robot_name, text: robot } = plan.robot.clone();
        Manifest { results: RESULTS, robot_name, robot, plan: plan.text.clone() }.put_into(path)?;
        Ok(Self { path: path.to_owned(), sweep: Sweep::new(plan, RESULTS)? })
    }

    /// Opens the folder of a sweep, perhaps of another version of the results.
    ///
    /// # Errors
    /// [`SweepError::NotASweep`], [`SweepError::Manifest`].
    pub fn open(path: &Path) -> Result<Self, SweepError> {
        let Manifest { results, robot_name, robot, plan } = Manifest::read(path)?;
        let robot = RobotFile { name: robot_name, text: robot };
        let name = manifest::path(path).display().to_string();
        let plan = SweepPlan::parse(&plan, &name, &|_| Ok(robot.clone()))?;
        Ok(Self { path: path.to_owned(), sweep: Sweep::new(plan, results)? })
    }

    /// Calls `with` for every result of this sweep, in no particular order; a point may occur several times.
    ///
    /// # Errors
    /// If a part cannot be read, and the errors of `with`.
    pub fn read(&self, mut with: impl FnMut(&Origin, Record) -> Result<(), SweepError>) -> Result<Parts, SweepError> {
        let mut parts = Parts::default();
        let now_s = now_s(&self.path);
        for path in part::parts(&self.path).map_err(SweepError::at(&self.path))? {
            let Some(mut reader) = PartReader::of_listed(&path).map_err(SweepError::of_part(&path))? else { continue };
            while let Some(record) = reader.next().map_err(SweepError::at(&path))? {
                if self.has(&record) {
                    with(&reader.origin, record)?;
                }
            }
            if let Some(rate) = reader.rate(now_s).map_err(SweepError::at(&path))? {
                *parts.rate.get_or_insert(0.0) += rate;
            }
            if reader.is_damaged() {
                parts.damaged.push(path);
            }
        }
        Ok(parts)
    }

    /// Returns whether a result belongs to this sweep: parts of other sweeps may have been copied here.
    fn has(&self, record: &Record) -> bool {
        record.index < self.sweep.plan.points() && self.sweep.name(record.index) == record.name
    }

    /// Reads the progress of a shard.
    ///
    /// # Errors
    /// A part cannot be read.
    pub fn counts(&self, shard: Shard) -> Result<Counts, SweepError> {
        let none = Points::none(self.sweep.plan.points());
        let mut counts = Counts { done: none.clone(), failed: none.clone(), not_found: none, parts: Parts::default() };
        counts.parts = self.read(|_, record| {
            if shard.has(&record.name) {
                counts.add(record.index, &record.outcome);
            }
            Ok(())
        })?;
        Ok(counts)
    }
}
