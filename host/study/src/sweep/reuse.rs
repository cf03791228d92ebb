//! Reuses results of another sweep for the points common to both, wherever they are in its plan.

use super::compute::is_panic;
use super::folder::{Counts, Folder};
use super::manifest::Manifest;
use super::part::{self, PartReader, PartWriter};
use super::point::{Points, Shard};
use super::{RESULTS, SweepError};
use rayon::prelude::*;
use std::path::Path;

impl Folder {
    /// Copies the missing results of a shard from another sweep's folder into a part, and counts them.
    ///
    /// Does not copy points whose solver panicked, because a panic is a fault of the program.
    ///
    /// # Errors
    /// [`SweepError::NotASweep`], [`SweepError::Results`], or if a part cannot be read or the new one cannot be
    /// written.
    pub fn reuse(&self, from: &Path, shard: Shard, counts: &mut Counts) -> Result<(), SweepError> {
        let results = Manifest::read(from)?.results;
        if results != RESULTS {
            return Err(SweepError::Results { folder: from.to_owned(), results });
        }
        let wanted = self.by_number(shard, &counts.done);
        let mut part = PartWriter::create(&self.path).map_err(SweepError::at(&self.path))?;
        for path in part::parts(from).map_err(SweepError::at(from))? {
            let Some(mut reader) = PartReader::of_listed(&path).map_err(SweepError::of_part(&path))? else { continue };
            while let Some(mut record) = reader.next().map_err(SweepError::at(&path))? {
                let number = record.name.number();
                let begin = wanted.partition_point(|(other, _)| *other < number);
                let same = wanted[begin..].iter().take_while(|(other, _)| *other == number);
                for (_, index) in same {
                    let index = u64::from(*index);
                    if record.name == self.sweep.name(index)
                        && !is_panic(&record.outcome)
                        && counts.add(index, &record.outcome)
                    {
                        record.index = index;
                        part.push_from(&reader.origin, record.clone()).map_err(SweepError::at(&self.path))?;
                    }
                }
            }
        }
        part.close().map_err(SweepError::at(&self.path))
    }

    /// Returns the missing points of a shard with the numbers of their names, sorted by these numbers.
    fn by_number(&self, shard: Shard, done: &Points) -> Vec<(u64, u32)> {
        let missing = self.sweep.points_of(shard, done);
        // The number of points fits in 32 bits.
        let mut numbers: Vec<(u64, u32)> = missing.map(|(index, name)| (name.number(), index as u32)).collect();
        numbers.par_sort_unstable();
        numbers
    }
}
