//! A worker computes the points of a shard on several threads, then helps with other shards, and appends all results to
//! its own part.

use super::SweepError;
use super::claims::{BLOCKS, Claims};
use super::compute::{Cost, Record, compute};
use super::folder::Folder;
use super::part::PartWriter;
use super::point::{Points, Shard, phases};
use crate::lock::lock;
use biflag_log::Method;
use rayon::prelude::*;
use sim::steady::effort;
use sim::step::InversesAtRest;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::sync::{Mutex, PoisonError};
use system::clock::thread_s;

/// The points that a worker computes, one after the other.
struct Work<'a> {
    folder: &'a Folder,
    /// Points that are done or already handed out.
    known: Points,
    /// Takes a point; returns false to end the work.
    take: &'a mut dyn FnMut(u32) -> bool,
}

impl Work<'_> {
    /// Hands out the points of a shard, then points of other shards whose workers have started, and finally the shard's own
    /// points that others have claimed but not finished.
    fn hand_out(&mut self, shard: Shard) -> Result<(), SweepError> {
        if shard == Shard::ALL {
            // No other worker can help.
            return self.blocks(shard, None).map(drop);
        }
        let claims = Claims::begin(&self.folder.path, shard)?;
        let mut goes_on = self.blocks(shard, Some(&claims))?;
        self.look_again()?;
        for behind in 1..shard.of {
            let other = Shard { index: (shard.index + behind) % shard.of, of: shard.of };
            if goes_on
                && let Some(claims) = claims.of_other(other.index)
                && self.folder.sweep.points_of(other, &self.known).any(|_| true)
            {
                goes_on = self.blocks(other, Some(&claims))?;
            }
        }
        if goes_on {
            self.look_again()?;
            let rest = self.folder.dearest_first(shard, &self.known);
            self.points(&rest);
        }
        Ok(())
    }

    /// Hands out the free blocks of a shard; returns whether the work goes on.
    fn blocks(&mut self, shard: Shard, claims: Option<&Claims>) -> Result<bool, SweepError> {
        // Known points are included, so that a block is the same for every worker.
        let order = self.folder.dearest_first(shard, &Points::none(self.folder.sweep.plan.points()));
        for block in 0..BLOCKS {
            let [from, to] = [block, block + 1].map(|block| order.len() * block / BLOCKS);
            let mut points = order[from..to].to_vec();
            points.retain(|index| !self.known.has((*index).into()));
            let is_free = points.is_empty() || claims.map_or(Ok(true), |claims| claims.take(block))?;
            if is_free && !self.points(&points) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn points(&mut self, points: &[u32]) -> bool {
        points.iter().all(|index| {
            self.known.add((*index).into());
            (self.take)(*index)
        })
    }

    /// Adds the points that other workers have finished meanwhile.
    fn look_again(&mut self) -> Result<(), SweepError> {
        let read = self.folder.read(|_, record| {
            self.known.add(record.index);
            Ok(())
        });
        read.map(drop)
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
            let Some((outcome, sweeps)) = compute(&point, plan, &at_rest, &goes_on) else { return };
            // In microseconds; more digits would be noise in the table.
            let processor_s = (1e6 * (thread_s() - started_s)).round() / 1e6;
            let cost = Cost { processor_s, sweeps };
            let record = Record { index: point.index, name: point.name, outcome, cost };
            each(&record);
            if let Err(error) = lock(&part).push(record) {
                breaks(SweepError::at(&self.path)(error));
            }
        };
        let threads = rayon::ThreadPoolBuilder::new().num_threads(jobs).build()?;
        let (sender, receiver) = sync_channel(0);
        std::thread::scope(|scope| {
            scope.spawn(move || {
                let mut take = |index: u32| sender.send(index).is_ok();
                let mut work = Work { folder: self, known: done.clone(), take: &mut take };
                work.hand_out(shard).unwrap_or_else(breaks);
            });
            let receiver = Mutex::new(receiver);
            let next = || lock(&receiver).recv().ok();
            threads.broadcast(|_| {
                while goes_on()
                    && let Some(index) = next()
                {
                    one(index);
                }
            });
        });
        let broken = broken.into_inner().unwrap_or_else(PoisonError::into_inner);
        let part = part.into_inner().unwrap_or_else(PoisonError::into_inner);
        broken.map_or_else(|| part.close().map_err(SweepError::at(&self.path)), Err)
    }

    /// Returns the unknown points of a shard, the most expensive first by the model's own estimate; equally expensive
    /// points keep the order of the plan.
    pub fn dearest_first(&self, shard: Shard, known: &Points) -> Vec<u32> {
        let points = self.sweep.points_of(shard, known);
        // The number of points fits in 32 bits.
        let mut costs: Vec<(f32, u32)> = points.map(|(index, _)| (self.estimate(index), index as u32)).collect();
        costs.par_sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        costs.into_iter().map(|(_, index)| index).collect()
    }

    /// Returns the estimated cost of a point in arbitrary units; 0 for an impossible point.
    fn estimate(&self, index: u64) -> f32 {
        let (point, plan) = (self.sweep.point(index), &self.sweep.plan);
        let Ok(robot) = &point.robot else { return 0.0 };
        if robot.validate().is_err() {
            return 0.0;
        }
        let one = effort::estimate(robot, point.speeds_rpm, plan.method == Method::Steady, plan.run_s);
        (phases(plan, point.speeds_rpm) as f64 * one) as f32
    }
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
        let mut handed = std::collections::BTreeSet::new();
        let mut take = |index| {
            if handed.is_empty() {
                let helper = Claims::begin(&folder.path, two).unwrap().of_other(0).unwrap();
                assert!(helper.take(7).unwrap());
            }
            assert!(handed.insert(index), "{index} twice");
            true
        };
        let known = folder.counts(one).unwrap().done;
        Work { folder: &folder, known, take: &mut take }.hand_out(one).unwrap();
        assert_eq!(handed.len(), 300, "its own shard, block 7 last, and that of the other worker, which does nothing");
    }
}
