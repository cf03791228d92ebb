//! The folder of a sweep.
//!
//! ```text
//! softer/
//!   sweep.toml       the plan, the robot, and the version of the model
//!   part-*.part      results of the workers, see [`super::part`]
//!   table.parquet    all points, once merged
//!   table.csv        the same
//! ```
//!
//! Any number of workers, on any computers, can write into one folder; each writes its own part. Parts can also be
//! written into separate folders and copied into one.

use super::part::{self, PartReader, Record};
use super::point::{Name, Shard, Sweep};
use super::{SweepError, SweepPlan};
use crate::plan::RobotFile;
use crate::program;
use biflag_log::atomic_file;
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Name of the manifest.
const MANIFEST: &str = "sweep.toml";

/// The folder of a sweep.
#[derive(Clone, Debug)]
pub struct Folder {
    /// The folder.
    pub path: PathBuf,
    /// Its sweep.
    pub sweep: Sweep,
}

#[derive(Serialize, Deserialize, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
struct Manifest {
    /// Version of the program that computes the points.
    model: String,
    /// Name of the robot or of its file.
    robot_name: String,
    /// Text of the robot's file; empty for a built-in robot.
    robot: String,
    /// Text of the plan's file.
    plan: String,
}

/// Points of a plan, one bit each.
#[derive(Clone, PartialEq, Debug)]
pub struct Points {
    bits: Vec<u64>,
    count: u64,
}

impl Points {
    /// Returns the empty set for a plan with this many points.
    pub fn none(of: u64) -> Self {
        Self { bits: vec![0; of.div_ceil(64) as usize], count: 0 }
    }

    /// Returns whether the set contains a point.
    pub fn has(&self, index: u64) -> bool {
        self.bits.get((index / 64) as usize).is_some_and(|word| word >> (index % 64) & 1 == 1)
    }

    /// Adds a point of the plan; returns whether it is new.
    pub fn add(&mut self, index: u64) -> bool {
        let is_new = !self.has(index);
        self.bits[(index / 64) as usize] |= 1 << (index % 64);
        self.count += u64::from(is_new);
        is_new
    }

    /// Returns how many there are.
    pub fn count(&self) -> u64 {
        self.count
    }
}

/// State of a sweep, from its parts.
#[derive(Clone, PartialEq, Debug)]
pub struct Counts {
    /// The points that are done, failed ones too.
    pub done: Points,
    /// How many of them failed.
    pub failed: u64,
    /// Points a second of the workers that are at work; `None` if there are none, or none has finished a point.
    pub rate: Option<f64>,
    /// Closed parts that are cut off or damaged.
    pub damaged: Vec<PathBuf>,
}

/// Returns the version of the model in this program.
pub fn model() -> String {
    format!("{} {}", program::VERSION, program::GIT_HASH)
}

impl Folder {
    /// Opens the folder of a plan, or makes it.
    ///
    /// # Errors
    /// [`SweepError::Other`] if it has the sweep of another plan or program.
    pub fn of_plan(path: &Path, plan: SweepPlan) -> Result<Self, SweepError> {
        let manifest = Manifest {
            model: model(),
            robot_name: plan.robot.name.clone(),
            robot: plan.robot.text.clone(),
            plan: plan.text.clone(),
        };
        std::fs::create_dir_all(path).map_err(SweepError::at(path))?;
        let file = path.join(MANIFEST);
        if !file.exists() {
            let text = toml::to_string(&manifest)
                .map_err(|error| SweepError::Manifest { path: file.clone(), reason: error.to_string() })?;
            match atomic_file::create(&file, &text) {
                // Another worker has just made it.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                other => other.map_err(SweepError::at(&file))?,
            }
        }
        let found = Manifest::read(path)?;
        let differs = |difference| Err(SweepError::Other { folder: path.to_owned(), difference });
        if found.plan != manifest.plan {
            return differs("plan");
        } else if (found.robot_name, found.robot) != (manifest.robot_name, manifest.robot) {
            return differs("robot");
        } else if found.model != manifest.model {
            return differs("version of biflag");
        }
        Ok(Self { path: path.to_owned(), sweep: Sweep::new(plan, manifest.model)? })
    }

    /// Opens the folder of a sweep, perhaps of another version of the program.
    ///
    /// # Errors
    /// [`SweepError::NotASweep`], [`SweepError::Manifest`].
    pub fn open(path: &Path) -> Result<Self, SweepError> {
        let Manifest { model, robot_name, robot, plan } = Manifest::read(path)?;
        let robot = RobotFile { name: robot_name, text: robot };
        let name = path.join(MANIFEST).display().to_string();
        let plan = SweepPlan::parse(&plan, &name, &|_| Ok(robot.clone()))?;
        Ok(Self { path: path.to_owned(), sweep: Sweep::new(plan, model)? })
    }

    /// Calls `with` for every result of this sweep whose name is wanted, in no particular order; a point may occur
    /// several times. Returns closed parts that are cut off or damaged.
    ///
    /// # Errors
    /// A part cannot be read.
    pub fn read(
        &self,
        wanted: impl Fn(&Name) -> bool,
        mut with: impl FnMut(Record),
    ) -> Result<Vec<PathBuf>, SweepError> {
        let mut damaged = Vec::new();
        for path in part::parts(&self.path).map_err(SweepError::at(&self.path))? {
            let mut reader = match PartReader::open(&path) {
                // Its worker has just closed it.
                Err(error) if error.kind() == ErrorKind::NotFound => PartReader::open(&path.with_extension("part")),
                other => other,
            }
            .map_err(SweepError::at(&path))?;
            while let Some(record) = reader.next().map_err(SweepError::at(&path))? {
                if wanted(&record.name) && self.has(&record) {
                    with(record);
                }
            }
            if reader.is_damaged() {
                damaged.push(path);
            }
        }
        Ok(damaged)
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
        let (mut done, mut failed) = (Points::none(self.sweep.plan.points()), 0);
        let damaged = self.read(
            |name| shard.has(name),
            |record| {
                if done.add(record.index) {
                    failed += u64::from(record.outcome.is_failed());
                }
            },
        )?;
        Ok(Counts { done, failed, rate: self.rate()?, damaged })
    }

    /// Returns the points a second of all workers that are at work.
    fn rate(&self) -> Result<Option<f64>, SweepError> {
        let mut rate = 0.0;
        for path in part::parts(&self.path).map_err(SweepError::at(&self.path))? {
            // A part that is gone was closed.
            let (true, Ok(mut reader)) = (part::is_active(&path), PartReader::open(&path)) else { continue };
            let last = path.metadata().and_then(|meta| meta.modified()).ok();
            let last = last.and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok());
            let started = std::time::Duration::from_secs(reader.started_s);
            let mut points = 0.0;
            while reader.next().map_err(SweepError::at(&path))?.is_some() {
                points += 1.0;
            }
            // The clock of the start counts whole seconds.
            let seconds = last.map_or(0.0, |last| last.saturating_sub(started).as_secs_f64()).max(1.0);
            rate += points / seconds;
        }
        Ok(Some(rate).filter(|rate| *rate > 0.0))
    }
}

impl Manifest {
    fn read(folder: &Path) -> Result<Self, SweepError> {
        let path = folder.join(MANIFEST);
        let text = match std::fs::read_to_string(&path) {
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                return Err(SweepError::NotASweep { folder: folder.to_owned() });
            }
            other => other.map_err(SweepError::at(&path))?,
        };
        toml::from_str(&text).map_err(|error| SweepError::Manifest { path, reason: error.message().replace('\n', " ") })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_counted_once() {
        let mut points = Points::none(130);
        assert!(points.add(0) && points.add(129) && !points.add(129));
        assert_eq!((points.count(), points.has(129), points.has(128), points.has(4000)), (2, true, false, false));
    }
}
