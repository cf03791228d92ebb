//! The archive itself: a ZIP, which every repository and every computer opens, and the sums of its files.

use super::PackError;
use super::content::Entry;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::path::Path;
use study::output;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// Size above which an entry needs the long form of a ZIP.
const LONG: u64 = u32::MAX as u64;

/// Size and SHA-256 of a file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Sum {
    /// Bytes.
    pub size: u64,
    /// In hexadecimal digits.
    pub sha256: String,
}

/// Returns the sums of all files, in their order.
pub(super) fn sums(entries: &[Entry]) -> Result<Vec<Sum>, PackError> {
    let sum = |entry: &Entry| copy(&mut File::open(&entry.file)?, &mut io::sink());
    entries.iter().map(|entry| sum(entry).map_err(PackError::reading(&entry.file))).collect()
}

/// Copies a file and returns its sum.
fn copy(from: &mut impl Read, to: &mut impl Write) -> io::Result<Sum> {
    let (mut hasher, mut buffer, mut size) = (Sha256::new(), vec![0; 1 << 16], 0);
    loop {
        let count = from.read(&mut buffer)?;
        if count == 0 {
            let sha256 = hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
            return Ok(Sum { size, sha256 });
        }
        hasher.update(&buffer[..count]);
        to.write_all(&buffer[..count])?;
        size += count as u64;
    }
}

/// Writes the archive as the new file `out` and returns its size. Files without a sum come last: they list the others.
pub(super) fn write(entries: &[Entry], sums: &[Sum], out: &Path) -> Result<u64, PackError> {
    let mut failure = None;
    let written = output::replace(out, |file| {
        let mut zip = ZipWriter::new(file);
        for (index, entry) in entries.iter().enumerate() {
            if let Err(error) = add(&mut zip, entry, sums.get(index)) {
                // The draft is not published after an error.
                failure = Some(error);
                return Err(io::ErrorKind::Other.into());
            }
        }
        zip.finish()?.flush()
    });
    match (failure, written) {
        (Some(error), _) => Err(error),
        (None, written) => Ok(written.and_then(|()| {
            out.metadata().map(|meta| meta.len()).map_err(|source| output::OutputError::new(out, source))
        })?),
    }
}

/// Adds a file, which must still have its sum.
fn add<W: Write + Seek>(zip: &mut ZipWriter<W>, entry: &Entry, sum: Option<&Sum>) -> Result<(), PackError> {
    let reading = || PackError::reading(&entry.file);
    let mut file = File::open(&entry.file).map_err(reading())?;
    let size = file.metadata().map_err(reading())?.len();
    let method = if entry.is_compressed() { CompressionMethod::Stored } else { CompressionMethod::Deflated };
    // Without a time: that of the files that are made says nothing, and the logs have their own.
    let options = SimpleFileOptions::default()
        .compression_method(method)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644)
        .large_file(size >= LONG);
    zip.start_file(&entry.name, options).map_err(|error| reading()(error.into()))?;
    let copied = copy(&mut file, zip).map_err(reading())?;
    match sum {
        Some(sum) if *sum != copied => Err(PackError::Changed { path: entry.file.clone() }),
        _ => Ok(()),
    }
}
