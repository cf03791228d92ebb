//! Sorts more items than fit in memory into buckets, in one pass.
//!
//! All buckets share an unnamed file, which disappears when the program ends in any way. Each bucket collects its items
//! in memory and appends them to the file in chunks.

use biflag_log::atomic_file::Draft;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{Error, Read, Result, Seek, SeekFrom, Write};
use std::path::Path;

/// Approximate size of a chunk, bytes.
const CHUNK: usize = 32 * 1024;

/// Longest item, bytes.
const LONGEST: usize = 4096;

/// The buckets.
#[derive(Debug)]
pub struct Buckets {
    file: File,
    end: u64,
    buckets: Vec<Bucket>,
}

#[derive(Clone, Default, Debug)]
struct Bucket {
    /// Items not yet in the file.
    tail: Vec<u8>,
    /// Offsets and lengths of the chunks in the file.
    chunks: Vec<(u64, usize)>,
}

impl Buckets {
    /// Creates this many empty buckets, with their file in a folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn new(count: usize, folder: &Path) -> Result<Self> {
        // A dropped draft has no name, but its file exists until it is closed.
        let file = Draft::create(&folder.join("merge"))?.file.try_clone()?;
        Ok(Self { file, end: 0, buckets: vec![Bucket::default(); count] })
    }

    /// Adds an item to a bucket.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn push(&mut self, bucket: usize, item: &impl Serialize) -> Result<()> {
        let mut bytes = [0; LONGEST];
        let bytes = postcard::to_slice(item, &mut bytes).map_err(Error::other)?;
        let Bucket { tail, chunks } = &mut self.buckets[bucket];
        tail.extend_from_slice(bytes);
        if tail.len() >= CHUNK {
            self.file.seek(SeekFrom::Start(self.end))?;
            self.file.write_all(tail)?;
            chunks.push((self.end, tail.len()));
            self.end += tail.len() as u64;
            tail.clear();
        }
        Ok(())
    }

    /// Returns the items of a bucket in the order of their arrival.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read<T: DeserializeOwned>(&mut self, bucket: usize) -> Result<Vec<T>> {
        let Bucket { tail, chunks } = &self.buckets[bucket];
        let mut bytes = Vec::new();
        for (place, length) in chunks {
            self.file.seek(SeekFrom::Start(*place))?;
            let end = bytes.len();
            bytes.resize(end + length, 0);
            self.file.read_exact(&mut bytes[end..])?;
        }
        bytes.extend_from_slice(tail);
        let (mut items, mut rest) = (Vec::new(), bytes.as_slice());
        while !rest.is_empty() {
            let (item, after) = postcard::take_from_bytes(rest).map_err(Error::other)?;
            items.push(item);
            rest = after;
        }
        Ok(items)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_keep_their_bucket_and_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut buckets = Buckets::new(4, folder.path()).unwrap();
        // Bucket 3 stays empty; the others have several chunks and a tail.
        let item = |number: u64| (number, "x".repeat(number as usize % 50));
        (0..9000).for_each(|number| buckets.push(number as usize % 3, &item(number)).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "the file has no name");
        for bucket in [2, 0, 1, 3, 0] {
            let found: Vec<(u64, String)> = buckets.read(bucket).unwrap();
            let wanted: Vec<_> = (0..9000).filter(|number| *number as usize % 3 == bucket).map(item).collect();
            assert_eq!(found, wanted);
        }
    }
}
