//! Merges the parts of a sweep into one table, sorted by the names of the points.
//!
//! The bytes of the table depend only on the plan and the results, not on the number of workers, the order of their
//! results, or interruptions. Names are hashes and therefore evenly distributed. The table is written in blocks of
//! neighbouring names, one row group each, and each block is collected in a pass over the parts, so memory does not
//! grow with the number of points.

use super::SweepError;
use super::folder::{Folder, Points};
use super::part::Record;
use super::point::Name;
use super::table::table;
use super::{csv_path, parquet_path};
use crate::export::table::Table;
use crate::export::{csv, parquet};
use biflag_log::atomic_file;
use std::io::{Error, Write};
use std::path::PathBuf;

/// Rows of a block, about.
const BLOCK: u64 = 16_384;

/// What was merged.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Merged {
    /// Number of rows.
    pub done: u64,
    /// How many of them are points that failed.
    pub failed: u64,
    /// Number of points that were computed several times with different results, for instance on processors of
    /// different types. The table has one of these results, chosen by its bytes.
    pub different: u64,
    /// Parts that are cut off or damaged.
    pub damaged: Vec<PathBuf>,
}

impl Folder {
    /// Writes the table of all points that are done.
    ///
    /// # Errors
    /// A part cannot be read, or a file cannot be written.
    pub fn merge(&self) -> Result<Merged, SweepError> {
        let (table, text) = (parquet_path(&self.path), csv_path(&self.path));
        let mut merged = Merged::default();
        let written = atomic_file::replace(&table, |parquet| {
            atomic_file::replace(&text, |csv| {
                merged = self.write(parquet, csv)?;
                Ok(())
            })
        });
        written.map_err(SweepError::at(&table))?;
        Ok(merged)
    }

    /// Returns the table of all points that are done, and what [`Self::merge`] tells of it.
    ///
    /// # Errors
    /// A part cannot be read.
    pub fn table(&self) -> Result<(Table, Merged), SweepError> {
        let mut records = Vec::new();
        let damaged = self.read(|_| true, |record| records.push(record))?;
        let different = sort(&mut records).map_err(SweepError::at(&self.path))?;
        let failed = records.iter().filter(|record| record.outcome.is_failed()).count();
        let merged = Merged { done: records.len() as u64, failed: failed as u64, different, damaged };
        Ok((table(&self.sweep, records), merged))
    }

    fn write(&self, parquet: impl Write + Send, csv: impl Write) -> Result<Merged, Error> {
        let points = self.sweep.plan.points();
        let empty = table(&self.sweep, Vec::new());
        let (mut parquet, mut csv) = (parquet::Writer::new(&empty, parquet)?, csv::Writer::new(&empty, csv)?);
        let mut merged = Merged::default();
        let mut done = Points::none(points);
        let blocks = points.div_ceil(BLOCK);
        for block in 0..blocks {
            let mut records = Vec::new();
            merged.damaged = self
                .read(|name| block_of(name, blocks) == block, |record| records.push(record))
                .map_err(Error::other)?;
            merged.different += sort(&mut records)?;
            for record in &records {
                done.add(record.index);
                merged.failed += u64::from(record.outcome.is_failed());
            }
            if !records.is_empty() {
                let rows = table(&self.sweep, records);
                parquet.rows(&rows)?;
                csv.rows(&rows)?;
            }
        }
        merged.done = done.count();
        parquet.close()?;
        csv.close()?;
        Ok(merged)
    }
}

/// Returns the block of a name: `blocks` equal intervals of all names.
fn block_of(name: &Name, blocks: u64) -> u64 {
    ((u128::from(name.number()) * u128::from(blocks)) >> 64) as u64
}

/// Sorts results by name and leaves one of each point. Returns how many points had different results.
fn sort(records: &mut Vec<Record>) -> Result<u64, Error> {
    let mut keyed = Vec::with_capacity(records.len());
    for record in records.drain(..) {
        let mut bytes = [0; 2048];
        let length = postcard::to_slice(&record.outcome, &mut bytes).map_err(Error::other)?.len();
        keyed.push((record.name, record.index, bytes[..length].to_vec(), record));
    }
    keyed.sort_by(|a, b| (a.0, a.1, &a.2).cmp(&(b.0, b.1, &b.2)));
    let mut different = 0;
    keyed.dedup_by(|b, a| {
        let same_point = (a.0, a.1) == (b.0, b.1);
        different += u64::from(same_point && a.2 != b.2);
        same_point
    });
    records.extend(keyed.into_iter().map(|(.., record)| record));
    Ok(different)
}
