//! A worker: computes the points of a shard on several threads, and appends them to a part of its own.

use super::SweepError;
use super::compute::Outcome;
use super::folder::Folder;
use super::part::PartWriter;
use super::point::Shard;
use super::points::Points;
use super::record::{Cost, Record, processor_s};
use crate::lock::lock;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

impl Folder {
    /// Returns the number of points of a shard.
    pub fn points(&self, shard: Shard) -> u64 {
        let points = self.sweep.plan.points();
        if shard == Shard::ALL {
            return points;
        }
        (0..points).filter(|index| shard.has(&self.sweep.name(*index))).count() as u64
    }

    /// Computes the points of a shard that are not done, and calls `each` with every result. When `interrupted` is set,
    /// ends early with all finished results in its part.
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
        let one = |index: u64| {
            let started_s = processor_s();
            let point = self.sweep.point(index);
            let Some((outcome, sweeps)) = Outcome::of(&point, plan, &goes_on) else { return };
            let cost = Cost { processor_s: micros(processor_s() - started_s), sweeps };
            let record = Record { index, name: point.name, outcome, cost };
            each(&record);
            if let Err(error) = lock(&part).push(record) {
                lock(&broken).get_or_insert(error);
            }
        };
        let todo = (0..plan.points())
            .take_while(|_| goes_on())
            .filter(|index| !done.has(*index) && shard.has(&self.sweep.name(*index)));
        // A bridge hands out the points one by one: none is in memory before its turn.
        rayon::ThreadPoolBuilder::new().num_threads(jobs).build()?.install(|| todo.par_bridge().for_each(one));
        let broken = broken.into_inner().unwrap_or_else(PoisonError::into_inner);
        let part = part.into_inner().unwrap_or_else(PoisonError::into_inner);
        broken.map_or_else(|| part.close(), Err).map_err(SweepError::at(&self.path))
    }
}

/// Rounds to microseconds: the rest would be noise that fills a table.
fn micros(seconds: f64) -> f64 {
    (1e6 * seconds).round() / 1e6
}
