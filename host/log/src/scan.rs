//! Scans a log from beginning to end, even if it is damaged.
//!
//! Chunks and metadata records are accepted only if their CRC holds. When a record cannot be read, the scanner searches
//! for the next one that can, starting at the end of the last record that is known to be valid, because the length of a
//! record in between may be wrong.

use super::chunk::{Entry, MAX_RECORD, unpack, unpack_beginning};
use super::table::{Table, is_intact};
use mcap::MAGIC;
use mcap::records::{Header, Metadata, Record, op};
use std::io::{self, Read, Seek, SeekFrom};

/// Length of the head of a record: operation code and length.
const HEAD: u64 = 9;
/// Length of the footer record.
const FOOTER: u64 = HEAD + 20;
/// Number of bytes read at once in the search for a record.
const BLOCK: u64 = 64 << 10;

/// The condition of a log.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Condition {
    /// Intact to the last byte.
    Clean,
    /// The end is missing.
    CutOff,
    /// Bytes were changed or lost before the end.
    Damaged,
}

/// A place in a log that cannot be read.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Loss {
    /// Offset of the first byte.
    pub offset: u64,
    /// Number of bytes.
    pub bytes: u64,
    /// What was lost.
    pub what: &'static str,
}

impl std::fmt::Display for Loss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { offset, bytes, what } = self;
        match bytes {
            0 => write!(f, "{what} (at byte {offset})"),
            _ => write!(f, "{what} ({bytes} bytes at byte {offset})"),
        }
    }
}

/// Returns the last metadata record called `name`, by the index at the end of the log; `None` if the log has no intact
/// index, or no such record. This reads only a few kilobytes.
pub(super) fn indexed_table<R: Read + Seek>(source: R, name: &str) -> io::Result<Option<Table>> {
    let mut scanner = Scanner::new(source)?;
    let end = FOOTER + MAGIC.len() as u64;
    let Some(footer_at) = scanner.length.checked_sub(end) else { return Ok(None) };
    let footer = scanner.bytes(footer_at, end)?;
    let Some((start, _)) = footer.get(HEAD as usize..).and_then(|fields| fields.split_first_chunk()) else {
        return Ok(None);
    };
    let start = u64::from_le_bytes(*start);
    if start > footer_at || footer_at - start > MAX_RECORD {
        return Ok(None);
    }
    let index = scanner.bytes(start, scanner.length - start)?;
    if !check_index(&index, start).intact {
        return Ok(None);
    }
    let mut rest = index.as_slice();
    let mut found = None;
    while let Some((op, length)) = rest.first_chunk().and_then(plausible) {
        let Some((record, after)) = rest.split_at_checked((HEAD + length) as usize) else { break };
        if op == op::METADATA_INDEX
            && let Ok(Record::MetadataIndex(index)) = mcap::parse_record(op, &record[HEAD as usize..])
            && index.name == name
        {
            found = Some(index.offset);
        }
        rest = after;
    }
    let Some(offset) = found else { return Ok(None) };
    Ok(match scanner.record_at(offset)?.as_ref().and_then(piece) {
        Some(Piece::Metadata(found, table)) if found == name => Some(table),
        _ => None,
    })
}

/// A piece of a log.
#[derive(Debug)]
pub(super) enum Piece {
    Chunk(Vec<Entry>),
    Metadata(String, Table),
}

/// A record as stored in the file, including its head.
struct RawRecord {
    op: u8,
    bytes: Vec<u8>,
}

impl RawRecord {
    fn body(&self) -> &[u8] {
        self.bytes.get(HEAD as usize..).unwrap_or_default()
    }
}

/// The scanner. It holds one record at a time.
#[derive(Debug)]
pub(super) struct Scanner<R> {
    source: R,
    length: u64,
    /// Offset of the next record.
    offset: u64,
    /// End of the last record that is known to be valid, where a search for the next one begins.
    resync_from: u64,
    /// CRC of everything before `offset`, as long as nothing was skipped.
    crc: crc32fast::Hasher,
    losses: Vec<Loss>,
    end: Option<Condition>,
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
            end: None,
        };
        let magic = scanner.bytes(0, offset.min(length))?;
        if magic != MAGIC {
            scanner.lose(0, offset.min(length), "the first bytes");
        }
        scanner.crc.update(&magic);
        Ok(scanner)
    }

    /// Returns the source that the log is read from.
    pub fn source_mut(&mut self) -> &mut R {
        &mut self.source
    }

    /// Returns the places that could not be read so far. The list is complete after the last piece.
    pub fn losses(&self) -> &[Loss] {
        &self.losses
    }

    /// Returns the condition of the log, which is known after the last piece.
    pub fn condition(&self) -> Option<Condition> {
        self.end
    }

    /// Returns the header: profile and library.
    pub fn header(&mut self) -> io::Result<Option<Header>> {
        let record = self.record_at(MAGIC.len() as u64)?;
        Ok(record.filter(|record| record.op == op::HEADER).and_then(|record| header(record.body())))
    }

    /// Returns the next piece that can be read; `None` after the last.
    pub fn next(&mut self) -> io::Result<Option<Piece>> {
        while self.end.is_none() {
            let at = self.offset;
            let Some(record) = self.record_at(at)? else {
                if self.resync("unreadable records")? {
                    continue;
                }
                return self.tail();
            };
            let next = at + record.bytes.len() as u64;
            match record.op {
                op::DATA_END if record.body().len() == 4 => {
                    self.finish(at, record.body())?;
                    continue;
                }
                op::HEADER if at == MAGIC.len() as u64 && header(record.body()).is_some() => {}
                op::MESSAGE_INDEX if is_message_index(record.body()) => {}
                _ => match piece(&record) {
                    Some(piece) => {
                        self.advance(&record);
                        self.resync_from = next;
                        return Ok(Some(piece));
                    }
                    None => {
                        let what = match record.op {
                            op::CHUNK => "a chunk",
                            op::METADATA => "a metadata record",
                            _ => "a record",
                        };
                        if self.resync(what)? {
                            continue;
                        }
                        return self.tail();
                    }
                },
            }
            self.advance(&record);
        }
        Ok(None)
    }

    fn advance(&mut self, record: &RawRecord) {
        self.crc.update(&record.bytes);
        self.offset += record.bytes.len() as u64;
    }

    fn lose(&mut self, offset: u64, bytes: u64, what: &'static str) {
        self.losses.push(Loss { offset, bytes, what });
    }

    /// Moves to the next readable record and notes the loss. Returns `false` if there is none.
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
        let bytes = self.bytes(from, rest.min(MAX_RECORD))?;
        let is_cut = match bytes.first_chunk::<{ HEAD as usize }>() {
            Some(head) => plausible(head).is_none_or(|(_, length)| length > rest - HEAD),
            None => true,
        };
        let entries = if is_cut && bytes.first() == Some(&op::CHUNK) { unpack_beginning(&bytes) } else { Vec::new() };
        self.lose(from, rest, if is_cut { "the end" } else { "the end, which cannot be read" });
        self.end = Some(if is_cut && self.losses.len() == 1 { Condition::CutOff } else { Condition::Damaged });
        Ok((!entries.is_empty()).then_some(Piece::Chunk(entries)))
    }

    /// Checks the CRC of the data section and the index after it.
    fn finish(&mut self, at: u64, saved: &[u8]) -> io::Result<()> {
        let unbroken = self.losses.is_empty();
        if unbroken && saved != self.crc.clone().finalize().to_le_bytes() {
            self.lose(at, 0, "something in the records between the chunks");
        }
        let start = at + HEAD + 4;
        let index = self.bytes(start, (self.length - start.min(self.length)).min(MAX_RECORD))?;
        let IndexState { intact, complete } = check_index(&index, start);
        if !intact {
            self.lose(start, index.len() as u64, "the index at the end");
        }
        self.end = Some(match (self.losses.is_empty(), unbroken && !intact && !complete) {
            (true, _) => Condition::Clean,
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
                let Some((op, length)) = head.first_chunk().and_then(plausible) else { continue };
                let at = block_at + i as u64;
                if ![op::CHUNK, op::METADATA, op::DATA_END].contains(&op) || length > self.length - at - HEAD {
                    continue;
                }
                let Some(record) = self.record_at(at)? else { continue };
                if piece(&record).is_some() || (op == op::DATA_END && length == 4) {
                    return Ok(Some(at));
                }
            }
            block_at += BLOCK;
        }
        Ok(None)
    }

    /// Returns the record at `at`; `None` if there cannot be one.
    fn record_at(&mut self, at: u64) -> io::Result<Option<RawRecord>> {
        if at + HEAD > self.length {
            return Ok(None);
        }
        let head = self.bytes(at, HEAD)?;
        let Some((op, length)) = head.first_chunk().and_then(plausible) else { return Ok(None) };
        if length > self.length - at - HEAD {
            return Ok(None);
        }
        Ok(Some(RawRecord { op, bytes: self.bytes(at, HEAD + length)? }))
    }

    fn bytes(&mut self, at: u64, count: u64) -> io::Result<Vec<u8>> {
        self.source.seek(SeekFrom::Start(at))?;
        let mut bytes = vec![0; count as usize];
        self.source.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

/// Returns operation code and length of a head, if it can be that of a record.
fn plausible(head: &[u8; HEAD as usize]) -> Option<(u8, u64)> {
    let [op, length @ ..] = *head;
    let length = u64::from_le_bytes(length);
    (length <= MAX_RECORD && (op::HEADER..=op::DATA_END).contains(&op)).then_some((op, length))
}

/// Returns the content of a chunk or metadata record; `None` if it is invalid.
fn piece(record: &RawRecord) -> Option<Piece> {
    match record.op {
        op::CHUNK => unpack(&record.bytes).map(Piece::Chunk),
        op::METADATA => match mcap::parse_record(op::METADATA, record.body()) {
            // The parser allows extra bytes after the table; here they mean that the record's length is damaged.
            Ok(Record::Metadata(Metadata { name, metadata }))
                if is_intact(&name, &metadata) && metadata_length(&name, &metadata) == record.body().len() =>
            {
                Some(Piece::Metadata(name, metadata))
            }
            _ => None,
        },
        _ => None,
    }
}

/// Parses a header, which must be exactly as long as its texts.
fn header(body: &[u8]) -> Option<Header> {
    match mcap::parse_record(op::HEADER, body) {
        Ok(Record::Header(header)) if 8 + header.profile.len() + header.library.len() == body.len() => Some(header),
        _ => None,
    }
}

/// Returns the length of a metadata record. Four bytes of length precede every text and the table.
fn metadata_length(name: &str, table: &Table) -> usize {
    8 + name.len() + table.iter().map(|(key, value)| 8 + key.len() + value.len()).sum::<usize>()
}

/// Returns whether a message index is as long as it states.
fn is_message_index(body: &[u8]) -> bool {
    match body {
        [_, _, a, b, c, d, entries @ ..] => entries.len() as u64 == u64::from(u32::from_le_bytes([*a, *b, *c, *d])),
        _ => false,
    }
}

/// The index at the end of a log.
#[derive(Clone, Copy, Default)]
struct IndexState {
    /// The CRC holds and the index is complete.
    intact: bool,
    /// The file ends with the magic, as a complete log does.
    complete: bool,
}

/// Checks the index, which extends from the end of the data at `start` to the end of the file.
fn check_index(index: &[u8], start: u64) -> IndexState {
    let end = FOOTER as usize + MAGIC.len();
    let Some(summary_length) = index.len().checked_sub(end) else { return IndexState::default() };
    let (summary, footer) = index.split_at(summary_length);
    let complete = footer.ends_with(MAGIC);
    let broken = IndexState { intact: false, complete };
    let Some((head, [0x14, 0, 0, 0, 0, 0, 0, 0, fields @ ..])) = footer.split_first() else { return broken };
    let Some((starts, [a, b, c, d, ..])) = fields.split_at_checked(16) else { return broken };
    let mut crc = crc32fast::Hasher::new();
    crc.update(summary);
    crc.update(&footer[..FOOTER as usize - 4]);
    let holds = *head == op::FOOTER
        && starts.starts_with(&start.to_le_bytes())
        && u32::from_le_bytes([*a, *b, *c, *d]) == crc.finalize();
    IndexState { intact: holds && complete, complete }
}
