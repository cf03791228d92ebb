//! Writes a log while the trial runs.

use super::convert::{self, CommandRecord};
use super::disk::{self, Disk, create_file};
use super::error::LogError;
use super::meta::{BoardMeta, CalibrationMeta, Identity, MeasuredSensorMeta, PlanMeta, RobotMeta, Summary, TrialMeta};
use super::record::PROFILE;
use super::schema::{self, ChannelSpec, LogMessage, biflag, biflag::event::Kind};
use super::table::{Meta, to_table};
use super::time::{LONGEST_TRIAL_S, seconds};
use protocol::Calibration;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// Interval at which chunks are closed: half of the half second that may be lost, so that a busy computer meets that
/// limit, too.
const FLUSH_INTERVAL: Duration = Duration::from_millis(250);

/// The first records of a log: everything known before the trial starts.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Start {
    /// The program that writes the log, and where the trial runs.
    pub identity: Identity,
    /// The plan that the trial belongs to.
    pub plan: PlanMeta,
    /// The trial.
    pub trial: TrialMeta,
    /// The robot's file.
    pub robot: RobotMeta,
    /// The board, with its settings.
    pub board: Option<BoardMeta>,
    /// The measured errors of its sensor.
    pub sensor: Option<MeasuredSensorMeta>,
}

/// A log being written.
///
/// Every quarter of a second the current chunk is closed, and a separate thread writes and syncs it, so a killed
/// program loses at most half a second; [`Writer::tick`] closes it when no message arrives. A slow disk delays nothing
/// for minutes, because pending chunks are kept in memory. A modelled or imported trial can be written again, and its
/// log must not depend on the computing time: its chunks are only closed by size.
pub struct Writer {
    path: PathBuf,
    mcap: mcap::Writer<BufWriter<Disk>>,
    disk: Arc<disk::Status>,
    /// When a chunk was last closed; `None` if chunks are only closed by size.
    flushed: Option<Instant>,
    clock: Clock,
    /// Number of messages on each channel so far.
    sequences: BTreeMap<u16, u32>,
    tap: Option<Tap>,
}

/// A function called with every message as it is written: its channel, its `log_time` in ns, and its bytes. It runs on
/// the writer's thread, so it must not block.
pub type Tap = Box<dyn Fn(&ChannelSpec, u64, &[u8]) + Send>;

/// The trial's clock.
#[derive(Debug)]
struct Clock {
    /// `log_time` of the next message without the board's time.
    log_ns: u64,
    /// The board's clock and the `log_time` of the first telemetry frame.
    first: Option<(u64, u64)>,
}

impl Writer {
    /// Starts a log at `path`, which must not exist. `time` is the host's clock.
    ///
    /// # Errors
    /// [`LogError::Exists`], [`LogError::Create`], [`LogError::Write`].
    pub fn create(path: &Path, start: &Start, time: SystemTime) -> Result<Self, LogError> {
        let mut writer = Self::on(create_file(path)?, path, time)?;
        if !start.identity.origin.is_recorded() {
            writer.flushed = None;
        }
        writer.meta(&start.identity)?;
        writer.meta(&start.plan)?;
        writer.meta(&start.trial)?;
        writer.meta(&start.robot)?;
        start.board.iter().try_for_each(|board| writer.meta(board))?;
        start.sensor.iter().try_for_each(|sensor| writer.meta(sensor))?;
        writer.flush()?;
        // Report a full disk now, not when the motors turn.
        writer.settle()?;
        Ok(writer)
    }

    pub(super) fn on(file: File, path: &Path, time: SystemTime) -> Result<Self, LogError> {
        let failed = |source| LogError::Create { path: path.to_owned(), source };
        let disk = Disk::new(file).map_err(failed)?;
        let status = disk.status();
        let mcap = options().create(BufWriter::new(disk)).map_err(|error| failed(io_error(error)))?;
        let mut writer = Self {
            path: path.to_owned(),
            mcap,
            disk: status,
            flushed: Some(Instant::now()),
            clock: Clock { log_ns: nanos(time), first: None },
            sequences: BTreeMap::new(),
            tap: None,
        };
        for channel in schema::CHANNELS {
            let added = add_channel(&mut writer.mcap, channel);
            writer.check(added)?;
        }
        Ok(writer)
    }

    /// Passes every message from here on to `tap` as well.
    pub fn tap(&mut self, tap: Tap) {
        self.tap = Some(tap);
    }

    /// Writes bytes from the board as received.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn raw(&mut self, bytes: &[u8], host: SystemTime) -> Result<(), LogError> {
        self.message(&biflag::RawBytes { data: bytes.to_vec() }, host)
    }

    /// Sets the trial's clock from the board's. Returns the time since the trial's first frame, µs.
    pub fn board_time(&mut self, board_time_us: u64, host: SystemTime) -> u64 {
        let (first_us, first_ns) = *self.clock.first.get_or_insert((board_time_us, self.clock.log_ns.max(nanos(host))));
        let elapsed_us = board_time_us.saturating_sub(first_us);
        self.clock.log_ns = first_ns.saturating_add(elapsed_us.saturating_mul(1000));
        elapsed_us
    }

    /// Sets the trial's clock to `time_s` since its start. For models, which have no board.
    pub fn at(&mut self, time_s: f64) {
        self.clock.first.get_or_insert((0, self.clock.log_ns));
        self.clock.log_ns = self.time_ns(time_s);
    }

    /// Returns the trial's current time, s since its first frame.
    pub fn time_s(&self) -> f64 {
        self.clock.first.map_or(0.0, |(_, first_ns)| seconds(self.clock.log_ns.saturating_sub(first_ns)))
    }

    /// Returns the trial's time at a time of the board's clock, s since its first frame.
    pub fn time_of_board_s(&self, board_time_us: u64) -> f64 {
        self.clock.first.map_or(0.0, |(first_us, _)| board_time_us.saturating_sub(first_us) as f64 * 1e-6)
    }

    /// Returns the `log_time` that corresponds to `time_s` after the trial's first frame, ns since 1970. For message
    /// types that contain an absolute time.
    pub fn time_ns(&self, time_s: f64) -> u64 {
        let first_ns = self.clock.first.map_or(self.clock.log_ns, |(_, first_ns)| first_ns);
        first_ns.saturating_add((time_s * 1e9).round() as u64)
    }

    /// Writes a command and its reply.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn command(&mut self, record: &CommandRecord) -> Result<(), LogError> {
        self.message(&convert::command(record), record.ended)
    }

    /// Writes that `count` telemetry frames were lost, starting with the sequence number `first_seq`.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn dropout(&mut self, first_seq: u16, count: u32, host: SystemTime) -> Result<(), LogError> {
        self.message(&biflag::Dropout { first_seq: first_seq.into(), count }, host)
    }

    /// Writes an event.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn event(&mut self, kind: Kind, text: &str, host: SystemTime) -> Result<(), LogError> {
        self.message(&convert::event(kind, text), host)
    }

    /// Writes the result of the gyroscope's calibration.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn calibration(&mut self, calibration: &Calibration, host: SystemTime) -> Result<(), LogError> {
        let Calibration { still, bias: bias_counts, noise: noise_counts, samples } = *calibration;
        let [x, y, z] = bias_counts;
        let moved = if still { "" } else { "; the sensor moved, so the previous bias is kept" };
        let text = format!("bias {x:.2} {y:.2} {z:.2} counts, noise {noise_counts}, {samples} readings{moved}");
        self.event(Kind::Calibration, &text, host)?;
        self.meta(&CalibrationMeta { still, bias_counts, noise_counts, samples })
    }

    /// Writes a message at the trial's current time.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn message<M: LogMessage>(&mut self, message: &M, host: SystemTime) -> Result<(), LogError> {
        let channel_id = M::CHANNEL.id;
        let sequence = self.sequences.entry(channel_id).or_default();
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: *sequence,
            log_time: self.clock.log_ns,
            publish_time: nanos(host),
        };
        *sequence = sequence.wrapping_add(1);
        let bytes = message.encode_to_vec();
        let written = self.mcap.write_to_known_channel(&header, &bytes);
        self.check(written)?;
        if let Some(tap) = &self.tap {
            tap(&M::CHANNEL, header.log_time, &bytes);
        }
        self.tick()
    }

    /// Writes a message at `time_s` since the trial's first frame, which must have been written. The trial's clock is
    /// unchanged.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn message_at<M: LogMessage>(&mut self, time_s: f64, message: &M, host: SystemTime) -> Result<(), LogError> {
        let now_ns = self.clock.log_ns;
        self.at(time_s);
        let written = self.message(message, host);
        self.clock.log_ns = now_ns;
        written
    }

    /// Writes a metadata record.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn meta<M: Meta>(&mut self, meta: &M) -> Result<(), LogError> {
        let record = mcap::records::Metadata { name: M::NAME.to_owned(), metadata: to_table(meta) };
        let written = self.mcap.write_metadata(&record);
        self.check(written)
    }

    /// Closes a chunk if it is due. Must be called at least every 0.1 s if nothing else is written.
    ///
    /// # Errors
    /// [`LogError::Write`] for failures since the last call.
    pub fn tick(&mut self) -> Result<(), LogError> {
        if self.flushed.is_none_or(|flushed| flushed.elapsed() < FLUSH_INTERVAL) { Ok(()) } else { self.flush() }
    }

    /// Waits until everything flushed is in the file; returns the longest time that a write or a sync has taken.
    pub fn slowest_write(&self) -> Duration {
        self.disk.wait_for(0);
        self.disk.slowest()
    }

    pub(super) fn flush(&mut self) -> Result<(), LogError> {
        self.flushed = self.flushed.map(|_| Instant::now());
        let flushed = self.mcap.flush();
        self.check(flushed)?;
        self.take_error()
    }

    /// Waits until everything flushed is in the file.
    pub(super) fn settle(&self) -> Result<(), LogError> {
        self.disk.wait_for(0);
        self.take_error()
    }

    fn take_error(&self) -> Result<(), LogError> {
        self.disk.take_error().map_or(Ok(()), |error| Err(self.error(error)))
    }

    /// Ends the log with its summary, syncs it, and reads it back.
    ///
    /// # Errors
    /// [`LogError::Write`], and [`LogError::Changed`] if the file differs from the written content.
    pub fn finish(mut self, summary: &Summary) -> Result<(), LogError> {
        self.meta(summary)?;
        let finished = self.mcap.finish().map(drop);
        self.check(finished)?;
        let Self { path, mcap, disk, .. } = self;
        let synced = mcap.into_inner().into_inner().map_err(std::io::IntoInnerError::into_error).and_then(Disk::finish);
        let difference = synced.and_then(|content| content.difference(&path));
        match difference {
            Ok(None) => Ok(()),
            Ok(Some(how)) => Err(LogError::Changed { path, how }),
            Err(source) => Err(LogError::Write { path, kept: disk.written(), source }),
        }
    }

    fn check<T>(&self, result: mcap::McapResult<T>) -> Result<(), LogError> {
        result.map(drop).map_err(|error| self.error(io_error(error)))
    }

    fn error(&self, source: std::io::Error) -> LogError {
        LogError::Write { path: self.path.clone(), kept: self.disk.written(), source }
    }
}

impl std::fmt::Debug for Writer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Writer").field("path", &self.path).field("clock", &self.clock).finish_non_exhaustive()
    }
}

/// Returns the options of the MCAP writer. Chunks are assembled in memory and written in one piece, so a killed writer
/// leaves no partial chunk. They are compressed without threads, because they are small.
pub(super) fn options() -> mcap::WriteOptions {
    mcap::WriteOptions::new()
        .profile(PROFILE)
        .library(format!("biflag {}", env!("CARGO_PKG_VERSION")))
        .compression(Some(mcap::Compression::Zstd))
        .compression_threads(0)
        .disable_seeking(true)
}

/// Declares a channel with its fixed number.
pub(super) fn add_channel<W: Write + Seek>(
    writer: &mut mcap::Writer<W>,
    channel: &ChannelSpec,
) -> mcap::McapResult<()> {
    let schema = writer.add_schema(channel.schema, "protobuf", channel.descriptors)?;
    writer.add_channel_with_id(channel.id, schema, channel.topic, "protobuf", &BTreeMap::new()).map(drop)
}

pub(super) fn io_error(error: mcap::McapError) -> std::io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => std::io::Error::other(other),
    }
}

/// Returns nanoseconds since 1970, limited so that even a clock that is wrong by centuries leaves room for the longest
/// trial.
fn nanos(time: SystemTime) -> u64 {
    let last = u64::MAX - (2.0 * LONGEST_TRIAL_S * 1e9) as u64;
    let since = time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).map_or(last, |ns| ns.min(last))
}
