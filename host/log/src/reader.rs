//! Reads a log message by message, holding one chunk in memory at a time.

use super::chunk::{Chunk, Entry};
use super::condition::{Condition, Loss};
use super::error::LogError;
use super::meta::{FORMAT, Identity, Summary};
use super::record::PROFILE;
use super::scan::{Piece, Scanner, last_table};
use super::schema::{self, Body};
use super::source::Source;
use super::table::{self, Meta, Table};
use super::time::seconds;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};

/// A message of a log.
#[derive(Clone, PartialEq, Debug)]
pub struct Message {
    /// The channel.
    pub topic: String,
    /// Sequence number on its channel.
    pub sequence: u32,
    /// The trial's clock, ns since 1970.
    pub log_time_ns: u64,
    /// The host's clock when it was received, ns since 1970.
    pub publish_time_ns: u64,
    /// The content.
    pub body: Body,
}

/// The trial's clock. The first telemetry frame determines its zero.
#[derive(Clone, Copy, Debug, Default)]
pub struct TrialClock {
    /// `log_time` at which the trial's clock was zero.
    zero_ns: Option<u64>,
}

impl TrialClock {
    /// Observes a message. Must be called with each message, in order.
    pub fn see(&mut self, message: &Message) {
        let time_s = match &message.body {
            Body::Telemetry(telemetry) => telemetry.time_s,
            // The log of an imported trial has no telemetry.
            Body::Truth(truth) => truth.time_s,
            _ => return,
        };
        let since_ns = (time_s * 1e9).round() as u64;
        self.zero_ns.get_or_insert(message.log_time_ns.saturating_sub(since_ns));
    }

    /// Returns the time of a message, s; 0 before the first message that contains its time.
    pub fn time_s(&self, message: &Message) -> f64 {
        seconds(message.log_time_ns.saturating_sub(self.zero_ns.unwrap_or(message.log_time_ns)))
    }
}

/// Returns the summary at the end of a log; `None` if the log is incomplete or has no summary.
///
/// # Errors
/// [`LogError::Read`], [`LogError::Missing`].
pub fn summary(path: &Path) -> Result<Option<Summary>, LogError> {
    last_meta(path)
}

/// Returns the last metadata record of a type; `None` if the log is incomplete or has no such record. In most logs this
/// only reads the index at the end.
///
/// # Errors
/// [`LogError::Read`], [`LogError::Missing`].
pub fn last_meta<M: Meta>(path: &Path) -> Result<Option<M>, LogError> {
    let table = last_table(open(path)?, M::NAME).map_err(|source| LogError::reading(path, source))?;
    Ok(table.as_ref().and_then(table::from_table))
}

/// Reads a whole log to check its condition; returns the unreadable parts.
///
/// # Errors
/// [`LogError`] if it is not a biflag log or cannot be read.
pub fn check(path: &Path) -> Result<Vec<Loss>, LogError> {
    // A log of a newer format is checked, too.
    let mut reader = Reader::over(path)?;
    while !matches!(reader.step()?, Step::End) {}
    Ok(reader.scanner.losses)
}

/// A log being read: an iterator over its messages, in the order in which they were written.
#[derive(Debug)]
pub struct Reader {
    path: PathBuf,
    scanner: Scanner<Source>,
    /// Topic and message type by channel number.
    channels: BTreeMap<u16, (String, String)>,
    schemas: BTreeMap<u16, String>,
    /// Every metadata record read so far.
    pub tables: BTreeMap<String, Table>,
    /// The rest of the current chunk.
    chunk: Chunk,
    /// The first message, if it precedes the identity of the program.
    first: Option<Message>,
    /// Number of messages read so far by channel, including channels that are not decoded.
    pub counts: BTreeMap<String, u64>,
    /// The channels to read; `None` for all.
    only: Option<Vec<&'static str>>,
}

impl Reader {
    /// Opens a log, even if it is damaged.
    ///
    /// # Errors
    /// [`LogError`] if it is not a biflag log, or has a newer format.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let mut reader = Self::over(path)?;
        // The channels and the identity of the program come first.
        while reader.first.is_none() && !reader.tables.contains_key(Identity::NAME) {
            match reader.step()? {
                Step::Message(message) => reader.first = Some(message),
                Step::Other => {}
                Step::End => break,
            }
        }
        // A program that rewrites a log may put the metadata at its end.
        if !reader.scanner.is_original && reader.meta::<Identity>().is_none() {
            let table = last_table(open(path)?, Identity::NAME).map_err(|source| LogError::reading(path, source))?;
            reader.tables.extend(table.map(|table| (Identity::NAME.to_owned(), table)));
        }
        match reader.meta::<Identity>() {
            Some(identity) if identity.format > FORMAT => {
                Err(LogError::Version { path: path.to_owned(), found: identity.format, program: identity.host_version })
            }
            // The header or the channels show that this is a biflag log, so the record is damaged.
            _ => Ok(reader),
        }
    }

    fn over(path: &Path) -> Result<Self, LogError> {
        let scanner = identify(open(path)?, path)?;
        let channels =
            schema::CHANNELS.iter().map(|spec| (spec.id, (spec.topic.to_owned(), spec.schema.to_owned()))).collect();
        Ok(Self {
            path: path.to_owned(),
            scanner,
            channels,
            schemas: BTreeMap::new(),
            tables: BTreeMap::new(),
            chunk: Chunk::default(),
            first: None,
            counts: BTreeMap::new(),
            only: None,
        })
    }

    /// Restricts the messages to these channels. A message of another channel that cannot be decoded is still a loss.
    #[must_use]
    pub fn only(mut self, topics: Vec<&'static str>) -> Self {
        self.first = self.first.filter(|message| topics.contains(&message.topic.as_str()));
        self.only = Some(topics);
        self
    }

    /// Reads on until a metadata record has been found; `None` if there is none in the rest of the log. The messages
    /// before it are skipped.
    ///
    /// # Errors
    /// [`LogError::Read`].
    pub fn read_until<M: Meta>(&mut self) -> Result<Option<M>, LogError> {
        while !self.tables.contains_key(M::NAME) && !matches!(self.step()?, Step::End) {}
        Ok(self.meta())
    }

    /// Returns a metadata record, if it has been read so far. The summary is the last record.
    pub fn meta<M: Meta>(&self) -> Option<M> {
        self.tables.get(M::NAME).and_then(table::from_table)
    }

    /// Computes the SHA-256 of the file while reading it.
    #[must_use]
    pub fn hashing(mut self) -> Self {
        self.scanner.source.hash();
        self
    }

    /// Returns the SHA-256 of the file in hexadecimal, as printed by `sha256sum`.
    ///
    /// # Errors
    /// [`LogError::Read`] if the rest of the file cannot be read.
    pub fn sha256(&mut self) -> Result<String, LogError> {
        self.scanner.source.sha256().map_err(|source| LogError::reading(&self.path, source))
    }

    /// Returns the condition of the log; `None` before the last message.
    pub fn condition(&self) -> Option<Condition> {
        self.scanner.condition
    }

    /// Returns the unreadable parts so far. The list is complete after the last message.
    pub fn losses(&self) -> &[Loss] {
        &self.scanner.losses
    }

    /// Returns the program that wrote the file, if it was not biflag.
    pub fn rewritten_by(&self) -> Option<&str> {
        let header = self.scanner.header.as_ref().filter(|_| !self.scanner.is_original)?;
        Some(if header.library.is_empty() { "another program" } else { &header.library })
    }

    /// Reads one more record.
    fn step(&mut self) -> Result<Step, LogError> {
        if let Some(entry) = self.chunk.next() {
            return Ok(self.take(entry).map_or(Step::Other, Step::Message));
        }
        match self.scanner.next().map_err(|source| LogError::reading(&self.path, source))? {
            None => return Ok(Step::End),
            Some(Piece::Metadata(name, table)) => {
                self.tables.insert(name, table);
            }
            Some(Piece::Chunk(chunk)) => self.chunk = chunk,
            Some(Piece::Attachment(..)) => {}
        }
        Ok(Step::Other)
    }

    /// Takes an entry of a chunk; returns the message, if the entry is a requested message.
    fn take(&mut self, entry: Entry) -> Option<Message> {
        match entry {
            Entry::Schema(header, _) => {
                self.schemas.insert(header.id, header.name);
            }
            Entry::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                // A type that was never declared is part of an earlier loss.
                if schema::channel(&channel.topic).is_some_and(|spec| !schema.is_empty() && spec.schema != schema) {
                    self.scanner.lose(self.scanner.offset, 0, "the type of a channel");
                }
                self.channels.insert(channel.id, (channel.topic, schema));
            }
            Entry::Message(header, data) => {
                let unknown = || (format!("channel {}", header.channel_id), String::new());
                let (topic, schema) = self.channels.entry(header.channel_id).or_insert_with(unknown);
                let wanted = self.only.as_ref().is_none_or(|only| only.contains(&topic.as_str()));
                // Damage is damage of the log, whichever channels are read.
                let body = Body::decode(topic, schema, data).unwrap_or_else(|data| {
                    let bytes = data.len() as u64;
                    self.scanner.lose(self.scanner.offset, bytes, "a message that cannot be decoded");
                    Body::Other(data)
                });
                match self.counts.get_mut(topic) {
                    Some(count) => *count += 1,
                    None => drop(self.counts.insert(topic.clone(), 1)),
                }
                return wanted.then(|| Message {
                    topic: topic.clone(),
                    sequence: header.sequence,
                    log_time_ns: header.log_time,
                    publish_time_ns: header.publish_time,
                    body,
                });
            }
        }
        None
    }
}

/// Result of reading one more record.
#[expect(clippy::large_enum_variant, reason = "most records are messages")]
enum Step {
    Message(Message),
    Other,
    End,
}

impl Iterator for Reader {
    type Item = Result<Message, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(message) = self.first.take() {
            return Some(Ok(message));
        }
        loop {
            match self.step() {
                Ok(Step::Message(message)) => return Some(Ok(message)),
                Ok(Step::Other) => {}
                Ok(Step::End) => return None,
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

/// Opens a file. Refuses folders, pipes and devices.
pub(super) fn open(path: &Path) -> Result<File, LogError> {
    let failed = |source| LogError::reading(path, source);
    // Opening a pipe would wait for its writer.
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        return Err(LogError::NotAFile { path: path.to_owned() });
    }
    File::open(path).map_err(failed)
}

/// Bytes to search for records of biflag. Files of other programs may be large, so only their beginning is searched.
const BEGINNING: u64 = 256 << 20;

/// Checks that a file is a biflag log, even if damaged, by its header or by the first records that can be read.
pub(super) fn identify(file: File, path: &Path) -> Result<Scanner<Source>, LogError> {
    let failed = |source| LogError::reading(path, source);
    let again = file.try_clone().map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    if length == 0 {
        return Err(LogError::Empty { path: path.to_owned() });
    }
    let mut scanner = Scanner::new(Source::new(file)).map_err(failed)?;
    let has_magic = scanner.losses.is_empty();
    if scanner.header.as_ref().is_some_and(|header| header.profile == PROFILE || scanner.is_original) {
        return Ok(scanner);
    }
    let mut pieces = 0;
    while scanner.offset < BEGINNING {
        let found = match scanner.next().map_err(failed)? {
            Some(Piece::Metadata(name, _)) => name == Identity::NAME,
            Some(Piece::Chunk(mut chunk)) => chunk.any(|entry| is_ours(&entry)),
            Some(Piece::Attachment(..)) => false,
            None => break,
        };
        if found {
            // Both handles share their position in the file, but the scanner seeks before every read.
            return Scanner::new(Source::new(again)).map_err(failed);
        }
        pieces += 1;
    }
    let path = path.to_owned();
    if !has_magic && !mcap::MAGIC.starts_with(&beginning(&again, length).map_err(failed)?) {
        Err(LogError::NotMcap { path })
    } else if pieces == 0 && length < 64 {
        Err(LogError::NothingLeft { path })
    } else {
        Err(LogError::NotOurs { path })
    }
}

fn beginning(mut file: &File, length: u64) -> std::io::Result<Vec<u8>> {
    use std::io::{Read, Seek};
    file.rewind()?;
    let mut bytes = vec![0; length.min(mcap::MAGIC.len() as u64) as usize];
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}

fn is_ours(entry: &Entry) -> bool {
    matches!(entry, Entry::Schema(header, _) if header.name.starts_with("biflag."))
}
