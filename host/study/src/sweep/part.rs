//! Part files: the results of one worker, appended point by point.
//!
//! ```text
//! part-3f9c0a7be1d24586.open    while the worker runs, and for ever if it is killed
//! part-3f9c0a7be1d24586.part    once it has ended
//! ```
//!
//! A part begins with [`MAGIC`]; then come frames: length and CRC-32 of the content (4 bytes each, little-endian), and
//! the content, an [`Entry`] in postcard's format. All times come from the computer that stores the folder, because the
//! clocks of workers differ. A frame is written in one call, so a killed worker loses only the points that it was
//! computing. A frame torn by a crash of the computer or a full disk ends the part. The last frame of a closed part has
//! the number of its points, so a part cut off during copying is detected.

use super::clock::seconds;
use super::compute::{Origin, Record};
use biflag_log::atomic_file::random_name;
use serde::{Deserialize, Serialize};
use std::ffi::OsStr;
use std::fs::{File, TryLockError};
use std::io::{BufReader, Error, ErrorKind, Read, Result, Write};
use std::path::{Path, PathBuf};
use system::file::rename;
use system::lock;

/// The first bytes of a part: its kind, and the version of its format.
const MAGIC: [u8; 8] = *b"BIFLAGS4";

/// Place of the version in it.
const VERSION: usize = MAGIC.len() - 1;

/// Longest content of a frame, bytes.
const LONGEST: usize = 4096;

/// Time without a write after which a worker counts as gone if locks give no answer, s.
const SILENCE_S: f64 = 600.0;

/// File extensions of parts while they are written, and afterwards.
const OPEN: &str = "open";
const CLOSED: &str = "part";

/// A frame.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
enum Entry {
    /// The worker has started, this many seconds after 1970.
    Started(f64),
    /// The origin of the points that follow.
    Origin(Origin),
    /// A point is done.
    Point(Record),
    /// The worker has ended after this many points.
    Ended(u64),
}

/// A part that is being written.
#[derive(Debug)]
pub struct PartWriter {
    file: File,
    path: PathBuf,
    points: u64,
    origin: Origin,
}

impl PartWriter {
    /// Creates a part with a new name in a folder. Its points are computed here, except those added by [`Self::push_from`].
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(folder: &Path) -> Result<Self> {
        let path = folder.join(format!("part-{}.{OPEN}", random_name()));
        let mut file = File::options().read(true).append(true).create_new(true).open(&path)?;
        // For `rate`. Not every file system supports locks.
        let _ = lock::try_lock(&file);
        file.write_all(&MAGIC)?;
        file.sync_all()?;
        let started = seconds(file.metadata()?.modified()?);
        let mut part = Self { file, path, points: 0, origin: Origin::here() };
        part.write(&Entry::Started(started))?;
        part.write(&Entry::Origin(part.origin.clone()))?;
        Ok(part)
    }

    /// Appends a point computed elsewhere.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn push_from(&mut self, origin: &Origin, record: Record) -> Result<()> {
        if self.origin != *origin {
            self.write(&Entry::Origin(origin.clone()))?;
            self.origin = origin.clone();
        }
        self.push(record)
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
        rename(&self.path, &self.path.with_extension(CLOSED))
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
    started_s: f64,
    /// The origin of the last point.
    pub origin: Origin,
    points: u64,
    /// Whether there are no more frames to read.
    at_end: bool,
    /// Whether its worker has closed it.
    closed: bool,
    /// Whether it ends with the right number of points.
    whole: bool,
}

impl PartReader {
    /// Opens a part. A file of another kind, or one cut off in its first bytes, has no points.
    ///
    /// # Errors
    /// The file cannot be read, or is of another version.
    pub fn open(path: &Path) -> Result<Self> {
        let mut file = BufReader::new(File::open(path)?);
        let mut magic = [0; MAGIC.len()];
        let is_part = read_whole(&mut file, &mut magic)? && magic == MAGIC;
        if !is_part && magic[..VERSION] == MAGIC[..VERSION] && magic[VERSION].is_ascii_digit() {
            return Err(Error::new(ErrorKind::InvalidData, "another version of biflag computed it"));
        }
        let closed = path.extension() == Some(OsStr::new(CLOSED));
        let origin = Origin::default();
        let mut reader = Self { file, started_s: 0.0, origin, points: 0, at_end: !is_part, closed, whole: false };
        if let Some(Entry::Started(seconds)) = reader.entry()? {
            reader.started_s = seconds;
        }
        Ok(reader)
    }

    /// Opens a part found in a listing of the folder. Its worker may have closed it since; returns `None` if it had no
    /// points and was removed.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_listed(path: &Path) -> Result<Option<Self>> {
        for path in [path, &path.with_extension(CLOSED)] {
            match Self::open(path) {
                Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::StaleNetworkFileHandle) => {}
                other => return other.map(Some),
            }
        }
        Ok(None)
    }

    /// Returns the next point; `None` at the end, and at a torn frame.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn next(&mut self) -> Result<Option<Record>> {
        loop {
            match self.entry()? {
                Some(Entry::Origin(origin)) => self.origin = origin,
                Some(Entry::Point(record)) => {
                    self.points += 1;
                    return Ok(Some(record));
                }
                Some(Entry::Ended(points)) => {
                    self.whole = points == self.points;
                    return Ok(None);
                }
                Some(Entry::Started(_)) | None => return Ok(None),
            }
        }
    }

    /// Returns whether a closed part is cut off or damaged. Call it after reading the last point.
    pub fn is_damaged(&self) -> bool {
        self.closed && !self.whole
    }

    /// Returns the worker's points per second; `None` if no worker is active on the part. Call it after reading the
    /// last point.
    ///
    /// `now_s`: the time in the folder, [`super::clock::now_s`]. A lock shows that a worker is active, but on some file
    /// systems only on its own computer. On others, a worker that has written within the last minutes counts as active.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn rate(&self, now_s: f64) -> Result<Option<f64>> {
        let file = self.file.get_ref();
        if self.closed || self.points == 0 {
            return Ok(None);
        }
        let is_locked = match lock::try_lock_shared(file) {
            Err(TryLockError::WouldBlock) => Some(true),
            Ok(()) => {
                lock::unlock(file)?;
                (self.origin.host == Origin::here().host).then_some(false)
            }
            Err(TryLockError::Error(_)) => None,
        };
        let last_s = seconds(file.metadata()?.modified()?);
        let is_active = is_locked.unwrap_or(now_s - last_s < SILENCE_S);
        // Time stamps may have a resolution of a second.
        Ok(is_active.then_some(self.points as f64 / (last_s - self.started_s).max(1.0)))
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
        if let Some(Entry::Point(Record { outcome, .. })) = &entry
            && outcome.as_ref().is_ok_and(|steady| !steady.is_whole())
        {
            entry = None;
        }
        self.at_end = entry.is_none();
        Ok(entry)
    }
}

/// Fills the buffer; returns `false` if the file ends first.
fn read_whole(file: &mut impl Read, buffer: &mut [u8]) -> Result<bool> {
    match file.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// Returns the parts in a folder, including open ones, in no particular order.
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

#[cfg(test)]
mod tests {
    use super::super::clock::now_s;
    use super::super::compute::{Cost, failed};
    use super::super::point::Name;
    use super::*;
    use std::time::{Duration, UNIX_EPOCH};

    fn record(index: u64) -> Record {
        let name = Name([index as u8; 16]);
        let cost = Cost { processor_s: 0.25, sweeps: index };
        Record { index, name, outcome: failed(&format!("reason {index}")), cost }
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
        }
        let writer = PartWriter::create(folder.path()).unwrap();
        let path = writer.path.clone();
        assert!(PartReader::of_listed(&path).unwrap().is_some());
        writer.close().unwrap();
        assert_eq!(parts(folder.path()).unwrap().len(), 2, "a part without points is removed");
        assert!(PartReader::of_listed(&path).unwrap().is_none(), "listed before it was removed");
        for closed in parts(folder.path()).unwrap() {
            let listed = PartReader::of_listed(&closed.with_extension(OPEN)).unwrap();
            assert!(listed.is_some(), "listed before it was closed");
        }
    }

    /// Returns the rate of a part after all its points.
    fn rate(path: &Path, now_s: f64) -> Option<f64> {
        let mut reader = PartReader::open(path).unwrap();
        while reader.next().unwrap().is_some() {}
        reader.rate(now_s).unwrap()
    }

    /// The worker's clock is a day behind the folder's, which has no effect.
    #[test]
    fn only_workers_at_work_have_a_rate() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = PartWriter::create(folder.path()).unwrap();
        let path = writer.path.clone();
        let now_s = now_s(folder.path()) + 86_400.0;
        assert_eq!(rate(&path, now_s), None, "no point");
        (0..30).for_each(|index| writer.push(record(index)).unwrap());
        let started = PartReader::open(&path).unwrap().started_s;
        let at = |seconds: f64| UNIX_EPOCH + Duration::from_secs_f64(started + seconds);
        writer.file.set_modified(at(60.0)).unwrap();
        assert_eq!(rate(&path, now_s), Some(0.5), "locked");
        lock::unlock(&writer.file).unwrap();
        assert_eq!(rate(&path, started + 61.0), None, "killed");
        // On another computer a lock may not be visible.
        writer.push_from(&Origin { host: "elsewhere".to_owned(), ..Origin::default() }, record(30)).unwrap();
        writer.file.set_modified(at(62.0)).unwrap();
        assert_eq!(rate(&path, started + 63.0), Some(0.5));
        assert_eq!(rate(&path, started + 62.0 + SILENCE_S), None);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "asking the time leaves nothing");
    }

    #[test]
    fn a_part_of_another_version_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = part(folder.path(), 3, true);
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[VERSION] = b'3';
        std::fs::write(&path, bytes).unwrap();
        let error = PartReader::open(&path).unwrap_err().to_string();
        assert!(error.contains("another version"), "{error}");
    }

    /// A part cut off after any byte keeps all points before it, and a closed part is recognised as damaged.
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
