//! Merges the parts of a sweep into one table, sorted by the names of the points.
//!
//! The bytes of the table depend only on the plan and the results, not on the number of workers, the order of their
//! results, or interruptions. Names are hashes and therefore evenly distributed: one pass over the parts sorts the results
//! into buckets of neighbouring names, and each bucket is sorted in memory and becomes a row group of the table. So
//! memory grows little with the number of points.

use super::buckets::Buckets;
use super::compute::{Origin, Record};
use super::folder::{Folder, Parts};
use super::point::Points;
use super::table::{cost_table, table};
use super::{SweepError, cost_path, csv_path, parquet_path};
use crate::export::table::Table;
use crate::export::{csv, parquet};
use biflag_log::atomic_file;
use std::collections::HashMap;
use std::io::{Error, Write};
use std::path::PathBuf;

/// Approximate number of rows in a bucket.
const BUCKET: u64 = 16_384;

/// Treatment of points without a result.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Missing {
    /// They are an error; no table is written.
    Refused,
    /// The table has no rows for them.
    LeftOut,
}

/// Result of a merge.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Merged {
    /// Number of rows.
    pub done: u64,
    /// Number of rows of failed points.
    pub failed: u64,
    /// Number of points computed several times with different results, which should not be.
    /// The table has one of these results, chosen by its bytes.
    pub different: u64,
    /// Parts that are cut off or damaged.
    pub damaged: Vec<PathBuf>,
}

impl Merged {
    fn count(&mut self, records: &[Record]) {
        self.failed += records.iter().filter(|record| record.outcome.is_err()).count() as u64;
    }
}

/// The results of a sweep in buckets.
struct Collected {
    buckets: Buckets,
    count: usize,
    /// The origins to which the items of the buckets refer.
    origins: Vec<Origin>,
    done: Points,
    parts: Parts,
}

impl Folder {
    /// Writes the table of results and the table of costs.
    ///
    /// # Errors
    /// [`SweepError::Missing`], a part cannot be read, or a file cannot be written.
    pub fn merge(&self, missing: Missing) -> Result<Merged, SweepError> {
        let mut collected = self.collect()?;
        let (points, done) = (self.sweep.plan.points(), collected.done.count());
        if done < points && missing == Missing::Refused {
            let (folder, damaged) = (self.path.clone(), collected.parts.damaged);
            return Err(SweepError::Missing { folder, missing: points - done, points, damaged });
        }
        let [table, text, cost] = [parquet_path, csv_path, cost_path].map(|path| path(&self.path));
        let mut merged = Merged::default();
        let written = atomic_file::replace(&table, |parquet| {
            atomic_file::replace(&text, |csv| {
                atomic_file::replace(&cost, |cost| {
                    merged = self.write(&mut collected, parquet, csv, cost)?;
                    Ok(())
                })
            })
        });
        written.map_err(SweepError::at(&table))?;
        Ok(merged)
    }

    /// Returns the table of all finished points, with the same summary as [`Self::merge`].
    ///
    /// # Errors
    /// A part cannot be read.
    pub fn table(&self) -> Result<(Table, Merged), SweepError> {
        let mut records = Vec::new();
        let parts = self.read(|_, record| {
            records.push((0, record));
            Ok(())
        })?;
        let different = sort(&mut records).map_err(SweepError::at(&self.path))?;
        let records: Vec<_> = records.into_iter().map(|(_, record)| record).collect();
        let mut merged = Merged { done: records.len() as u64, different, damaged: parts.damaged, ..Merged::default() };
        merged.count(&records);
        Ok((table(&self.sweep, records), merged))
    }

    /// Sorts the results into buckets.
    fn collect(&self) -> Result<Collected, SweepError> {
        let points = self.sweep.plan.points();
        let count = points.div_ceil(BUCKET);
        let at = |error| SweepError::at(&self.path)(error);
        let mut buckets = Buckets::new(count as usize, &self.path).map_err(at)?;
        let mut done = Points::none(points);
        let (mut origins, mut numbers) = (Vec::new(), HashMap::new());
        let parts = self.read(|origin, record| {
            let number: u32 = *numbers.entry(origin.clone()).or_insert_with(|| {
                origins.push(origin.clone());
                origins.len() as u32 - 1
            });
            done.add(record.index);
            // Buckets are equal intervals of all names.
            let bucket = (u128::from(record.name.number()) * u128::from(count)) >> 64;
            buckets.push(bucket as usize, &(number, record)).map_err(at)
        })?;
        Ok(Collected { buckets, count: count as usize, origins, done, parts })
    }

    fn write(
        &self,
        collected: &mut Collected,
        parquet: impl Write + Send,
        csv: impl Write,
        cost: impl Write,
    ) -> Result<Merged, Error> {
        let Collected { buckets, count, origins, done, parts } = collected;
        let (empty, of_cost) = (table(&self.sweep, Vec::new()), cost_table(&[], origins));
        let (mut parquet, mut csv) = (parquet::Writer::new(&empty, parquet)?, csv::Writer::new(&empty, csv)?);
        let mut cost = csv::Writer::new(&of_cost, cost)?;
        let mut merged = Merged { done: done.count(), damaged: parts.damaged.clone(), ..Merged::default() };
        for bucket in 0..*count {
            let mut records = buckets.read(bucket)?;
            merged.different += sort(&mut records)?;
            if records.is_empty() {
                continue;
            }
            cost.rows(&cost_table(&records, origins))?;
            let records: Vec<Record> = records.into_iter().map(|(_, record)| record).collect();
            merged.count(&records);
            let rows = table(&self.sweep, records);
            parquet.rows(&rows)?;
            csv.rows(&rows)?;
        }
        parquet.close()?;
        csv.close()?;
        cost.close()?;
        Ok(merged)
    }
}

/// Sorts results, each with the number of its origin, by name, and keeps one per point. Returns the number of points
/// with different results.
fn sort(records: &mut Vec<(u32, Record)>) -> Result<u64, Error> {
    let mut keyed = Vec::with_capacity(records.len());
    for item in records.drain(..) {
        let mut bytes = [0; 2048];
        let length = postcard::to_slice(&item.1.outcome, &mut bytes).map_err(Error::other)?.len();
        keyed.push((item.1.name, item.1.index, bytes[..length].to_vec(), item));
    }
    keyed.sort_by(|a, b| (a.0, a.1, &a.2).cmp(&(b.0, b.1, &b.2)));
    let mut different = 0;
    keyed.dedup_by(|b, a| {
        let same_point = (a.0, a.1) == (b.0, b.1);
        different += u64::from(same_point && a.2 != b.2);
        same_point
    });
    records.extend(keyed.into_iter().map(|(.., item)| item));
    Ok(different)
}
