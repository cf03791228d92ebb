//! A worker computes the points of a shard on several threads, then helps with other shards, and appends all results to
//! its own part.

use super::SweepError;
use super::claims::{BLOCKS, Claims};
use super::compute::Outcome;
use super::folder::Folder;
use super::part::PartWriter;
use super::point::Shard;
use super::points::Points;
use super::record::{Cost, Record};
use crate::lock::lock;
use rayon::prelude::*;
use sim::step::InversesAtRest;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use system::clock::thread_s;

/// The points that a worker computes, block by block.
struct Work<'a> {
    folder: &'a Folder,
    shard: Shard,
    /// Points that are done or already handed out.
    known: Points,
    /// Claims on its own shard; `None` if the shard contains all points, so that no other worker can help.
    claims: Option<Claims>,
    stage: Stage,
    /// Points of the block that is being handed out.
    block: std::vec::IntoIter<u32>,
}

/// The next step of a worker.
enum Stage {
    /// Start a shard: its own, or the one at this distance after it.
    Begin(u64),
    /// Take the blocks of a shard, starting with this one.
    Blocks {
        behind: u64,
        claims: Option<Claims>,
        order: Vec<u32>,
        block: usize,
    },
    /// Compute the points of its own shard that others have claimed but not finished.
    Rest,
    Ended,
}

impl<'a> Work<'a> {
    fn new(folder: &'a Folder, shard: Shard, done: &Points) -> Result<Self, SweepError> {
        let known = done.clone();
        let mut work = Self { folder, shard, known, claims: None, stage: Stage::Ended, block: Vec::new().into_iter() };
        work.begin(0)?;
        Ok(work)
    }

    /// Returns the next point to compute; `None` at the end.
    fn next(&mut self) -> Result<Option<u32>, SweepError> {
        loop {
            if let Some(index) = self.block.next() {
                return Ok(Some(index));
            }
            let points = match std::mem::replace(&mut self.stage, Stage::Ended) {
                Stage::Ended => return Ok(None),
                Stage::Begin(behind) => {
                    self.begin(behind)?;
                    continue;
                }
                Stage::Blocks { behind, claims, order, block } => {
                    if block == BLOCKS {
                        self.stage = Stage::Begin(behind + 1);
                        continue;
                    }
                    let bounds = [block, block + 1].map(|block| order.len() * block / BLOCKS);
                    let mut points = order[bounds[0]..bounds[1]].to_vec();
                    points.retain(|index| !self.known.has((*index).into()));
                    let is_free = match &claims {
                        Some(claims) if !points.is_empty() => claims.take(block)?,
                        _ => true,
                    };
                    self.stage = Stage::Blocks { behind, claims, order, block: block + 1 };
                    if is_free { points } else { continue }
                }
                Stage::Rest => {
                    self.look_again()?;
                    self.folder.dearest_first(self.shard, &self.known)
                }
            };
            for index in &points {
                self.known.add((*index).into());
            }
            self.block = points.into_iter();
        }
    }

    /// Starts its own shard, or another one if that shard's worker has started, too.
    fn begin(&mut self, behind: u64) -> Result<(), SweepError> {
        if behind == 0 {
            if self.shard != Shard::ALL {
                self.claims = Some(Claims::begin(&self.folder.path, self.shard)?);
            }
            let order = self.order(self.shard);
            self.stage = Stage::Blocks { behind, claims: self.claims.clone(), order, block: 0 };
        } else if behind == self.shard.of {
            self.stage = if self.claims.is_some() { Stage::Rest } else { Stage::Ended };
        } else {
            if behind == 1 {
                self.look_again()?;
            }
            let other = (self.shard.index + behind) % self.shard.of;
            let shard = Shard { index: other, of: self.shard.of };
            self.stage = match self.claims.as_ref().and_then(|claims| claims.of_other(other)) {
                Some(claims) if self.folder.lacks(shard, &self.known) => {
                    let order = self.order(shard);
                    Stage::Blocks { behind, claims: Some(claims), order, block: 0 }
                }
                _ => Stage::Begin(behind + 1),
            };
        }
        Ok(())
    }

    /// Returns all points of a shard, known ones too, so that a block is the same for every worker.
    fn order(&self, shard: Shard) -> Vec<u32> {
        self.folder.dearest_first(shard, &Points::none(self.folder.sweep.plan.points()))
    }

    /// Adds the points finished meanwhile.
    fn look_again(&mut self) -> Result<(), SweepError> {
        self.folder.read(|_, record| {
            self.known.add(record.index);
            Ok(())
        })?;
        Ok(())
    }
}

impl Folder {
    /// Returns the number of points of a shard.
    pub fn points(&self, shard: Shard) -> u64 {
        let points = self.sweep.plan.points();
        if shard == Shard::ALL {
            return points;
        }
        self.sweep.points_of(shard, &Points::none(points)).count() as u64
    }

    /// Returns whether a shard has unknown points.
    fn lacks(&self, shard: Shard, known: &Points) -> bool {
        self.sweep.points_of(shard, known).any(|_| true)
    }

    /// Computes the missing points of a shard, then helps with shards of other active workers, and calls `each` with
    /// every result. When it returns, the shard is complete. If `interrupted` is set, it ends early with all finished
    /// results in its part.
    ///
    /// # Errors
    /// The part cannot be written.
    pub fn work(
        &self,
        shard: Shard,
        done: &Points,
        jobs: usize,
        interrupted: &AtomicBool,
        each: &(dyn Fn(&Record) + Sync),
    ) -> Result<(), SweepError> {
        let plan = &self.sweep.plan;
        let part = Mutex::new(PartWriter::create(&self.path).map_err(SweepError::at(&self.path))?);
        let broken = Mutex::new(None);
        let goes_on = || !interrupted.load(Ordering::Relaxed) && lock(&broken).is_none();
        let breaks = |error| {
            lock(&broken).get_or_insert(error);
        };
        let at_rest = InversesAtRest::default();
        let one = |index: u32| {
            let started_s = thread_s();
            let point = self.sweep.point(index.into());
            let Some((outcome, sweeps)) = Outcome::of(&point, plan, &at_rest, &goes_on) else { return };
            let cost = Cost { processor_s: micros(thread_s() - started_s), sweeps };
            let record = Record { index: point.index, name: point.name, outcome, cost };
            each(&record);
            if let Err(error) = lock(&part).push(record) {
                breaks(SweepError::at(&self.path)(error));
            }
        };
        let work = Mutex::new(Work::new(self, shard, done)?);
        let next = || match lock(&work).next() {
            Err(error) => {
                breaks(error);
                None
            }
            Ok(index) => index,
        };
        let threads = rayon::ThreadPoolBuilder::new().num_threads(jobs).build()?;
        threads.broadcast(|_| {
            while goes_on()
                && let Some(index) = next()
            {
                one(index);
            }
        });
        let broken = broken.into_inner().unwrap_or_else(PoisonError::into_inner);
        let part = part.into_inner().unwrap_or_else(PoisonError::into_inner);
        broken.map_or_else(|| part.close().map_err(SweepError::at(&self.path)), Err)
    }
}

/// Rounds to microseconds; more digits would be noise in the table.
fn micros(seconds: f64) -> f64 {
    (1e6 * seconds).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::RobotFile;
    use crate::sweep::SweepPlan;

    /// Creates a sweep of 300 impossible, and therefore cheap, points.
    fn folder(path: &std::path::Path) -> Folder {
        let text = "[vary]\n\"group.spacing\" = { from = 0.1, to = 0.4, count = 300 }\n[speeds]\npairs = [[50, 10]]";
        let plan = SweepPlan::parse(text, "plan.toml", &|name| Ok(RobotFile::built_in(name))).unwrap();
        Folder::of_plan(path, plan).unwrap()
    }

    fn work(folder: &Folder, shard: Shard) -> u64 {
        let computed = std::sync::atomic::AtomicU64::new(0);
        let done = folder.counts(shard).unwrap().done;
        let count = |_: &Record| {
            computed.fetch_add(1, Ordering::Relaxed);
        };
        folder.work(shard, &done, 2, &AtomicBool::new(false), &count).unwrap();
        computed.into_inner()
    }

    /// The worker of the first shard dies in its first block. The other worker computes the rest, and no point is
    /// computed twice.
    #[test]
    fn idle_workers_help_and_a_dead_one_costs_its_block() {
        let path = tempfile::tempdir().unwrap();
        let folder = folder(path.path());
        let [one, two] = [0, 1].map(|index| Shard { index, of: 2 });
        let points = [one, two].map(|shard| folder.points(shard));
        let first = points[0] / BLOCKS as u64;
        assert!(Claims::begin(&folder.path, one).unwrap().take(0).unwrap());
        assert_eq!(work(&folder, two), 300 - first);
        assert_eq!(folder.counts(one).unwrap().done.count(), points[0] - first);
        assert_eq!(work(&folder, one), first, "begun again");
        let mut records = 0;
        folder
            .read(|_, _| {
                records += 1;
                Ok(())
            })
            .unwrap();
        assert_eq!(records, 300);
    }

    /// A shard that no worker has started may be computed in another folder.
    #[test]
    fn shards_that_nobody_has_begun_are_left_alone() {
        let path = tempfile::tempdir().unwrap();
        let folder = folder(path.path());
        let shard = Shard { index: 2, of: 3 };
        assert_eq!(work(&folder, shard), folder.points(shard));
        assert_eq!(folder.counts(Shard::ALL).unwrap().done.count(), folder.points(shard));
    }

    /// A worker does not wait for a helper with an unfinished block.
    #[test]
    fn a_shard_is_done_when_its_worker_ends() {
        let path = tempfile::tempdir().unwrap();
        let folder = folder(path.path());
        let [one, two] = [0, 1].map(|index| Shard { index, of: 2 });
        let mut worker = Work::new(&folder, one, &folder.counts(one).unwrap().done).unwrap();
        let helper = Claims::begin(&folder.path, two).unwrap().of_other(0).unwrap();
        assert!(helper.take(7).unwrap());
        let mut handed = std::collections::BTreeSet::new();
        while let Some(index) = worker.next().unwrap() {
            assert!(handed.insert(index), "{index} twice");
        }
        assert_eq!(handed.len(), 300, "its own shard, block 7 last, and that of the other worker, which does nothing");
    }
}
