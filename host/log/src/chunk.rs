//! Unpacks a chunk after checking its CRC.

use super::record::parse;
use mcap::records::{Channel, MessageHeader, Record, SchemaHeader};
use std::io::Read;

/// Longest accepted record, packed or unpacked: a damaged length must not allocate all memory.
pub(super) const MAX_RECORD: u64 = 64 << 20;

/// Binary logarithm of the largest window of a zstd stream, [`MAX_RECORD`]. A larger window would only use memory.
const WINDOW_LOG: u32 = MAX_RECORD.ilog2();

/// Length of the head of a record: operation code and length.
const HEAD: usize = 9;

/// Length of a chunk's fields before its compressed records, without the name of the compression.
const FIELDS: usize = 40;

/// A record in a chunk.
#[derive(Debug)]
pub(super) enum Entry {
    /// A message type with its descriptor set.
    Schema(SchemaHeader, Vec<u8>),
    Channel(Channel),
    Message(MessageHeader, Vec<u8>),
}

/// The unpacked records of a chunk: an iterator over its entries.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    records: Vec<u8>,
    /// Offset of the next record.
    next: usize,
}

impl Chunk {
    /// Returns a chunk of these records; `None` if any of them is invalid.
    pub fn new(records: Vec<u8>) -> Option<Self> {
        let mut rest = records.as_slice();
        while !rest.is_empty() {
            (_, rest) = split_record(rest)?;
        }
        Some(Self { records, next: 0 })
    }

    /// Returns whether it has no records at all.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }
}

/// Splits records into the first and the rest; `None` if the first is invalid.
fn split_record(records: &[u8]) -> Option<(Record<'_>, &[u8])> {
    use mcap::records::op;
    let ([op, length @ ..], rest) = records.split_first_chunk::<HEAD>()?;
    let (body, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
    // MCAP allows no other record in a chunk.
    let allowed = [op::SCHEMA, op::CHANNEL, op::MESSAGE].contains(op);
    let record = allowed.then(|| parse(*op, body))??;
    Some((record, rest))
}

impl Iterator for Chunk {
    type Item = Entry;

    fn next(&mut self) -> Option<Entry> {
        let records = self.records.get(self.next..)?;
        let (record, rest) = split_record(records)?;
        self.next += records.len() - rest.len();
        match record {
            Record::Schema { header, data } => Some(Entry::Schema(header, data.into_owned())),
            Record::Channel(channel) => Some(Entry::Channel(channel)),
            Record::Message { header, data } => Some(Entry::Message(header, data.into_owned())),
            _ => None,
        }
    }
}

/// The fields of a chunk before its compressed records.
struct Fields<'a> {
    uncompressed_size: u64,
    /// CRC of the uncompressed records; 0 if it is missing.
    crc: u32,
    compression: &'a [u8],
    compressed_size: u64,
}

impl<'a> Fields<'a> {
    /// Splits a chunk, including its head, into its fields and the rest.
    fn split(record: &'a [u8]) -> Option<(Self, &'a [u8])> {
        // The head, and the times of the first and the last message.
        let rest = record.get(HEAD + 16..)?;
        let (uncompressed_size, rest) = rest.split_first_chunk()?;
        let (crc, rest) = rest.split_first_chunk()?;
        let (name_length, rest) = rest.split_first_chunk()?;
        let (compression, rest) = rest.split_at_checked(u32::from_le_bytes(*name_length) as usize)?;
        let (compressed_size, rest) = rest.split_first_chunk()?;
        let fields = Self {
            uncompressed_size: u64::from_le_bytes(*uncompressed_size),
            crc: u32::from_le_bytes(*crc),
            compression,
            compressed_size: u64::from_le_bytes(*compressed_size),
        };
        Some((fields, rest))
    }

    /// Returns whether a record with `length` bytes after its head can be this chunk. MCAP allows extra bytes after the
    /// compressed records; here they mean that the length is damaged.
    fn fit(&self, length: u64) -> bool {
        let names: [&[u8]; 3] = [b"", b"zstd", b"lz4"];
        self.uncompressed_size <= MAX_RECORD
            && names.contains(&self.compression)
            && length.checked_sub((FIELDS + self.compression.len()) as u64) == Some(self.compressed_size)
    }
}

/// Returns the size of the records in a chunk of `length` bytes with this beginning; `None` if this cannot be a chunk.
pub(super) fn stated_size(beginning: &[u8], length: u64) -> Option<u64> {
    let (fields, _) = Fields::split(beginning)?;
    fields.fit(length).then_some(fields.uncompressed_size)
}

/// Returns the records of a chunk, given the chunk's complete record; `None` if anything in it is damaged. A chunk
/// without a CRC is accepted only if `crc_may_be_missing`.
pub(super) fn unpack(record: &[u8], crc_may_be_missing: bool) -> Option<Chunk> {
    let (fields, data) = Fields::split(record)?;
    if !fields.fit(record.len().checked_sub(HEAD)? as u64) {
        return None;
    }
    let records = decompress(&fields, data);
    let holds = fields.crc == crc32fast::hash(&records) || fields.crc == 0 && crc_may_be_missing;
    if holds && records.len() as u64 == fields.uncompressed_size { Chunk::new(records) } else { None }
}

/// Returns the records that can be unpacked from a truncated chunk, without a CRC check.
pub(super) fn unpack_beginning(record: &[u8]) -> Chunk {
    let records = Fields::split(record).map(|(fields, data)| decompress(&fields, data));
    // The last record may be cut off as well.
    Chunk { records: records.unwrap_or_default(), next: 0 }
}

/// Unpacks the records, up to the first damaged block.
fn decompress(fields: &Fields, data: &[u8]) -> Vec<u8> {
    let source: Box<dyn Read> = match fields.compression {
        b"" => Box::new(data),
        b"zstd" => match zstd_decoder(data) {
            Ok(decoder) => Box::new(decoder),
            Err(_) => return Vec::new(),
        },
        b"lz4" => Box::new(lz4_flex::frame::FrameDecoder::new(data)),
        _ => return Vec::new(),
    };
    let mut records = Vec::new();
    // Memory grows with the actual bytes, not with the stated size. Records unpacked before an error are useful if the
    // chunk is cut off; otherwise the size or the CRC shows that bytes are missing.
    let _ = source.take(fields.uncompressed_size.min(MAX_RECORD)).read_to_end(&mut records);
    records
}

fn zstd_decoder(data: &[u8]) -> std::io::Result<impl Read> {
    let mut decoder = zstd::stream::read::Decoder::with_buffer(data)?;
    decoder.window_log_max(WINDOW_LOG)?;
    Ok(decoder)
}
