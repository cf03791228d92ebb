//! Claims: each block of a shard belongs to one worker. A worker that has finished its own shard takes blocks of others.
//!
//! ```text
//! claims/3-of-64.1      shard 3 of 64 is at work, for the first time
//! claims/3-of-64.1.7    block 7 of its points is taken
//! ```
//!
//! A claim is a file that only one program can create, which works even where locks do not. Claims only save work: a
//! worker finally computes all blocks of its shard that others have claimed but not finished, and makes new claims
//! after a restart. So no claim is ever removed, and a dead worker's claim costs nothing.

use super::SweepError;
use super::point::Shard;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Number of blocks of a shard.
pub const BLOCKS: usize = 32;

/// The claims on one shard, since its worker last started.
#[derive(Clone, Debug)]
pub struct Claims {
    folder: PathBuf,
    shard: Shard,
    /// Number of times its worker has started.
    start: u64,
}

impl Claims {
    /// Starts the work on a shard.
    ///
    /// # Errors
    /// The folder of a sweep cannot be written.
    pub fn begin(sweep: &Path, shard: Shard) -> Result<Self, SweepError> {
        let folder = sweep.join("claims");
        std::fs::create_dir_all(&folder).map_err(SweepError::at(&folder))?;
        let mut claims = Self { folder, shard, start: 1 };
        while !create(&claims.path(claims.start))? {
            claims.start += 1;
        }
        Ok(claims)
    }

    /// Returns the claims on a shard that another worker has started; `None` if none has.
    pub fn of_other(&self, index: u64) -> Option<Self> {
        let shard = Shard { index, of: self.shard.of };
        let mut claims = Self { folder: self.folder.clone(), shard, start: 0 };
        while claims.path(claims.start + 1).exists() {
            claims.start += 1;
        }
        (claims.start > 0).then_some(claims)
    }

    /// Claims a block; returns whether it was free. No block is free after the shard's worker has started again.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn take(&self, block: usize) -> Result<bool, SweepError> {
        if self.path(self.start + 1).exists() {
            return Ok(false);
        }
        create(&self.path(self.start).with_added_extension(block.to_string()))
    }

    fn path(&self, start: u64) -> PathBuf {
        self.folder.join(format!("{}-of-{}.{start}", self.shard.index + 1, self.shard.of))
    }
}

/// Creates a file; returns `false` if it already exists.
fn create(path: &Path) -> Result<bool, SweepError> {
    match File::create_new(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
        other => other.map(|_| true).map_err(SweepError::at(path)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_taken_once_until_its_worker_begins_again() {
        let folder = tempfile::tempdir().unwrap();
        let shard = |index| Shard { index, of: 3 };
        let own = Claims::begin(folder.path(), shard(0)).unwrap();
        let other = Claims::begin(folder.path(), shard(1)).unwrap();
        assert!(other.of_other(2).is_none(), "nobody works on it: it may be computed elsewhere");
        let helped = other.of_other(0).unwrap();
        assert!(own.take(0).unwrap() && !helped.take(0).unwrap());
        assert!(helped.take(1).unwrap() && !own.take(1).unwrap() && other.take(1).unwrap());
        let again = Claims::begin(folder.path(), shard(0)).unwrap();
        assert!(!helped.take(2).unwrap() && again.take(0).unwrap());
        assert!(!other.of_other(0).unwrap().take(0).unwrap());
    }
}
