//! Unpacking a chunk: everything in it, and only if its CRC holds.

use mcap::records::{Channel, MessageHeader, Record, SchemaHeader};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

/// The longest record, packed or unpacked, that is believed: a damaged length must not take all memory.
pub(super) const MAX_RECORD: u64 = 256 << 20;

/// What a chunk holds.
#[derive(Debug)]
pub(super) enum Entry {
    /// With the type's description.
    Schema(SchemaHeader, Vec<u8>),
    Channel(Channel),
    Message(MessageHeader, Vec<u8>),
}

/// Bytes of a record before its content, and of a chunk's content before its compressed records, less the name of the
/// compression.
const HEADS: u64 = 9 + 40;

/// Everything in a chunk, given its whole record. `None` where anything in it is damaged.
pub(super) fn unpack(record: &[u8]) -> Option<Vec<Entry>> {
    let Ok(Record::Chunk { header, .. }) = mcap::parse_record(mcap::records::op::CHUNK, record.get(9..)?) else {
        return None;
    };
    // MCAP allows anything after the compressed records; here it would be the next records, behind a damaged length.
    if HEADS.checked_add(header.compression.len() as u64)?.checked_add(header.compressed_size)? != record.len() as u64 {
        return None;
    }
    let (entries, whole) = read(record, true);
    whole.then_some(entries)
}

/// What can be unpacked from the beginning of a chunk whose end is cut off. There is no CRC for a part.
pub(super) fn unpack_beginning(record: &[u8]) -> Vec<Entry> {
    read(record, false).0
}

/// The entries, and whether all of them were read.
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
    // Nothing else belongs into a chunk.
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
