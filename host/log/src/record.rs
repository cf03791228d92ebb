//! Records of an MCAP file as bytes: checks their plausibility and parses them.

use super::meta::{self, Summary};
use super::table::{Meta, Table, from_table, has_crc, is_intact};
use mcap::MAGIC;
use mcap::records::{Header, Metadata, Record, op};

/// The MCAP profile of biflag logs.
pub const PROFILE: &str = "biflag";

/// Length of the head of a record: operation code and length.
pub(super) const HEAD: u64 = 9;
/// Length of the footer record.
pub(super) const FOOTER: u64 = HEAD + 20;

/// A record as stored in the file, including its head.
pub(super) struct RawRecord {
    pub(super) op: u8,
    pub(super) bytes: Vec<u8>,
}

impl RawRecord {
    pub(super) fn body(&self) -> &[u8] {
        self.bytes.get(HEAD as usize..).unwrap_or_default()
    }
}

/// Returns whether the library in a header is biflag's.
pub(super) fn is_original(header: &Header) -> bool {
    header.library.split(' ').next() == Some(PROFILE)
}

/// Parses the body of a record; `None` if it is invalid. Compares the lengths of its texts and its table with the
/// actual bytes, because the parser allocates as much memory as a length states.
pub(super) fn parse(op: u8, body: &[u8]) -> Option<Record<'_>> {
    // Bytes before the texts, number of texts, and whether a table follows.
    let (before, texts, has_table) = match op {
        op::HEADER => (0, 2, false),
        op::SCHEMA => (2, 2, false),
        op::CHANNEL => (4, 2, true),
        op::METADATA => (0, 1, true),
        op::METADATA_INDEX => (16, 1, false),
        op::ATTACHMENT => (16, 2, false),
        op::MESSAGE => (0, 0, false),
        // No other record is parsed.
        _ => return None,
    };
    let mut rest = body.get(before..)?;
    for _ in 0..texts {
        (_, rest) = split_text(rest)?;
    }
    if has_table {
        let (mut pairs, _) = split_text(rest)?;
        while !pairs.is_empty() {
            (_, pairs) = split_text(pairs)?;
            (_, pairs) = split_text(pairs)?;
        }
    }
    mcap::parse_record(op, body).ok()
}

/// Splits off bytes that follow their length.
fn split_text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}

/// Parses a metadata record, of biflag with its CRC, or of another program.
pub(super) fn metadata(body: &[u8]) -> Option<(String, Table)> {
    // The parser allows extra bytes after the table; here they mean that the record's length is damaged.
    match parse(op::METADATA, body) {
        Some(Record::Metadata(Metadata { name, metadata }))
            if metadata_length(&name, &metadata) == body.len()
                && (is_intact(&name, &metadata) || !has_crc(&metadata) && !meta::NAMES.contains(&name.as_str()))
                && is_possible(&name, &metadata) =>
        {
            Some((name, metadata))
        }
        _ => None,
    }
}

/// Returns whether biflag can have written a metadata record. Sums over the counters of such summaries do not overflow.
fn is_possible(name: &str, table: &Table) -> bool {
    name != Summary::NAME || from_table(table).is_none_or(|summary: Summary| summary.link.is_possible())
}

/// Returns whether this can be the beginning of a metadata record of `length` bytes.
pub(super) fn is_metadata(beginning: &[u8], length: u64) -> bool {
    let body = beginning.get(HEAD as usize..).unwrap_or_default();
    let Some((name, rest)) = body.split_first_chunk() else { return false };
    let name_length = u64::from(u32::from_le_bytes(*name));
    let table = usize::try_from(name_length).ok().and_then(|name_length| rest.get(name_length..)?.first_chunk());
    // The length of the table is beyond the beginning if the name is very long.
    table.is_some_and(|table| 8 + name_length + u64::from(u32::from_le_bytes(*table)) == length)
}

/// Returns whether this can be the beginning of an attachment of `length` bytes.
pub(super) fn is_attachment(beginning: &[u8], length: u64) -> bool {
    let data_length = || {
        // The times of its logging and its creation.
        let (name, rest) = beginning.get(16..)?.split_first_chunk()?;
        let (media_type, rest) = rest.get(u32::from_le_bytes(*name) as usize..)?.split_first_chunk()?;
        let rest = rest.get(u32::from_le_bytes(*media_type) as usize..)?;
        let (data, rest) = rest.split_first_chunk()?;
        u64::from_le_bytes(*data).checked_add((beginning.len() - rest.len()) as u64 + 4)
    };
    data_length() == Some(length)
}

/// Parses a header, which must be exactly as long as its texts.
pub(super) fn header(body: &[u8]) -> Option<Header> {
    match parse(op::HEADER, body) {
        Some(Record::Header(header)) if 8 + header.profile.len() + header.library.len() == body.len() => Some(header),
        _ => None,
    }
}

/// Returns the length of a metadata record. Four bytes of length precede every text and the table.
fn metadata_length(name: &str, table: &Table) -> usize {
    8 + name.len() + table.iter().map(|(key, value)| 8 + key.len() + value.len()).sum::<usize>()
}

/// Returns whether a message index is as long as it states.
pub(super) fn is_message_index(body: &[u8]) -> bool {
    match body {
        [_, _, a, b, c, d, entries @ ..] => entries.len() as u64 == u64::from(u32::from_le_bytes([*a, *b, *c, *d])),
        _ => false,
    }
}

/// The index at the end of a log.
#[derive(Clone, Copy, Default)]
pub(super) struct IndexState {
    /// Whether the CRC holds and the index is complete.
    pub(super) intact: bool,
    /// Whether the file ends with the magic, like a complete log.
    pub(super) complete: bool,
}

/// Checks the index, from the end of the data at `start` to the end of the file. `is_original`: whether biflag wrote
/// the file.
pub(super) fn check_index(index: &[u8], start: u64, is_original: bool) -> IndexState {
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
    let saved = u32::from_le_bytes([*a, *b, *c, *d]);
    // Files of other programs may lack the CRC and the index.
    let is_there = starts.starts_with(&start.to_le_bytes()) || !is_original && starts.starts_with(&[0; 8]);
    let holds = *head == op::FOOTER && is_there && (saved == crc.finalize() || !is_original && saved == 0);
    IndexState { intact: holds && complete, complete }
}
