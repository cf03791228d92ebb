//! Writing a log while the trial runs.

use super::convert::{self, CommandRecord, Converter, EventKind};
use super::disk::{self, Disk, create_file};
use super::meta::{
    BoardMeta, CalibrationMeta, ClockFit, Identity, LevelMeta, Origin, PlanMeta, RobotMeta, Summary, TrialMeta,
};
use super::schema::{self, ChannelSpec, LogMessage, biflag};
use super::table::{Meta, to_table};
use super::{LogError, PROFILE};
use crate::attitude::Reading;
use crate::plan::{Plan, Trial};
use protocol::{Calibration, Info, Settings, Telemetry};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// How often chunks are closed: half a second, less the time that a tick may come late.
const FLUSH_INTERVAL: Duration = Duration::from_millis(400);

/// What is known of a trial before it starts.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a> {
    /// The plan that it belongs to.
    pub plan: &'a Plan,
    /// The trial.
    pub trial: &'a Trial,
    /// Which attempt at it this is, from 1.
    pub attempt: u32,
    /// Where it is run.
    pub origin: Origin,
    /// The board that runs it, and its settings in force.
    pub board: Option<(Info, Settings)>,
    /// The host's clock.
    pub time: SystemTime,
}

/// A log being written.
///
/// Every 0.4 s what was written is closed as a chunk and brought to the disk, so that a killed program loses at most
/// half a second; [`Writer::tick`] does so when nothing comes. A modelled trial can be computed again, and its log must
/// not depend on how long that took: its chunks are closed by their size alone.
pub struct Writer {
    path: PathBuf,
    mcap: mcap::Writer<BufWriter<Disk>>,
    disk: Arc<disk::Status>,
    /// When chunks were closed last; `None`: time does not close them.
    flushed: Option<Instant>,
    converter: Converter,
    clock: Clock,
    /// Messages on each channel so far.
    sequences: BTreeMap<u16, u32>,
    tap: Option<Tap>,
}

/// Shown every message as it is written: its channel, its `log_time` in ns, and its bytes. The writer waits for it, so
/// it must not wait for anything itself.
pub type Tap = Box<dyn Fn(&ChannelSpec, u64, &[u8]) + Send>;

/// The trial's clock.
#[derive(Debug)]
struct Clock {
    /// `log_time` of what comes next and has no time of the board's.
    log_ns: u64,
    /// The board's clock and the `log_time` of the first telemetry frame.
    first: Option<(u64, u64)>,
}

impl Writer {
    /// Starts a log at `path`, which must not exist.
    ///
    /// # Errors
    /// [`LogError::Exists`], [`LogError::Create`], [`LogError::Write`].
    pub fn create(path: &Path, start: &Start) -> Result<Self, LogError> {
        let (info, settings) = start.board.unzip();
        let mut writer = Self::on(create_file(path)?, path, settings.unwrap_or_default(), start.time)?;
        if start.origin == Origin::Model {
            writer.flushed = None;
        }
        writer.meta(&Identity::now(start.origin, start.time))?;
        writer.meta(&PlanMeta::from(start.plan))?;
        writer.meta(&TrialMeta::new(start.trial, start.attempt))?;
        writer.meta(&RobotMeta { name: start.plan.robot.name.clone(), text: start.plan.robot.text.clone() })?;
        if let (Some(info), Some(settings)) = (info, settings) {
            writer.meta(&BoardMeta::new(&info, &settings))?;
        }
        writer.flush()?;
        Ok(writer)
    }

    pub(super) fn on(file: File, path: &Path, settings: Settings, time: SystemTime) -> Result<Self, LogError> {
        let failed = |source| LogError::Create { path: path.to_owned(), source };
        let disk = Disk::new(file).map_err(failed)?;
        let status = disk.status();
        let mcap = options().create(BufWriter::new(disk)).map_err(|error| failed(io_error(error)))?;
        let mut writer = Self {
            path: path.to_owned(),
            mcap,
            disk: status,
            flushed: Some(Instant::now()),
            converter: Converter::new(settings),
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

    /// Shows every message from here on to `tap` as well.
    pub fn tap(&mut self, tap: Tap) {
        self.tap = Some(tap);
    }

    /// Keeps bytes from the board as they came.
    ///
    /// # Errors
    /// [`LogError::Write`], as for every function that writes.
    pub fn raw(&mut self, bytes: &[u8], host: SystemTime) -> Result<(), LogError> {
        self.message(&biflag::RawBytes { data: bytes.to_vec() }, host)
    }

    /// Keeps a telemetry frame, as `/telemetry` and `/attitude`. `board_time_us` is the board's clock, unwrapped. Answers
    /// what is kept of the sensor, the attitude levelled where [`Writer::level`] was.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn telemetry(&mut self, frame: &Telemetry, board_time_us: u64, host: SystemTime) -> Result<Reading, LogError> {
        let elapsed_us = self.board_time(board_time_us, host);
        let message = self.converter.telemetry(frame, board_time_us, elapsed_us as f64 * 1e-6);
        self.state_at(&message, host)?;
        Ok(Reading::of(&message).unwrap_or_default())
    }

    /// Puts the trial's clock to the board's; answers the time since the trial's first frame, µs.
    pub fn board_time(&mut self, board_time_us: u64, host: SystemTime) -> u64 {
        let (first_us, first_ns) = *self.clock.first.get_or_insert((board_time_us, self.clock.log_ns.max(nanos(host))));
        let elapsed_us = board_time_us.saturating_sub(first_us);
        self.clock.log_ns = first_ns.saturating_add(elapsed_us.saturating_mul(1000));
        elapsed_us
    }

    /// Keeps a state that no board sent, but a model computed. Its `time_s` is the trial's clock.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn model_state(&mut self, state: &biflag::Telemetry, host: SystemTime) -> Result<(), LogError> {
        self.at(state.time_s);
        self.state_at(state, host)
    }

    /// Puts the trial's clock to `time_s` since its start, where no frame of a board does: in a model.
    pub fn at(&mut self, time_s: f64) {
        self.clock.first.get_or_insert((0, self.clock.log_ns));
        self.clock.log_ns = self.time_ns(time_s);
    }

    /// `log_time` of what happens `time_s` after the trial's first frame: what a message says whose type has a time of its
    /// own, ns since 1970.
    pub fn time_ns(&self, time_s: f64) -> u64 {
        let first_ns = self.clock.first.map_or(self.clock.log_ns, |(_, first_ns)| first_ns);
        first_ns.saturating_add((time_s * 1e9).round() as u64)
    }

    fn state_at(&mut self, state: &biflag::Telemetry, host: SystemTime) -> Result<(), LogError> {
        self.message(state, host)?;
        match &state.attitude {
            Some(attitude) => self.message(&convert::frame_transform(attitude, self.clock.log_ns), host),
            None => Ok(()),
        }
    }

    /// Keeps a command and what became of it.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn command(&mut self, record: &CommandRecord) -> Result<(), LogError> {
        self.message(&convert::command(record), record.ended)
    }

    /// Keeps that `count` telemetry frames from the sequence number `first_seq` on did not come.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn dropout(&mut self, first_seq: u16, count: u32, host: SystemTime) -> Result<(), LogError> {
        self.message(&biflag::Dropout { first_seq: first_seq.into(), count }, host)
    }

    /// Keeps an event.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn event(&mut self, kind: EventKind, text: &str, host: SystemTime) -> Result<(), LogError> {
        self.message(&convert::event(kind, text), host)
    }

    /// Keeps the result of the gyroscope's calibration. From here on its bias is taken off the angular rates.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn calibration(&mut self, calibration: &Calibration, host: SystemTime) -> Result<(), LogError> {
        self.converter.calibrate(calibration);
        let Calibration { still, bias: bias_counts, noise: noise_counts, samples } = *calibration;
        let [x, y, z] = bias_counts;
        let moved = if still { "" } else { "; the sensor moved, so the bias before stays" };
        let text = format!("bias {x:.2} {y:.2} {z:.2} counts, noise {noise_counts}, {samples} readings{moved}");
        self.event(EventKind::Calibration, &text, host)?;
        self.meta(&CalibrationMeta { still, bias_counts, noise_counts, samples })
    }

    /// The robot has hung at rest until now. From here on the tilt that the accelerometer saw of it is taken off the
    /// attitude, where that is small enough to be its bias. `None` where nothing is taken off.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn level(&mut self, host: SystemTime) -> Result<Option<LevelMeta>, LogError> {
        let Some(level) = self.converter.level() else { return Ok(None) };
        let done = if level.used { "levelled by" } else { "not levelled: hangs askew by" };
        self.event(EventKind::Note, &format!("{done} {:.2}°", level.tilt_deg), host)?;
        self.meta(&level)?;
        Ok(level.used.then_some(level))
    }

    /// Keeps how the clocks compare.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn clock(&mut self, fit: &ClockFit) -> Result<(), LogError> {
        self.meta(fit)
    }

    /// Keeps a message at the trial's present time.
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

    /// Keeps a message at a time of the trial, s since its first frame, which is there already. What comes next keeps its
    /// own time.
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

    /// Keeps a metadata record.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn meta<M: Meta>(&mut self, meta: &M) -> Result<(), LogError> {
        let record = mcap::records::Metadata { name: M::NAME.to_owned(), metadata: to_table(meta) };
        let written = self.mcap.write_metadata(&record);
        self.check(written)
    }

    /// Brings to the disk what is due. To be called at least every 0.1 s where nothing else is written.
    ///
    /// # Errors
    /// [`LogError::Write`]: now or in the background since the last call.
    pub fn tick(&mut self) -> Result<(), LogError> {
        if self.flushed.is_none_or(|flushed| flushed.elapsed() < FLUSH_INTERVAL) { Ok(()) } else { self.flush() }
    }

    pub(super) fn flush(&mut self) -> Result<(), LogError> {
        self.flushed = self.flushed.map(|_| Instant::now());
        let flushed = self.mcap.flush();
        self.check(flushed)?;
        match self.disk.take_error() {
            Some(error) => Err(self.error(error)),
            None => Ok(()),
        }
    }

    /// Ends the log with its summary, and has it on the disk on return.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn finish(mut self, summary: &Summary) -> Result<(), LogError> {
        self.meta(summary)?;
        let finished = self.mcap.finish().map(drop);
        self.check(finished)?;
        let Self { path, mcap, disk, .. } = self;
        let synced = mcap.into_inner().into_inner().map_err(std::io::IntoInnerError::into_error).and_then(Disk::finish);
        synced.map_err(|source| LogError::Write { path, kept: disk.written(), source })
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

/// How logs are written. Chunks are put together in memory and written whole, so that a killed writer leaves none that
/// is half done; they are compressed without threads, because they are small.
pub(super) fn options() -> mcap::WriteOptions {
    mcap::WriteOptions::new()
        .profile(PROFILE)
        .library(format!("biflag {}", env!("CARGO_PKG_VERSION")))
        .compression(Some(mcap::Compression::Zstd))
        .compression_threads(0)
        .disable_seeking(true)
}

/// Introduces a channel with its fixed number.
pub(super) fn add_channel<W: Write + Seek>(
    writer: &mut mcap::Writer<W>,
    channel: &ChannelSpec,
) -> mcap::McapResult<()> {
    let schema = writer.add_schema(channel.schema, "protobuf", channel.descriptors)?;
    writer.add_channel_with_id(channel.id, schema, channel.topic, "protobuf", &BTreeMap::new())?;
    Ok(())
}

pub(super) fn io_error(error: mcap::McapError) -> std::io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => std::io::Error::other(other),
    }
}

fn nanos(time: SystemTime) -> u64 {
    let since = time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}
