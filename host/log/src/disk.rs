//! A file that is synced in the background, so that a slow disk does not delay the trial.

use super::LogError;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Creates a file, which must not exist, and syncs its folder.
pub(super) fn create_file(path: &Path) -> Result<File, LogError> {
    let file = File::options().read(true).write(true).create_new(true).open(path);
    let file = file.map_err(|source| LogError::creating(path, source))?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Not every file system can sync a folder; the file's own content is synced in any case.
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
    Ok(file)
}

/// A file being written. Each `flush` starts a sync of the bytes before it.
///
/// After the first error nothing more is written, so that the file stays an unbroken beginning of the log.
#[derive(Debug)]
pub(super) struct Disk {
    file: File,
    /// Bytes in the file, and their CRC.
    written: u64,
    crc: crc32fast::Hasher,
    failed: bool,
    requests: Option<SyncSender<()>>,
    thread: Option<JoinHandle<()>>,
    status: Arc<Status>,
}

/// The shared status of a [`Disk`].
#[derive(Debug, Default)]
pub(super) struct Status {
    written: std::sync::atomic::AtomicU64,
    sync_error: Mutex<Option<io::Error>>,
}

impl Status {
    /// Bytes in the file.
    pub fn written(&self) -> u64 {
        self.written.load(std::sync::atomic::Ordering::Relaxed)
    }

    /// Takes the error of a failed sync.
    pub fn take_error(&self) -> Option<io::Error> {
        self.sync_error.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Disk {
    pub fn new(file: File) -> io::Result<Self> {
        let status = Arc::new(Status::default());
        // One request may wait while another is served; it covers everything written until then.
        let (requests, served) = sync_channel(1);
        let (handle, thread_status) = (file.try_clone()?, Arc::clone(&status));
        let thread = std::thread::Builder::new()
            .name("log sync".to_owned())
            .spawn(move || sync_on_request(&handle, &served, &thread_status))?;
        Ok(Self {
            file,
            written: 0,
            crc: crc32fast::Hasher::new(),
            failed: false,
            requests: Some(requests),
            thread: Some(thread),
            status,
        })
    }

    pub fn status(&self) -> Arc<Status> {
        Arc::clone(&self.status)
    }

    /// Waits for the background sync, then syncs the file. Returns what it must hold.
    pub fn finish(mut self) -> io::Result<Content> {
        self.stop();
        match self.status.take_error() {
            Some(error) => Err(error),
            None => self.file.sync_all(),
        }?;
        Ok(Content { length: self.written, crc: self.crc.clone().finalize() })
    }

    fn stop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            // The thread cannot panic.
            let _ = thread.join();
        }
    }
}

/// Length and CRC of everything that was written to a file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Content {
    length: u64,
    crc: u32,
}

impl Content {
    /// Returns how the file at `path` differs from what was written; `None` if it does not. Other programs may remove,
    /// truncate or overwrite a file while it is written, which its writer does not notice.
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

fn sync_on_request(file: &File, requests: &Receiver<()>, status: &Status) {
    while requests.recv().is_ok() {
        if let Err(error) = file.sync_data() {
            *status.sync_error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        }
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        let result = self.file.write(bytes);
        match &result {
            Ok(count) => {
                self.written += *count as u64;
                self.crc.update(&bytes[..*count]);
            }
            Err(error) => self.failed = error.kind() != io::ErrorKind::Interrupted,
        }
        self.status.written.store(self.written, std::sync::atomic::Ordering::Relaxed);
        result
    }

    fn flush(&mut self) -> io::Result<()> {
        if let Some(requests) = &self.requests {
            // A full channel means that a request is already waiting.
            let _ = requests.try_send(());
        }
        Ok(())
    }
}

/// The MCAP writer asks for its position, but never moves.
impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.written),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        self.stop();
    }
}
