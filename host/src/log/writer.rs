//! Writing a log while the trial runs.

use super::{ClockFit, LogError, Origin, Summary};
use crate::plan::{Plan, Trial};
use protocol::{Calibration, Command, Info, Reply, Settings, Telemetry};
use std::path::Path;
use std::time::SystemTime;

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

/// A command as it went.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CommandRecord {
    /// Its sequence number.
    pub seq: u8,
    /// The command.
    pub command: Command,
    /// How often it was sent.
    pub attempts: u32,
    /// What was answered; `None`: nothing in time.
    pub reply: Option<Reply>,
    /// When it was sent first.
    pub sent: SystemTime,
    /// When it was answered or given up.
    pub ended: SystemTime,
}

/// What an event is about.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum EventKind {
    /// A phase begins; the text is its name: `calibrate`, `preroll`, `run`, `decay`, `end`.
    Phase,
    /// The board's state changed.
    State,
    /// A fault was latched or cleared.
    Fault,
    /// A request was sent again.
    Retry,
    /// The gyroscope was calibrated.
    Calibration,
    /// The clocks were compared.
    Clock,
    /// Something that whoever reads the log should know.
    Warning,
    /// Anything else.
    Note,
}

/// A log being written.
///
/// Every 0.4 s what was written is closed as a chunk and brought to the disk, so that a killed program loses at most
/// half a second; [`Writer::tick`] does so when nothing comes.
#[derive(Debug)]
pub struct Writer {}

impl Writer {
    /// Starts a log at `path`, which must not exist.
    ///
    /// # Errors
    /// [`LogError::Exists`], [`LogError::Create`], [`LogError::Write`].
    pub fn create(path: &Path, start: &Start) -> Result<Self, LogError> {
        todo!("{path:?} {start:?}")
    }

    /// Keeps bytes from the board as they came.
    ///
    /// # Errors
    /// [`LogError::Write`], as for every function that writes.
    pub fn raw(&mut self, bytes: &[u8], host: SystemTime) -> Result<(), LogError> {
        todo!("{bytes:?} {host:?}")
    }

    /// Keeps a telemetry frame, as `/telemetry` and `/attitude`. `board_time_us` is the board's clock, unwrapped.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn telemetry(&mut self, frame: &Telemetry, board_time_us: u64, host: SystemTime) -> Result<(), LogError> {
        todo!("{frame:?} {board_time_us} {host:?}")
    }

    /// Keeps a command and what became of it.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn command(&mut self, record: &CommandRecord) -> Result<(), LogError> {
        todo!("{record:?}")
    }

    /// Keeps that `count` telemetry frames from the sequence number `first_seq` on did not come.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn dropout(&mut self, first_seq: u16, count: u32, host: SystemTime) -> Result<(), LogError> {
        todo!("{first_seq} {count} {host:?}")
    }

    /// Keeps an event.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn event(&mut self, kind: EventKind, text: &str, host: SystemTime) -> Result<(), LogError> {
        todo!("{kind:?} {text} {host:?}")
    }

    /// Keeps the result of the gyroscope's calibration. From here on its bias is taken off the angular rates.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn calibration(&mut self, calibration: &Calibration, host: SystemTime) -> Result<(), LogError> {
        todo!("{calibration:?} {host:?}")
    }

    /// Keeps how the clocks compare.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn clock(&mut self, fit: &ClockFit) -> Result<(), LogError> {
        todo!("{fit:?}")
    }

    /// Brings to the disk what is due. To be called at least every 0.1 s where nothing else is written.
    ///
    /// # Errors
    /// [`LogError::Write`]: now or in the background since the last call.
    pub fn tick(&mut self) -> Result<(), LogError> {
        todo!()
    }

    /// Ends the log with its summary, and has it on the disk on return.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn finish(self, summary: &Summary) -> Result<(), LogError> {
        todo!("{summary:?}")
    }
}
