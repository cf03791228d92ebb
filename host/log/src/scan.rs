//! Scans a log from beginning to end, even if it is damaged.
//!
//! Chunks and metadata records are accepted only if their CRC holds. When a record cannot be read, the scanner searches
//! for the next readable one. The search starts at the end of the last record known to be valid, because the length of
//! a record in between may be wrong.
//!
//! Other programs may rewrite a log as another valid MCAP file: without CRCs, without chunks or an index, with their
//! own records. The library in the header distinguishes such a file from an original, in which any of this is damage.

use super::chunk::{Chunk, MAX_RECORD, stated_size, unpack, unpack_beginning};
use super::condition::{Condition, Loss};
use super::record::{
    FOOTER, HEAD, IndexState, RawRecord, check_index, header, is_attachment, is_message_index, is_metadata,
    is_original, metadata, parse,
};
use super::table::Table;
use mcap::MAGIC;
use mcap::records::{Header, Record, op};
use std::io::{self, Read, Seek, SeekFrom};

/// Number of bytes read at once in the search for a record.
const BLOCK: u64 = 64 << 10;
/// Number of bytes needed to decide whether a record can be a chunk or metadata.
const BEGINNING: u64 = 256;

/// Returns the last metadata record called `name`; `None` if the log is incomplete, or has no such record. In most logs
/// this reads only a few kilobytes, thanks to the index at the end.
pub(super) fn last_table<R: Read + Seek>(source: R, name: &str) -> io::Result<Option<Table>> {
    let mut scanner = Scanner::new(source)?;
    let Some(index) = scanner.metadata_index()? else {
        return if scanner.is_original { Ok(None) } else { scanner.scan_for(name) };
    };
    let Some((_, offset)) = index.into_iter().rfind(|(found, _)| found == name) else { return Ok(None) };
    let record = scanner.record_at(offset)?;
    Ok(match record.as_ref().and_then(|record| scanner.piece(record)) {
        Some(Piece::Metadata(found, table)) if found == name => Some(table),
        _ => None,
    })
}

/// A piece of a log.
#[derive(Debug)]
pub(super) enum Piece {
    Chunk(Chunk),
    Metadata(String, Table),
    /// The offset and the length of the record. It may be longer than other records.
    Attachment(u64, u64),
}

/// The scanner. It holds one record at a time.
#[derive(Debug)]
pub(super) struct Scanner<R> {
    /// The source of the log's bytes.
    pub source: R,
    length: u64,
    /// Offset of the next record.
    pub offset: u64,
    /// End of the last record known to be valid. A search for the next record starts here.
    resync_from: u64,
    /// CRC of everything before `offset`, as long as nothing was skipped.
    crc: crc32fast::Hasher,
    /// The unreadable parts so far. The list is complete after the last piece.
    pub losses: Vec<Loss>,
    /// The condition of the log; `None` before the last piece.
    pub condition: Option<Condition>,
    /// The header: profile and library.
    pub header: Option<Header>,
    /// Whether biflag wrote the file, according to its header.
    pub is_original: bool,
    /// Number of bytes that searches may still read and unpack in vain.
    patience: u64,
}

impl<R: Read + Seek> Scanner<R> {
    /// Creates a scanner. The records begin after the magic.
    pub fn new(mut source: R) -> io::Result<Self> {
        let length = source.seek(SeekFrom::End(0))?;
        let offset = MAGIC.len() as u64;
        let mut scanner = Self {
            source,
            length,
            offset,
            resync_from: offset,
            crc: crc32fast::Hasher::new(),
            losses: Vec::new(),
            condition: None,
            header: None,
            is_original: true,
            // Without a limit, a file full of false beginnings of long records would take quadratic time.
            patience: length.saturating_mul(4).saturating_add(4 * MAX_RECORD),
        };
        let magic = scanner.bytes(0, offset.min(length))?;
        if magic != MAGIC {
            scanner.lose(0, offset.min(length), "the first bytes");
        }
        scanner.crc.update(&magic);
        let record = scanner.record_at(offset)?;
        scanner.header = record.filter(|record| record.op == op::HEADER).and_then(|record| header(record.body()));
        scanner.is_original = scanner.header.as_ref().is_none_or(is_original);
        Ok(scanner)
    }

    /// Returns the next readable piece; `None` after the last.
    pub fn next(&mut self) -> io::Result<Option<Piece>> {
        while self.condition.is_none() {
            let at = self.offset;
            let what = match self.head_at(at)? {
                None => "unreadable records",
                Some((op::ATTACHMENT, length)) => match self.skip_attachment(at, length)? {
                    true => return Ok(Some(Piece::Attachment(at, HEAD + length))),
                    false => "an attachment",
                },
                // Records that this version of MCAP does not define.
                Some((op, length)) if op > op::DATA_END => {
                    self.pass(HEAD + length)?;
                    continue;
                }
                Some((op, length)) => {
                    let record = RawRecord { op, bytes: self.bytes(at, HEAD + length)? };
                    match op {
                        op::DATA_END if record.body().len() == 4 => {
                            self.finish(at, record.body())?;
                            continue;
                        }
                        op::HEADER if at == MAGIC.len() as u64 && header(record.body()).is_some() => {
                            self.advance(&record);
                            continue;
                        }
                        op::MESSAGE_INDEX if is_message_index(record.body()) => {
                            self.advance(&record);
                            continue;
                        }
                        _ => {}
                    }
                    if let Some(piece) = self.piece(&record) {
                        self.advance(&record);
                        self.resync_from = self.offset;
                        return Ok(Some(piece));
                    }
                    match op {
                        op::CHUNK => "a chunk",
                        op::METADATA => "a metadata record",
                        _ => "a record",
                    }
                }
            };
            if !self.resync(what)? {
                return self.tail();
            }
        }
        Ok(None)
    }

    /// Returns the content of a record; `None` if it is invalid.
    fn piece(&self, record: &RawRecord) -> Option<Piece> {
        match record.op {
            op::CHUNK => unpack(&record.bytes, !self.is_original).map(Piece::Chunk),
            // biflag writes these records into chunks.
            op::SCHEMA | op::CHANNEL | op::MESSAGE if !self.is_original => {
                Chunk::new(record.bytes.clone()).map(Piece::Chunk)
            }
            op::METADATA => metadata(record.body()).map(|(name, table)| Piece::Metadata(name, table)),
            _ => None,
        }
    }

    /// Passes an attachment, reading it in blocks. Returns `false` if its lengths or its CRC are wrong.
    fn skip_attachment(&mut self, at: u64, length: u64) -> io::Result<bool> {
        let beginning = self.bytes(at + HEAD, length.min(BLOCK))?;
        if !is_attachment(&beginning, length) {
            return Ok(false);
        }
        let crc_at = at + HEAD + length - 4;
        let saved = self.bytes(crc_at, 4)?;
        let mut crc = crc32fast::Hasher::new();
        self.read_blocks(at + HEAD, length - 4, |block| crc.update(block))?;
        if saved != [0; 4] && saved != crc.finalize().to_le_bytes() {
            return Ok(false);
        }
        self.pass(HEAD + length)?;
        Ok(true)
    }

    /// Moves past a record, reading it in blocks.
    fn pass(&mut self, length: u64) -> io::Result<()> {
        let mut crc = self.crc.clone();
        self.read_blocks(self.offset, length, |block| crc.update(block))?;
        self.crc = crc;
        self.offset += length;
        Ok(())
    }

    fn read_blocks(&mut self, from: u64, length: u64, mut take: impl FnMut(&[u8])) -> io::Result<()> {
        let mut at = from;
        while at < from + length {
            let block = self.bytes(at, BLOCK.min(from + length - at))?;
            take(&block);
            at += block.len() as u64;
        }
        Ok(())
    }

    /// Returns name and offset of the metadata records from the index at the end of the file; `None` without an intact
    /// index.
    fn metadata_index(&mut self) -> io::Result<Option<Vec<(String, u64)>>> {
        let end = FOOTER + MAGIC.len() as u64;
        let Some(footer_at) = self.length.checked_sub(end) else { return Ok(None) };
        let footer = self.bytes(footer_at, end)?;
        let Some((start, _)) = footer.get(HEAD as usize..).and_then(|fields| fields.split_first_chunk()) else {
            return Ok(None);
        };
        let start = u64::from_le_bytes(*start);
        if start == 0 || start > footer_at || footer_at - start > MAX_RECORD {
            return Ok(None);
        }
        let index = self.bytes(start, self.length - start)?;
        if !check_index(&index, start, self.is_original).intact {
            return Ok(None);
        }
        let mut rest = index.as_slice();
        let mut found = Vec::new();
        while let Some((op, length)) = rest.first_chunk().and_then(|head| self.plausible(head)) {
            let Some((record, after)) = rest.split_at_checked((HEAD + length) as usize) else { break };
            if op == op::METADATA_INDEX
                && let Some(Record::MetadataIndex(index)) = parse(op, &record[HEAD as usize..])
            {
                found.push((index.name, index.offset));
            }
            rest = after;
        }
        // A program that rewrites a log may leave the metadata out of its index.
        Ok((self.is_original || !found.is_empty()).then_some(found))
    }

    /// Returns the last metadata record called `name`, from a full read; `None` if the log is incomplete.
    fn scan_for(&mut self, name: &str) -> io::Result<Option<Table>> {
        let mut last = None;
        while let Some(piece) = self.next()? {
            match piece {
                Piece::Metadata(found, table) if found == name => last = Some(table),
                _ => {}
            }
        }
        Ok(last.filter(|_| self.condition.is_some_and(Condition::is_whole)))
    }

    fn advance(&mut self, record: &RawRecord) {
        self.crc.update(&record.bytes);
        self.offset += record.bytes.len() as u64;
    }

    /// Records an unreadable part.
    pub fn lose(&mut self, offset: u64, bytes: u64, what: &'static str) {
        self.losses.push(Loss { offset, bytes, what });
    }

    /// Moves to the next readable record and records the loss. Returns `false` if there is none.
    fn resync(&mut self, what: &'static str) -> io::Result<bool> {
        let Some(found) = self.find(self.resync_from)? else { return Ok(false) };
        // The records before `offset`, such as the indexes of a chunk, were read correctly.
        let from = self.offset.min(found);
        self.lose(from, found - from, what);
        self.offset = found;
        self.resync_from = found;
        Ok(true)
    }

    /// Reads the beginning of the last chunk of a file that has no end record.
    fn tail(&mut self) -> io::Result<Option<Piece>> {
        let (from, rest) = (self.offset, self.length - self.offset.min(self.length));
        let head = self.bytes(from, rest.min(HEAD))?;
        let is_cut =
            head.first_chunk().and_then(|head| self.plausible(head)).is_none_or(|(_, length)| length > rest - HEAD);
        let chunk = if is_cut && head.first() == Some(&op::CHUNK) {
            unpack_beginning(&self.bytes(from, rest.min(MAX_RECORD))?)
        } else {
            Chunk::default()
        };
        self.lose(from, rest, if is_cut { "the end" } else { "the end, which cannot be read" });
        self.condition = Some(if is_cut && self.losses.len() == 1 { Condition::CutOff } else { Condition::Damaged });
        Ok((!chunk.is_empty()).then_some(Piece::Chunk(chunk)))
    }

    /// Checks the CRC of the data section and the index after it.
    fn finish(&mut self, at: u64, saved: &[u8]) -> io::Result<()> {
        let unbroken = self.losses.is_empty();
        let is_missing = saved == [0; 4] && !self.is_original;
        if unbroken && !is_missing && saved != self.crc.clone().finalize().to_le_bytes() {
            self.lose(at, 0, "something in the records between the chunks");
        }
        let start = at + HEAD + 4;
        let index = self.bytes(start, (self.length - start.min(self.length)).min(MAX_RECORD))?;
        let IndexState { intact, complete } = check_index(&index, start, self.is_original);
        if !intact {
            self.lose(start, index.len() as u64, "the index at the end");
        }
        self.condition = Some(match (self.losses.is_empty(), unbroken && !intact && !complete) {
            (true, _) if self.is_original => Condition::Clean,
            (true, _) => Condition::Rewritten,
            (false, true) if self.losses.len() == 1 => Condition::CutOff,
            _ => Condition::Damaged,
        });
        Ok(())
    }

    /// Returns the offset of the next chunk, metadata record or end of data at or after `from`.
    fn find(&mut self, from: u64) -> io::Result<Option<u64>> {
        let mut block_at = from;
        while block_at + HEAD <= self.length {
            let block = self.bytes(block_at, (BLOCK + HEAD - 1).min(self.length - block_at))?;
            for (i, head) in block.windows(HEAD as usize).enumerate() {
                let Some((op, length)) = head.first_chunk().and_then(|head| self.plausible(head)) else { continue };
                let at = block_at + i as u64;
                if ![op::CHUNK, op::METADATA, op::DATA_END].contains(&op) || length > self.length - at - HEAD {
                    continue;
                }
                if op == op::DATA_END {
                    if length == 4 {
                        return Ok(Some(at));
                    }
                    continue;
                }
                // The first bytes of a record exclude most false matches.
                let beginning = self.bytes(at, BEGINNING.min(self.length - at))?;
                let size = match op {
                    op::CHUNK => stated_size(&beginning, length),
                    _ => is_metadata(&beginning, length).then_some(0),
                };
                let Some(size) = size else { continue };
                let record = RawRecord { op, bytes: self.bytes(at, HEAD + length)? };
                if self.piece(&record).is_some() {
                    return Ok(Some(at));
                }
                let Some(patience) = self.patience.checked_sub(length + size) else { return Ok(None) };
                self.patience = patience;
            }
            block_at += BLOCK;
        }
        Ok(None)
    }

    /// Returns the record at `at`; `None` if there cannot be one.
    fn record_at(&mut self, at: u64) -> io::Result<Option<RawRecord>> {
        let head = self.head_at(at)?.filter(|(_, length)| *length <= MAX_RECORD);
        head.map(|(op, length)| Ok(RawRecord { op, bytes: self.bytes(at, HEAD + length)? })).transpose()
    }

    /// Returns operation code and length of the record at `at`; `None` if there cannot be one.
    fn head_at(&mut self, at: u64) -> io::Result<Option<(u8, u64)>> {
        if self.length.checked_sub(at).is_none_or(|rest| rest < HEAD) {
            return Ok(None);
        }
        let head = self.bytes(at, HEAD)?;
        let head = head.first_chunk().and_then(|head| self.plausible(head));
        Ok(head.filter(|(_, length)| *length <= self.length - at - HEAD))
    }

    /// Returns operation code and length of a head, if it can belong to a record.
    fn plausible(&self, head: &[u8; HEAD as usize]) -> Option<(u8, u64)> {
        let [op, length @ ..] = *head;
        let length = u64::from_le_bytes(length);
        let is_possible = match op {
            // Attachments and unknown records are not read into memory.
            op::ATTACHMENT => true,
            op::HEADER..=op::DATA_END => length <= MAX_RECORD,
            0 => false,
            _ => !self.is_original,
        };
        is_possible.then_some((op, length))
    }

    /// Reads `count` bytes at `at`.
    pub fn bytes(&mut self, at: u64, count: u64) -> io::Result<Vec<u8>> {
        self.source.seek(SeekFrom::Start(at))?;
        let mut bytes = vec![0; count as usize];
        self.source.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}
