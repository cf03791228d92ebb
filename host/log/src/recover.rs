//! Recovers an intact log from a damaged one.

use super::atomic_file::Draft;
use super::chunk::{Entry, MAX_RECORD};
use super::condition::{Condition, Loss};
use super::error::LogError;
use super::meta::RecoveryMeta;
use super::reader::{identify, open};
use super::record::parse;
use super::scan::{Piece, Scanner};
use super::schema;
use super::source::Source;
use super::table::{Meta, to_table};
use super::writer::{add_channel, io_error, options};
use mcap::Attachment;
use mcap::records::{AttachmentHeader, MessageHeader, Metadata, Record, op};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::Path;

/// Result of a recovery.
#[derive(Clone, PartialEq, Debug)]
pub struct Recovery {
    /// Condition of the damaged log.
    pub condition: Condition,
    /// The unreadable parts.
    pub losses: Vec<Loss>,
    /// Number of messages that were kept.
    pub messages: u64,
    /// Number of messages dropped because their channel is unknown.
    pub strays: u64,
}

/// Writes the readable part of the log at `from` to a new log at `to`, which must not exist. No unfinished log appears
/// at `to`.
///
/// # Errors
/// [`LogError`] if `from` is not a biflag log or `to` cannot be written.
pub fn recover(from: &Path, to: &Path) -> Result<Recovery, LogError> {
    let scanner = identify(open(from)?, from)?;
    if to.symlink_metadata().is_ok() {
        return Err(LogError::Exists { path: to.to_owned() });
    }
    let creating = |source| LogError::creating(to, source);
    let draft = Draft::create(to).map_err(creating)?;
    let file = draft.file.try_clone().map_err(creating)?;
    let recovery = copy(scanner, from, to, file)?;
    draft.publish(to).map_err(creating)?;
    Ok(recovery)
}

fn copy(mut scanner: Scanner<Source>, from: &Path, to: &Path, file: File) -> Result<Recovery, LogError> {
    let reading = |source| LogError::reading(from, source);
    let writing = |error| LogError::Create { path: to.to_owned(), source: io_error(error) };
    let mut copy = Copy::new(BufWriter::new(file)).map_err(writing)?;
    let mut left_out = Vec::new();
    while let Some(piece) = scanner.next().map_err(reading)? {
        match piece {
            Piece::Attachment(offset, bytes) if bytes > MAX_RECORD => {
                left_out.push(Loss { offset, bytes, what: "an attachment that is too long to copy" });
            }
            Piece::Attachment(offset, bytes) => {
                let record = scanner.bytes(offset, bytes).map_err(reading)?;
                copy.attachment(&record).map_err(writing)?;
            }
            Piece::Metadata(name, table) => copy.table(&name, table).map_err(writing)?,
            Piece::Chunk(mut chunk) => chunk.try_for_each(|entry| copy.entry(entry)).map_err(writing)?,
        }
    }
    let condition = scanner.condition.unwrap_or(Condition::Damaged);
    let losses = [&scanner.losses[..], &left_out].concat();
    if !losses.is_empty() {
        let lost = losses.iter().map(Loss::to_string).collect::<Vec<_>>().join("; ");
        let source = from.file_name().unwrap_or_default().to_string_lossy().into_owned();
        copy.table(RecoveryMeta::NAME, to_table(&RecoveryMeta { source, lost })).map_err(writing)?;
    }
    let Copy { mut writer, messages, strays, .. } = copy;
    writer.finish().map_err(writing)?;
    writer.into_inner().into_inner().map_err(|error| writing(error.into_error().into()))?;
    Ok(Recovery { condition, losses, messages, strays })
}

/// The new log while it is written.
struct Copy<W: Write + Seek> {
    writer: mcap::Writer<W>,
    /// Schemas of the old log by their number in it.
    schemas: BTreeMap<u16, (String, String, Vec<u8>)>,
    /// Channels of the new log by their number in the old one.
    channels: BTreeMap<u16, u16>,
    messages: u64,
    strays: u64,
}

impl<W: Write + Seek> Copy<W> {
    fn new(target: W) -> mcap::McapResult<Self> {
        let mut writer = options().create(target)?;
        let mut channels = BTreeMap::new();
        // The channels of biflag have fixed numbers, so they are known even if the chunk that declares them is lost.
        for channel in schema::CHANNELS {
            add_channel(&mut writer, channel)?;
            channels.insert(channel.id, channel.id);
        }
        Ok(Self { writer, schemas: BTreeMap::new(), channels, messages: 0, strays: 0 })
    }

    /// Copies an attachment, given its complete record.
    fn attachment(&mut self, record: &[u8]) -> mcap::McapResult<()> {
        let body = record.get(9..).unwrap_or_default();
        // The scanner has checked the record.
        if let Some(Record::Attachment { header, data, .. }) = parse(op::ATTACHMENT, body) {
            let AttachmentHeader { log_time, create_time, name, media_type } = header;
            self.writer.attach(&Attachment { log_time, create_time, name, media_type, data })?;
        }
        Ok(())
    }

    fn table(&mut self, name: &str, metadata: BTreeMap<String, String>) -> mcap::McapResult<()> {
        self.writer.write_metadata(&Metadata { name: name.to_owned(), metadata })
    }

    fn entry(&mut self, entry: Entry) -> mcap::McapResult<()> {
        match entry {
            Entry::Schema(header, data) => {
                self.schemas.insert(header.id, (header.name, header.encoding, data));
            }
            Entry::Channel(channel) => {
                let schema = match self.schemas.get(&channel.schema_id) {
                    Some((name, encoding, data)) => self.writer.add_schema(name, encoding, data)?,
                    None => 0,
                };
                let encoding = &channel.message_encoding;
                let id = self.writer.add_channel(schema, &channel.topic, encoding, &channel.metadata)?;
                self.channels.insert(channel.id, id);
            }
            Entry::Message(header, data) => match self.channels.get(&header.channel_id) {
                Some(&channel_id) => {
                    self.writer.write_to_known_channel(&MessageHeader { channel_id, ..header }, &data)?;
                    self.messages += 1;
                }
                None => self.strays += 1,
            },
        }
        Ok(())
    }
}
