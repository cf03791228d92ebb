//! Part files: the results of one worker, appended point by point.
//!
//! ```text
//! part-3f9c0a7be1d24586.open    while the worker runs, and for ever if it is killed
//! part-3f9c0a7be1d24586.part    once it has ended
//! ```
//!
//! A part begins with [`MAGIC`]; then come frames: length and CRC-32 of the content (4 bytes each, little-endian), and
//! the content, an [`Entry`] in postcard's format. A frame is written in one call, so a killed worker loses only the
//! points that it was computing. A frame torn by a crash of the computer or a full disk ends the part. The last frame
//! of a closed part has the number of its points, so that a part that was cut off during copying is detected.

use super::compute::Outcome;
use super::point::Name;
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::fs::{File, TryLockError};
use std::hash::{BuildHasher, RandomState};
use std::io::{BufReader, Error, ErrorKind, Read, Result, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// The first bytes of a part.
const MAGIC: [u8; 8] = *b"BIFLAGS2";

/// Longest content of a frame, bytes.
const LONGEST: usize = 4096;

/// Names of parts while they are written, and after.
const OPEN: &str = "open";
const CLOSED: &str = "part";

/// A frame.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
enum Entry {
    /// The worker has started, this many seconds after 1970.
    Started(u64),
    /// A point is done.
    Point(Record),
    /// The worker has ended after this many points.
    Ended(u64),
}

/// The result of a point.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct Record {
    /// Its place in the plan.
    pub index: u64,
    /// Its name.
    pub name: Name,
    /// Its result.
    pub outcome: Outcome,
}

/// A part that is being written.
#[derive(Debug)]
pub struct PartWriter {
    file: File,
    path: PathBuf,
    points: u64,
}

impl PartWriter {
    /// Creates a part with a new name in a folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(folder: &Path) -> Result<Self> {
        // Workers on many computers share a folder: their clocks and process numbers may be equal.
        let unique = RandomState::new().hash_one((SystemTime::now(), std::process::id()));
        let path = folder.join(format!("part-{unique:016x}.{OPEN}"));
        let mut file = File::options().append(true).create_new(true).open(&path)?;
        // For `is_active`. Not every file system supports locks.
        let _ = file.try_lock();
        file.write_all(&MAGIC)?;
        let mut part = Self { file, path, points: 0 };
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        part.write(&Entry::Started(now.as_secs()))?;
        Ok(part)
    }

    /// Appends a point.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn push(&mut self, record: Record) -> Result<()> {
        self.write(&Entry::Point(record))?;
        self.points += 1;
        Ok(())
    }

    /// Ends the part and gives it its final name; a part without points is removed.
    ///
    /// # Errors
    /// The file cannot be written or renamed.
    pub fn close(mut self) -> Result<()> {
        if self.points == 0 {
            return std::fs::remove_file(&self.path);
        }
        self.write(&Entry::Ended(self.points))?;
        self.file.sync_all()?;
        std::fs::rename(&self.path, self.path.with_extension(CLOSED))
    }

    fn write(&mut self, entry: &Entry) -> Result<()> {
        let mut frame = [0; 8 + LONGEST];
        let length = postcard::to_slice(entry, &mut frame[8..]).map_err(Error::other)?.len();
        let checksum = crc32fast::hash(&frame[8..8 + length]);
        frame[..4].copy_from_slice(&(length as u32).to_le_bytes());
        frame[4..8].copy_from_slice(&checksum.to_le_bytes());
        self.file.write_all(&frame[..8 + length])
    }
}

/// Reads the points of a part.
#[derive(Debug)]
pub struct PartReader {
    file: BufReader<File>,
    /// When the worker started, seconds after 1970.
    pub started_s: u64,
    points: u64,
    /// Whether there are no more frames to read.
    at_end: bool,
    /// Whether its worker has closed it.
    closed: bool,
    /// Whether its last frame was read.
    whole: bool,
}

impl PartReader {
    /// Opens a part. One of another kind, or cut off in its first bytes, has no points.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn open(path: &Path) -> Result<Self> {
        let mut file = BufReader::new(File::open(path)?);
        let mut magic = [0; MAGIC.len()];
        let is_part = read_whole(&mut file, &mut magic)? && magic == MAGIC;
        let closed = path.extension() == Some(OsStr::new(CLOSED));
        let mut reader = Self { file, started_s: 0, points: 0, at_end: !is_part, closed, whole: false };
        if let Some(Entry::Started(seconds)) = reader.entry()? {
            reader.started_s = seconds;
        }
        Ok(reader)
    }

    /// Returns the next point; `None` at the end, and at a torn frame.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn next(&mut self) -> Result<Option<Record>> {
        match self.entry()? {
            Some(Entry::Point(record)) => {
                self.points += 1;
                Ok(Some(record))
            }
            Some(Entry::Ended(points)) => {
                self.whole = points == self.points;
                Ok(None)
            }
            _ => Ok(None),
        }
    }

    /// Returns whether a part that its worker has closed is cut off or damaged, after its last point was read.
    pub fn is_damaged(&self) -> bool {
        self.closed && !self.whole
    }

    fn entry(&mut self) -> Result<Option<Entry>> {
        let mut head = [[0; 4]; 2];
        if self.at_end || !read_whole(&mut self.file, head.as_flattened_mut())? {
            self.at_end = true;
            return Ok(None);
        }
        let [length, checksum] = head.map(u32::from_le_bytes);
        let mut buffer = [0; LONGEST];
        let mut entry = None;
        if let Some(content) = buffer.get_mut(..length as usize)
            && read_whole(&mut self.file, content)?
            && crc32fast::hash(content) == checksum
        {
            entry = postcard::from_bytes(content).ok();
        }
        self.at_end = entry.is_none();
        Ok(entry)
    }
}

/// Fills the buffer; returns `false` if the file ends before.
fn read_whole(file: &mut impl Read, buffer: &mut [u8]) -> Result<bool> {
    match file.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// Returns the parts in a folder, open ones too. Their order does not matter.
///
/// # Errors
/// The folder cannot be read.
pub fn parts(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut parts = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let is_part = path.file_name().and_then(OsStr::to_str).is_some_and(|name| name.starts_with("part-"));
        if is_part && path.extension().is_some_and(|end| end == OPEN || end == CLOSED) {
            parts.push(path);
        }
    }
    Ok(parts)
}

/// Returns whether a worker is at work on a part. On a file system without locks, a worker that has written within the
/// last minutes counts as at work.
pub fn is_active(part: &Path) -> bool {
    if part.extension() != Some(OsStr::new(OPEN)) {
        return false;
    }
    match File::options().read(true).append(true).open(part).map(|file| file.try_lock()) {
        Ok(Ok(())) | Err(_) => false,
        Ok(Err(TryLockError::WouldBlock)) => true,
        Ok(Err(TryLockError::Error(_))) => {
            let age = part.metadata().and_then(|meta| meta.modified()).ok().and_then(|time| time.elapsed().ok());
            age.is_some_and(|age| age.as_secs() < 600)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(index: u64) -> Record {
        let name = Name([index as u8; 16]);
        Record { index, name, outcome: Outcome::failed(&format!("reason {index}")) }
    }

    fn read(path: &Path) -> (Vec<Record>, bool) {
        let mut reader = PartReader::open(path).unwrap();
        let records = std::iter::from_fn(|| reader.next().unwrap()).collect();
        (records, reader.is_damaged())
    }

    fn part(folder: &Path, records: u64, close: bool) -> PathBuf {
        let mut part = PartWriter::create(folder).unwrap();
        (0..records).for_each(|index| part.push(record(index)).unwrap());
        let path = part.path.clone();
        if close {
            part.close().unwrap();
            return path.with_extension(CLOSED);
        }
        path
    }

    #[test]
    fn points_of_open_and_closed_parts_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let wanted: Vec<_> = (0..3).map(record).collect();
        for close in [false, true] {
            let path = part(folder.path(), 3, close);
            assert_eq!(read(&path), (wanted.clone(), false));
            assert!(!is_active(&path), "its worker is gone");
        }
        let writer = PartWriter::create(folder.path()).unwrap();
        let path = writer.path.clone();
        assert!(is_active(&path));
        writer.close().unwrap();
        assert_eq!(parts(folder.path()).unwrap().len(), 2, "a part without points is removed");
    }

    /// Cut off after any byte, a part has all points before, and a closed one is known to be damaged.
    #[test]
    fn a_torn_part_keeps_the_points_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = part(folder.path(), 3, true);
        let bytes = std::fs::read(&path).unwrap();
        let mut last = 0;
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let (records, damaged) = read(&path);
            assert!(damaged && records.len() >= last && records.len() <= 3, "{length}");
            assert!(records.iter().enumerate().all(|(i, found)| *found == record(i as u64)));
            last = records.len();
        }
        assert_eq!(last, 3);
    }

    #[test]
    fn a_changed_byte_is_never_read_as_a_point() {
        let folder = tempfile::tempdir().unwrap();
        let path = part(folder.path(), 3, true);
        let bytes = std::fs::read(&path).unwrap();
        for at in 0..bytes.len() {
            let mut spoilt = bytes.clone();
            spoilt[at] ^= 0x10;
            std::fs::write(&path, &spoilt).unwrap();
            let (records, damaged) = read(&path);
            let is_head_of_start = at < MAGIC.len() + 16;
            assert!(damaged || is_head_of_start, "{at}");
            assert!(records.iter().enumerate().all(|(i, found)| *found == record(i as u64)), "{at}");
        }
    }
}
