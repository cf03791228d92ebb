//! The archive itself: a ZIP, which every repository and every computer opens, and the sums of its files.

use super::content::Entry;
use super::reading;
use crate::output::OutputError;
use crate::text::hex;
use biflag_log::atomic_file::Draft;
use miette::Report;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Size above which an entry needs the long form of a ZIP.
const LONG: u64 = u32::MAX as u64;

/// Endings of the names of files that are compressed already.
const PACKED: [&str; 9] = ["mcap", "jpg", "jpeg", "png", "pdf", "mp4", "webm", "gif", "zip"];

/// Size and SHA-256 of a file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Sum {
    /// Bytes.
    pub size: u64,
    /// In hexadecimal digits.
    pub sha256: String,
}

impl Sum {
    /// Returns the sum of a content.
    pub fn of(bytes: &[u8]) -> Self {
        Self { size: bytes.len() as u64, sha256: hex(&Sha256::digest(bytes)) }
    }
}

/// Returns the sums of all files, in their order.
pub(super) fn sums(entries: &[Entry]) -> miette::Result<Vec<Sum>> {
    entries.iter().map(|entry| copy(entry, &mut io::sink(), reading(&entry.file))).collect()
}

/// Copies a file and returns its sum. `writing` converts the errors of the target.
fn copy(entry: &Entry, to: &mut impl Write, writing: impl Fn(io::Error) -> Report) -> miette::Result<Sum> {
    let reading = reading(&entry.file);
    let mut file = File::open(&entry.file).map_err(&reading)?;
    let (mut hasher, mut buffer, mut size) = (Sha256::new(), vec![0; 1 << 16], 0);
    loop {
        let count = file.read(&mut buffer).map_err(&reading)?;
        if count == 0 {
            return Ok(Sum { size, sha256: hex(&hasher.finalize()) });
        }
        hasher.update(&buffer[..count]);
        to.write_all(&buffer[..count]).map_err(&writing)?;
        size += count as u64;
    }
}

/// Writes the archive as the new file `out` and returns its size. Files without a sum come last: they list the others.
pub(super) fn write(entries: &[Entry], sums: &[Sum], out: &Path) -> miette::Result<u64> {
    let writing = |source: io::Error| Report::from(OutputError::new(out, source));
    let draft = Draft::create(out).map_err(writing)?;
    let mut zip = ZipWriter::new(BufWriter::new(draft.file.try_clone().map_err(writing)?));
    for (index, entry) in entries.iter().enumerate() {
        let size = entry.file.metadata().map_err(reading(&entry.file))?.len();
        let method =
            if PACKED.contains(&entry.extension()) { CompressionMethod::Stored } else { CompressionMethod::Deflated };
        // Files have no time: it would mean nothing for generated files, and the logs contain their own.
        let options = SimpleFileOptions::default()
            .compression_method(method)
            .last_modified_time(DateTime::default())
            .unix_permissions(0o644)
            .large_file(size >= LONG);
        zip.start_file(&entry.name, options).map_err(|error| writing(error.into()))?;
        let copied = copy(entry, &mut zip, writing)?;
        if sums.get(index).is_some_and(|sum| *sum != copied) {
            let help = "pack the session again once no program writes into it";
            return Err(miette::miette!(help = help, "{}: has changed while it was packed", entry.file.display()));
        }
    }
    zip.finish().map_err(io::Error::from).and_then(|mut file| file.flush()).map_err(writing)?;
    let bytes = draft.file.metadata().map_err(writing)?.len();
    draft.publish(out).map_err(writing)?;
    Ok(bytes)
}
