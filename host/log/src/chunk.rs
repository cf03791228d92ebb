//! Unpacking a chunk whose CRC holds.

use mcap::records::{Channel, MessageHeader, Record, SchemaHeader};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// Longest record that is accepted, packed or unpacked: a damaged length must not allocate all memory.
pub(super) const MAX_RECORD: u64 = 256 << 20;

/// A record in a chunk.
#[derive(Debug)]
pub(super) enum Entry {
    /// A message type with its descriptor set.
    Schema(SchemaHeader, Vec<u8>),
    Channel(Channel),
    Message(MessageHeader, Vec<u8>),
}

/// Length of a record's head and of a chunk's fields before its compressed records, without the name of the
/// compression.
const HEADS: u64 = 9 + 40;

/// Returns every record of a chunk, given the chunk's complete record; `None` if anything in it is damaged.
pub(super) fn unpack(record: &[u8]) -> Option<Vec<Entry>> {
    let Ok(Record::Chunk { header, .. }) = mcap::parse_record(mcap::records::op::CHUNK, record.get(9..)?) else {
        return None;
    };
    // MCAP allows extra bytes after the compressed records; here they mean that the chunk's length is damaged.
    if HEADS.checked_add(header.compression.len() as u64)?.checked_add(header.compressed_size)? != record.len() as u64 {
        return None;
    }
    let (entries, whole) = read(record, true);
    whole.then_some(entries)
}

/// Returns the records that can be unpacked from a chunk whose end is cut off. A part of a chunk has no CRC to check.
pub(super) fn unpack_beginning(record: &[u8]) -> Vec<Entry> {
    read(record, false).0
}

/// Returns the entries, and whether all of them were read.
fn read(record: &[u8], checked: bool) -> (Vec<Entry>, bool) {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(checked)
        .with_record_length_limit(MAX_RECORD as usize);
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = record;
    let mut entries = Vec::new();
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => match entry(opcode, data) {
                Some(entry) => entries.push(entry),
                None => return (entries, false),
            },
            Err(_) => return (entries, false),
        }
    }
    (entries, true)
}

fn entry(opcode: u8, data: &[u8]) -> Option<Entry> {
    use mcap::records::op;
    // MCAP allows no other record in a chunk.
    if ![op::SCHEMA, op::CHANNEL, op::MESSAGE].contains(&opcode) {
        return None;
    }
    match mcap::parse_record(opcode, data).ok()? {
        Record::Schema { header, data } => Some(Entry::Schema(header, data.into_owned())),
        Record::Channel(channel) => Some(Entry::Channel(channel)),
        Record::Message { header, data } => Some(Entry::Message(header, data.into_owned())),
        _ => None,
    }
}
