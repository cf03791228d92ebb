//! A file written and synced in the background, so a slow disk does not delay the trial.

use super::atomic_file::sync_folder_of;
use super::error::LogError;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Creates a file, which must not exist, and syncs its folder.
pub(super) fn create_file(path: &Path) -> Result<File, LogError> {
    let file = File::options().read(true).write(true).create_new(true).open(path);
    let file = file.map_err(|source| LogError::creating(path, source))?;
    sync_folder_of(path);
    Ok(file)
}

/// Largest number of bytes that wait to be written, minutes of a recording. Beyond it, the writer waits for the disk.
const MAX_WAITING: usize = 8 << 20;

/// A file written by its own thread. Each `flush` requests a sync of the bytes before it.
///
/// After the first error nothing more is written, so that the file stays an unbroken beginning of the log. A later
/// write, or [`Status::take_error`], returns the error.
#[derive(Debug)]
pub(super) struct Disk {
    /// Number of bytes passed to the file, and their CRC.
    length: u64,
    crc: crc32fast::Hasher,
    jobs: Option<Sender<Job>>,
    thread: Option<JoinHandle<()>>,
    status: Arc<Status>,
}

#[derive(Debug)]
enum Job {
    Write(Vec<u8>),
    Sync,
}

/// The shared status of a [`Disk`].
#[derive(Debug, Default)]
pub(super) struct Status {
    /// Number of bytes that wait to be written.
    waiting: AtomicUsize,
    failed: AtomicBool,
    written: AtomicU64,
    slowest_ms: AtomicU64,
    error: Mutex<Option<io::Error>>,
}

impl Status {
    /// Returns the number of bytes in the file.
    pub fn written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Returns the longest time that the disk has taken for a write or a sync.
    pub fn slowest(&self) -> Duration {
        Duration::from_millis(self.slowest_ms.load(Ordering::Relaxed))
    }

    /// Waits until at most `waiting` bytes wait to be written, or a write has failed.
    pub fn wait_for(&self, waiting: usize) {
        while self.waiting.load(Ordering::Acquire) > waiting && !self.failed.load(Ordering::Acquire) {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Takes the error of a failed write or sync.
    pub fn take_error(&self) -> Option<io::Error> {
        self.error.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn fail(&self, error: io::Error) {
        *self.error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        self.failed.store(true, Ordering::Release);
    }

    fn timed<T>(&self, work: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
        let begun = Instant::now();
        let done = work();
        let took_ms = u64::try_from(begun.elapsed().as_millis()).unwrap_or(u64::MAX);
        self.slowest_ms.fetch_max(took_ms, Ordering::Relaxed);
        done
    }
}

impl Disk {
    pub fn new(file: File) -> io::Result<Self> {
        let status = Arc::new(Status::default());
        let (jobs, queue) = channel();
        let thread_status = Arc::clone(&status);
        let thread = std::thread::Builder::new().name("log".to_owned()).spawn(move || {
            work(&file, &queue, &thread_status).unwrap_or_else(|error| thread_status.fail(error));
        })?;
        Ok(Self { length: 0, crc: crc32fast::Hasher::new(), jobs: Some(jobs), thread: Some(thread), status })
    }

    pub fn status(&self) -> Arc<Status> {
        Arc::clone(&self.status)
    }

    /// Waits until everything is written and synced. Returns the expected content of the file.
    pub fn finish(mut self) -> io::Result<Content> {
        self.stop();
        let content = Content { length: self.length, crc: self.crc.clone().finalize() };
        self.status.take_error().map_or(Ok(content), Err)
    }

    fn stop(&mut self) {
        self.jobs = None;
        // The thread cannot panic.
        let _ = self.thread.take().map(JoinHandle::join);
    }

    /// Sends a job. The thread ends early only after an error.
    fn send(&self, job: Job) -> io::Result<()> {
        let sent = self.jobs.as_ref().and_then(|jobs| jobs.send(job).ok());
        let earlier = || io::Error::other("an earlier write failed");
        sent.ok_or_else(|| self.status.take_error().unwrap_or_else(earlier))
    }
}

/// Writes and syncs until there are no more jobs, or until the first error. A sync can take long and does not delay
/// later writes: written bytes survive the end of this program.
fn work(file: &File, jobs: &Receiver<Job>, status: &Status) -> io::Result<()> {
    // One request may wait while another is served; it covers everything written until then.
    let (syncs, requests) = sync_channel(1);
    std::thread::scope(|scope| {
        std::thread::Builder::new().name("log sync".to_owned()).spawn_scoped(scope, move || {
            while requests.recv().is_ok() {
                status.timed(|| file.sync_data()).unwrap_or_else(|error| status.fail(error));
            }
        })?;
        for job in jobs {
            match job {
                Job::Write(bytes) => {
                    write(file, &bytes, status)?;
                    status.waiting.fetch_sub(bytes.len(), Ordering::Release);
                }
                // A full channel means that a request is already waiting.
                Job::Sync => drop(syncs.try_send(())),
            }
        }
        drop(syncs);
        Ok(())
    })
    .and_then(|()| status.timed(|| file.sync_all()))
}

fn write(mut file: &File, mut bytes: &[u8], status: &Status) -> io::Result<()> {
    while !bytes.is_empty() {
        match status.timed(|| file.write(bytes)) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(count) => {
                status.written.fetch_add(count as u64, Ordering::Relaxed);
                bytes = &bytes[count..];
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Length and CRC of everything written to a file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Content {
    length: u64,
    crc: u32,
}

impl Content {
    /// Returns how the file at `path` differs from the written content; `None` if it does not. Other programs may
    /// remove, truncate or overwrite a file while it is written, and its writer does not notice.
    pub fn difference(self, path: &Path) -> io::Result<Option<&'static str>> {
        let mut file = match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Some("removed or renamed")),
            other => other?,
        };
        let (mut crc, mut length) = (crc32fast::Hasher::new(), 0);
        let mut block = vec![0; 1 << 16];
        while let count @ 1.. = file.read(&mut block)? {
            crc.update(&block[..count]);
            length += count as u64;
        }
        Ok((Self { length, crc: crc.finalize() } != self).then_some("changed by another program"))
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.status.wait_for(MAX_WAITING);
        self.status.waiting.fetch_add(bytes.len(), Ordering::Relaxed);
        self.send(Job::Write(bytes.to_vec()))?;
        self.length += bytes.len() as u64;
        self.crc.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.send(Job::Sync)
    }
}

/// The MCAP writer asks for its position, but never moves.
impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        if let SeekFrom::Current(0) = to { Ok(self.length) } else { Err(io::ErrorKind::Unsupported.into()) }
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        self.stop();
    }
}
