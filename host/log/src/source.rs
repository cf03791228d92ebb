//! The file of a log, optionally hashed while it is read.

use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufReader, Read, Result, Seek, SeekFrom};

/// A file that is mostly read from beginning to end.
#[derive(Debug)]
pub(super) struct Source {
    file: File,
    /// Position of the next read.
    at: u64,
    digest: Option<Digested>,
}

/// The hash of the bytes before `end`.
#[derive(Debug, Default)]
struct Digested {
    hasher: Sha256,
    end: u64,
}

impl Source {
    pub fn new(file: File) -> Self {
        Self { file, at: 0, digest: None }
    }

    /// Hashes bytes as they are read from now on. Bytes before this position are read again by
    /// [`sha256`](Self::sha256).
    pub fn hash(&mut self) {
        self.digest.get_or_insert_default();
    }

    /// Returns the SHA-256 of the complete file in hexadecimal.
    pub fn sha256(&mut self) -> Result<String> {
        let at = self.at;
        // Reading hashes the rest of the file.
        self.at = self.digest.get_or_insert_default().end;
        self.seek(SeekFrom::Start(self.at))?;
        io::copy(&mut BufReader::with_capacity(1 << 16, &mut *self), &mut io::sink())?;
        self.seek(SeekFrom::Start(at))?;
        let digest = self.digest.take().unwrap_or_default();
        Ok(digest.hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    }
}

impl Read for Source {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let count = self.file.read(buffer)?;
        if let Some(Digested { hasher, end }) = &mut self.digest
            && (self.at..=self.at + count as u64).contains(end)
        {
            hasher.update(&buffer[(*end - self.at) as usize..count]);
            *end = self.at + count as u64;
        }
        self.at += count as u64;
        Ok(count)
    }
}

impl Seek for Source {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sha256_does_not_depend_on_how_the_file_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        // FIPS 180-2, appendix B.1.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        for read in 0..=3 {
            let mut source = Source::new(File::open(&path).unwrap());
            source.hash();
            source.seek(SeekFrom::Start(1)).unwrap();
            source.read_exact(&mut vec![0; read.min(2)]).unwrap();
            source.seek(SeekFrom::Start(0)).unwrap();
            source.read_exact(&mut vec![0; read]).unwrap();
            assert_eq!(source.sha256().unwrap(), expected, "{read}");
            let mut rest = String::new();
            source.read_to_string(&mut rest).unwrap();
            assert_eq!(rest, "abc"[read..]);
        }
    }
}
