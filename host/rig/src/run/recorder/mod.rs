//! Records everything that arrives over the link while a trial runs.

mod ask;

use super::error::{RecordError, fault_text};
use super::health::Health;
use super::readout::Readout;
use super::simulated::TruthRecorder;
use super::standing::Standing;
use crate::link::{Arrival, BoardClock, Event, Exchange, Link, LinkError, Monitor, PingClock, Received};
use biflag_log::{ClockMeta, CommandRecord, EventKind};
use protocol::units::CentiRpm;
use protocol::{Command, Fault, Reply, Request, Settings, State, TICK_HZ, Telemetry};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};
use study::lock::lock;
use study::plan::TICK_US;
use study::run;
use study::trial::{DAMAGED_FRAME, OPERATOR};

/// Notes of the user on their way into the log of the trial that runs, from the terminal and from the page.
pub type Notes = Arc<Mutex<Vec<String>>>;

/// A telemetry frame with the board's time, unwrapped.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Microseconds since the board's start.
    pub board_us: u64,
    /// Time of reception, on the host's clock.
    pub host: SystemTime,
    /// The frame.
    pub telemetry: Telemetry,
}

/// Returns the first of two failures, except that a fault takes precedence, because it explains more.
pub(super) fn first_failure(first: Result<(), RecordError>, next: Result<(), RecordError>) -> Result<(), RecordError> {
    match (&first, &next) {
        (Err(RecordError::Faulted(_)), _) => first,
        (_, Err(RecordError::Faulted(_))) => next,
        _ => first.and(next),
    }
}

/// Writes received events into a log and tracks the trial's time.
pub(super) struct Recorder<'a> {
    pub(super) link: &'a Link,
    pub(super) trial: run::Recorder,
    pub(super) settings: Settings,
    pub(super) monitor: Monitor,
    pub(super) health: Health,
    standing: Standing,
    /// Speeds over the last second.
    speeds: VecDeque<[CentiRpm; 2]>,
    /// Figures of the frames recorded so far.
    pub(super) readout: Readout,
    interrupted: &'a AtomicBool,
    /// Notes for the user at the end of the trial.
    pub(super) notes: Vec<String>,
    /// Notes of the user that are not in the log yet.
    pub(super) typed: Notes,
    /// Records the ground truth of a simulated robot.
    truth: Option<TruthRecorder<'a>>,
    /// The first frame of the next phase, already received.
    pending: Option<Frame>,
    /// Later frames that arrived while waiting for an answer.
    waiting: VecDeque<Frame>,
    /// The last phase whose frames are recorded while waiting for an answer; `None` while frames do not belong to the
    /// trial.
    pub(super) recorded_phase: Option<u8>,
    clock: BoardClock,
    /// The board's clock at the trial's first frame, µs.
    begun_us: u64,
    /// The board's clock at the end of the wait for a still robot, µs: the start of the plan.
    pub(super) rested_us: u64,
    /// The board's clock at the last recorded frame, µs; `None` before the first.
    reached_us: Option<u64>,
    pings: PingClock,
    state: (State, Fault),
    /// Whether a motor was driven in the last received frame.
    is_driven: bool,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(
        link: &'a Link,
        trial: run::Recorder,
        settings: Settings,
        interrupted: &'a AtomicBool,
        truth: Option<TruthRecorder<'a>>,
    ) -> Self {
        Self {
            link,
            trial,
            settings,
            monitor: Monitor::default(),
            health: Health::default(),
            standing: Standing::new(settings),
            speeds: VecDeque::new(),
            readout: Readout::new(link.info().imu_id),
            interrupted,
            notes: Vec::new(),
            typed: Notes::default(),
            truth,
            pending: None,
            waiting: VecDeque::new(),
            recorded_phase: None,
            clock: BoardClock::default(),
            begun_us: 0,
            rested_us: 0,
            reached_us: None,
            pings: PingClock::default(),
            state: (State::Idle, Fault::None),
            is_driven: false,
        }
    }

    /// Starts the telemetry and begins the trial with the first frame that has a fresh reading. The sensor takes a
    /// moment to start after new settings. A sensor that does not start causes a fault. The trial of a simulated robot
    /// begins at a sample of its shape, so its samples do not depend on the start of the telemetry. Returns the board's
    /// clock at this frame, µs.
    ///
    /// Earlier telemetry is discarded: another program may have left the board streaming.
    pub(super) fn begin(&mut self) -> Result<u64, RecordError> {
        // Events that arrive meanwhile may come from before a restart of the board, with another clock.
        let (stopped, _) = self.exchange(Command::Stream { rate_hz: 0 });
        stopped?;
        match self.exchange(Command::ClearFault).0 {
            // The cause persists; the first frame will state the fault.
            Ok(_) | Err(LinkError::Refused { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        while let Some(received) = self.link.next(Duration::ZERO) {
            self.take(received)?;
        }
        self.waiting.clear();
        self.clock = BoardClock::default();
        self.pings = PingClock::default();
        self.command(Command::Stream { rate_hz: TICK_HZ })?;
        loop {
            let frame = self.next_frame()?;
            (self.begun_us, self.rested_us) = (frame.board_us, frame.board_us);
            if frame.telemetry.fault != Fault::None {
                self.keep(frame)?;
            }
            // The shape of a simulated robot is sampled in some ticks only.
            let mut is_sampled = || self.truth.as_mut().map_or(Ok(true), |truth| truth.has_shape_in(frame.board_us));
            if frame.telemetry.imu_fresh && is_sampled()? {
                self.pending = Some(frame);
                return Ok(frame.board_us);
            }
        }
    }

    /// Discards the frames before the tick at `start_us`, so the trial begins at that tick.
    pub(super) fn skip_to(&mut self, start_us: u64) -> Result<(), RecordError> {
        loop {
            let frame = self.pending_or_next()?;
            self.begun_us = self.tick_of(&frame, start_us);
            self.rested_us = self.begun_us;
            if frame.telemetry.fault != Fault::None {
                self.keep(frame)?;
            }
            if frame.board_us + TICK_US / 2 >= start_us {
                self.pending = Some(frame);
                return Ok(());
            }
        }
    }

    /// Records until `ends` returns `true` for a frame. Returns this frame, which belongs to the next phase. `ends`
    /// also receives the readout of the earlier frames.
    pub(super) fn record_until(
        &mut self,
        mut ends: impl FnMut(&Frame, &Readout) -> bool,
    ) -> Result<Frame, RecordError> {
        loop {
            let frame = self.pending_or_next()?;
            if ends(&frame, &self.readout) {
                self.pending = Some(frame);
                return Ok(frame);
            }
            self.keep(frame)?;
        }
    }

    /// Records the next frame and returns it.
    pub(super) fn keep_next(&mut self) -> Result<Frame, RecordError> {
        let frame = self.pending_or_next()?;
        self.keep(frame)?;
        Ok(frame)
    }

    /// Returns whether an unrecorded frame has arrived.
    pub(super) fn has_frame(&mut self) -> Result<bool, RecordError> {
        while self.pending.is_none() && self.waiting.is_empty() {
            let Some(received) = self.link.next(Duration::ZERO) else { return Ok(false) };
            self.take_frame(received)?;
        }
        Ok(true)
    }

    /// Returns whether the user has interrupted the program.
    pub(super) fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }

    /// Counts the missing frames between the last one and the tick at `end_us`, which ends the trial. The frame after
    /// them does not belong to the trial.
    pub(super) fn end_at(&mut self, end_us: u64) -> Result<(), RecordError> {
        let (Some(first), Some(last_us)) = (&self.pending, self.reached_us) else { return Ok(()) };
        if self.monitor.is_next(&first.telemetry) {
            return Ok(());
        }
        let host = first.host;
        let missing = ((end_us.saturating_sub(last_us) + TICK_US / 2) / TICK_US).saturating_sub(1);
        if let Some(gap) = self.monitor.missing(u16::try_from(missing).unwrap_or(u16::MAX)) {
            self.trial.dropout(gap.first.0, u32::from(gap.count), host)?;
        }
        Ok(())
    }

    fn pending_or_next(&mut self) -> Result<Frame, RecordError> {
        self.pending.take().map_or_else(|| self.next_frame(), Ok)
    }

    /// Returns the time of the tick in which a phase began, given the first frame with its number. `planned_us` is the
    /// tick in the schedule, which is used if frames were lost.
    fn tick_of(&self, first: &Frame, planned_us: u64) -> u64 {
        let is_late = first.board_us > planned_us + TICK_US / 2;
        if is_late && !self.monitor.is_next(&first.telemetry) { planned_us } else { first.board_us }
    }

    /// Records an event; queues a telemetry frame.
    fn take_frame(&mut self, received: Received) -> Result<(), RecordError> {
        if let Some((telemetry, host)) = self.take(received)? {
            let board_us = self.clock.unwrap(telemetry.time).ok_or(RecordError::ClockJumped(None))?;
            self.is_driven = telemetry.duty.iter().any(|duty| duty.0 != 0);
            self.waiting.push_back(Frame { board_us, host, telemetry });
        }
        Ok(())
    }

    /// Returns the mean speeds of the flagella over the last second, which are unknown without encoders.
    pub(super) fn last_speeds(&self) -> [CentiRpm; 2] {
        if self.speeds.iter().any(|speeds| speeds.contains(&CentiRpm::UNKNOWN)) {
            return [CentiRpm::UNKNOWN; 2];
        }
        let count = self.speeds.len().max(1) as i32;
        let sum = |motor: usize| self.speeds.iter().map(|speeds| i32::from(speeds[motor].0)).sum::<i32>();
        [0, 1].map(|motor| CentiRpm((sum(motor) / count) as i16))
    }

    /// Measures the vertical while the robot hangs at rest. The yaw of the readout is relative to this time.
    pub(super) fn level(&mut self) -> Result<(), RecordError> {
        self.trial.level(SystemTime::now())?;
        self.readout.zero_yaw();
        Ok(())
    }

    /// Records an event at the current time.
    pub(super) fn event(&mut self, kind: EventKind, text: &str) -> Result<(), RecordError> {
        Ok(self.trial.event(kind, text, SystemTime::now())?)
    }

    /// Records the event that begins with the frame that ended the previous phase; `planned_us` is its tick in the
    /// schedule.
    pub(super) fn change(&mut self, kind: EventKind, text: &str, planned_us: u64) -> Result<(), RecordError> {
        if let Some(frame) = &self.pending {
            let tick_us = self.tick_of(frame, planned_us);
            self.trial.log.board_time(tick_us, frame.host);
        }
        self.event(kind, text)
    }

    /// Records the events already received, without waiting: replies to the last commands, and with `frames`, as after a
    /// failure, the frames that the board sent in the meantime.
    ///
    /// # Errors
    /// The first failure, after everything is recorded; a fault takes precedence.
    pub(super) fn drain(&mut self, frames: bool) -> Result<(), RecordError> {
        let mut outcome = Ok(());
        while let Some(received) = self.link.next(Duration::ZERO) {
            if matches!(received.event, Event::Closed) {
                break;
            }
            let taken = self.take_frame(received);
            outcome = first_failure(outcome, taken);
        }
        if frames {
            let waiting = std::mem::take(&mut self.waiting);
            for frame in self.pending.take().into_iter().chain(waiting) {
                outcome = first_failure(outcome, self.keep(frame));
            }
        }
        outcome
    }

    /// Records the ground truth of a simulated robot up to the last recorded frame.
    fn keep_truth(&mut self) -> Result<(), RecordError> {
        match (&mut self.truth, self.reached_us) {
            (Some(truth), Some(until_us)) => truth.keep(&mut self.trial, (self.begun_us, until_us)),
            _ => Ok(()),
        }
    }

    /// Records the ground truth up to the frame that ended the trial, so the number of samples does not depend on their
    /// times relative to the frames.
    pub(super) fn end_truth(&mut self) -> Result<(), RecordError> {
        if let Some(end) = &self.pending {
            self.reached_us = self.reached_us.max(end.board_us.checked_sub(1));
        }
        if let Some(truth) = &mut self.truth {
            truth.ask()?;
        }
        self.keep_truth()
    }

    fn next_frame(&mut self) -> Result<Frame, RecordError> {
        loop {
            if self.is_interrupted() {
                return Err(RecordError::Interrupted);
            }
            self.trial.log.tick()?;
            let typed = std::mem::take(&mut *lock(&self.typed));
            typed.iter().try_for_each(|text| self.event(EventKind::Note, &format!("{OPERATOR}{text}")))?;
            self.keep_truth()?;
            if let Some(frame) = self.waiting.pop_front() {
                return Ok(frame);
            }
            if let Some(received) = self.link.next(Duration::from_millis(20)) {
                self.take_frame(received)?;
            }
        }
    }

    /// Records a frame of the trial.
    fn keep(&mut self, frame: Frame) -> Result<(), RecordError> {
        match self.monitor.frame(&frame.telemetry) {
            Arrival::Next => {}
            Arrival::After(gap) => self.trial.dropout(gap.first.0, u32::from(gap.count), frame.host)?,
            Arrival::Repeated => return Ok(()),
        }
        self.health.frame(&frame.telemetry);
        let attitude = self.trial.frame(&frame.telemetry, frame.board_us, frame.host)?;
        self.readout.frame(&attitude, &frame.telemetry, self.monitor.stats.lost);
        self.reached_us = Some(frame.board_us);
        if self.speeds.len() == usize::from(TICK_HZ) {
            self.speeds.pop_front();
        }
        self.speeds.push_back(frame.telemetry.speed);
        let now = (frame.telemetry.state, frame.telemetry.fault);
        let before = std::mem::replace(&mut self.state, now);
        if now.0 != before.0 {
            self.trial.event(EventKind::State, &format!("{:?}", now.0), frame.host)?;
        }
        if now.1 != before.1 {
            self.trial.event(EventKind::Fault, &format!("{:?}: {}", now.1, fault_text(now.1)), frame.host)?;
        }
        let stands = self.standing.frame(&frame.telemetry, frame.board_us as f64 * 1e-6);
        match (now.1, stands) {
            (Fault::None, None) => Ok(()),
            (Fault::None, Some(motor)) => Err(RecordError::Standing(motor)),
            (fault, _) => Err(RecordError::Faulted(fault)),
        }
    }

    /// Records an event, or returns a telemetry frame with its time of reception.
    fn take(&mut self, received: Received) -> Result<Option<(Telemetry, SystemTime)>, RecordError> {
        let Received { wall: host, at, event } = received;
        match event {
            Event::Telemetry(telemetry) => {
                self.truth.iter_mut().for_each(TruthRecorder::hear);
                return Ok(Some((telemetry, host)));
            }
            Event::Raw(bytes) => self.trial.log.raw(&bytes, host)?,
            Event::Damaged(error) => {
                self.monitor.damaged(error);
                self.trial.event(EventKind::Warning, &format!("{DAMAGED_FRAME}: {error}"), host)?;
            }
            Event::Exchange(Exchange { request, attempts, reply, sent, sent_at }) => {
                if let (Some(Reply::Pong(board)), 1) = (reply, attempts) {
                    // After a restart the board's clock starts again, so the ping does not apply to the trial's clock.
                    if let Some(board_us) = self.clock.unwrap(board) {
                        self.pings.add(board_us, sent_at, at);
                    }
                } else {
                    self.monitor.asked(attempts);
                    let Request { seq, command } = request;
                    self.trial.command(&CommandRecord { seq, command, attempts, reply, sent, ended: host })?;
                }
            }
            Event::Silent { bytes } => {
                let is_silent = self.truth.as_mut().map_or(Ok(true), TruthRecorder::is_silent);
                if is_silent? {
                    return Err(RecordError::Silent { cause: None, bytes });
                }
            }
            Event::Closed => return Err(self.link.closed().into()),
        }
        Ok(None)
    }

    /// Returns the board's clock relative to the host's, if there were enough pings.
    pub(super) fn clock(&self) -> Option<ClockMeta> {
        self.pings.fit(self.link.opened)
    }
}
