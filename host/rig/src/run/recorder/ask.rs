//! Sends requests during a trial, and records everything that arrives before the answer.

use super::{Frame, Recorder, first_failure};
use crate::link::LinkError;
use crate::run::error::RecordError;
use protocol::units::Micros;
use protocol::{Calibration, Command, Reply, ResetCause};
use std::time::{Duration, Instant};

/// Longest time that a frame is held back while waiting for an answer. Together with the flush interval of the log it
/// is less than the half second of data that may be lost.
const LONGEST_WAIT: Duration = Duration::from_millis(100);

/// Polling interval for an answer, the same as in the link's thread.
const ANSWER_POLL: Duration = Duration::from_millis(2);

/// Longest wait for a frame with the motors off. It follows the stop by one tick.
const OFF_TIMEOUT: Duration = Duration::from_millis(100);

impl Recorder<'_> {
    /// Requests the board's clock and returns it unwrapped. Must be called after [`Recorder::begin`].
    pub(in crate::run) fn board_now_us(&mut self) -> Result<u64, RecordError> {
        match self.ask(Command::Ping)? {
            Reply::Pong(now) => Ok(self.begun_us + u64::from(now.since(Micros(self.begun_us as u32)))),
            other => Err(self.link.wrong_answer(&Command::Ping, &other).into()),
        }
    }

    /// Sends a request answered with [`Reply::Done`].
    pub(in crate::run) fn command(&mut self, command: Command) -> Result<(), RecordError> {
        match self.ask(command)? {
            Reply::Done => Ok(()),
            other => Err(self.link.wrong_answer(&command, &other).into()),
        }
    }

    /// Reads the result of the last calibration of the gyroscope.
    pub(in crate::run) fn calibration(&mut self) -> Result<Calibration, RecordError> {
        match self.ask(Command::ReadCalibration)? {
            Reply::Calibration(calibration) => Ok(calibration),
            other => Err(self.link.wrong_answer(&Command::ReadCalibration, &other).into()),
        }
    }

    fn ask(&mut self, command: Command) -> Result<Reply, RecordError> {
        let (answer, meanwhile) = self.exchange(command);
        meanwhile?;
        Ok(answer?)
    }

    /// Sends a request. Returns the answer, and the first failure of the events recorded meanwhile: a board that
    /// answers late must not delay the log. The exchange itself is logged when the link reports it.
    pub(in crate::run) fn exchange(&mut self, command: Command) -> (Result<Reply, LinkError>, Result<(), RecordError>) {
        let asked = match self.link.send(command) {
            Ok(asked) => asked,
            Err(error) => return (Err(error), Ok(())),
        };
        let mut meanwhile = Ok(());
        loop {
            if let Some(answer) = self.link.answer(&asked) {
                return (answer, meanwhile);
            }
            // Phases above zero show that the schedule has started.
            let has_started = self.waiting.back().is_some_and(|frame| frame.telemetry.phase > 0);
            if matches!(command, Command::StartSchedule { .. }) && has_started {
                return (Ok(Reply::Done), meanwhile);
            }
            let recorded = self.hear(ANSWER_POLL);
            meanwhile = first_failure(meanwhile, recorded);
        }
    }

    /// Records events that arrive within `timeout` while waiting for an answer. Frames wait for the code that follows
    /// the phases, but no longer than the log allows.
    fn hear(&mut self, timeout: Duration) -> Result<(), RecordError> {
        let mut outcome = self.link.next(timeout).map_or(Ok(()), |received| self.take_frame(received));
        while let Some(frame) = self.overdue() {
            outcome = first_failure(outcome, self.keep(frame));
        }
        outcome.and(Ok(self.trial.log.tick()?))
    }

    /// Waits for a frame with both motors off, so a log that ends early shows when they stopped.
    pub(in crate::run) fn hear_off(&mut self) -> Result<(), RecordError> {
        let begun = Instant::now();
        while self.is_driven && begun.elapsed() < OFF_TIMEOUT {
            self.hear(ANSWER_POLL)?;
        }
        Ok(())
    }

    /// Takes the next frame if it has waited for too long.
    fn overdue(&mut self) -> Option<Frame> {
        let next = self.pending.as_ref().or(self.waiting.front())?;
        // If the wall clock is set back, the frame is overdue, too.
        let is_fresh = next.host.elapsed().is_ok_and(|age| age < LONGEST_WAIT);
        if is_fresh || self.recorded_phase.is_none_or(|last| next.telemetry.phase > last) {
            return None;
        }
        self.pending.take().or_else(|| self.waiting.pop_front())
    }

    /// Returns the cause of a restart of the board since the link was opened, if there was one.
    pub(in crate::run) fn restart(&mut self) -> Option<ResetCause> {
        match self.exchange(Command::Hello).0 {
            Ok(Reply::Info(info)) if info.boot_count != self.link.info().boot_count => Some(info.reset_cause),
            _ => None,
        }
    }
}
