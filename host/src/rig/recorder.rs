//! From the link into the log: everything that comes while a trial runs.

use super::simulated::Truth;
use super::virtual_nano::VirtualError;
use crate::attitude::{PhaseTimes, Series};
use crate::link::{BoardClock, Event, Exchange, Link, LinkError, Monitor, PingClock, Received};
use crate::log::{ClockFit, CommandRecord, EventKind, LogError, Writer};
use miette::Diagnostic;
use protocol::units::CentiRpm;
use protocol::{Calibration, Command, Fault, Reply, Request, ResetCause, State, TICK_HZ, Telemetry};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};
use thiserror::Error;

/// Why a trial did not go through all of its phases.
#[derive(Debug, Error, Diagnostic)]
pub enum RecordError {
    /// The user wants to stop.
    #[error("interrupted")]
    Interrupted,
    /// The board latched a fault and stopped the motors.
    #[error("the board stopped: {}", fault_text(*.0))]
    #[diagnostic(help("{}; then go on with --resume", fault_cure(*.0)))]
    Faulted(Fault),
    /// The board's clock is not the one that the trial began with.
    #[error("the board's clock leapt in the middle of the trial{}", restart_text(.0))]
    #[diagnostic(help("{}; then go on with --resume", leap_cure(*.0)))]
    Leapt(Option<ResetCause>),
    /// The board is not as the session prepared it.
    #[error("the board lost its settings before the trial{}", restart_text(&Some(*.0)))]
    #[diagnostic(help("{}; then go on with --resume", silence_cure(Some(*.0))))]
    Restarted(ResetCause),
    /// The stream ended.
    #[error("the board stopped sending{}", restart_text(.0))]
    #[diagnostic(help("{}; then go on with --resume", silence_cure(*.0)))]
    Silent(Option<ResetCause>),
    /// The link failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Link(#[from] LinkError),
    /// The log could not be written.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Log(#[from] LogError),
    /// The emulated board, or the simulated robot behind it, failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Virtual(#[from] VirtualError),
}

/// A fault in words.
pub fn fault_text(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "no fault",
        Fault::LinkLost => "it heard nothing from the host for longer than the motors' deadline",
        Fault::Hang => "its program hung and was started again",
        Fault::Panic => "its program met a state that must not be and started again",
        Fault::ImuSilent => "the IMU does not answer",
        Fault::ImuBusStuck => "the IMU's bus is stuck",
        Fault::ImuFrozen => "the IMU sends the same data again and again",
        Fault::Motor1Stalled => "motor 1 is driven hard and does not turn",
        Fault::Motor2Stalled => "motor 2 is driven hard and does not turn",
    }
}

fn fault_cure(fault: Fault) -> &'static str {
    match fault {
        Fault::None => "nothing is wrong",
        Fault::LinkLost => "free this computer of other heavy work, or raise the board's deadline_ms",
        Fault::Hang | Fault::Panic => "please report it with the log",
        Fault::ImuSilent | Fault::ImuBusStuck | Fault::ImuFrozen => {
            "check the MPU6050's wires (SCL on A5, SDA on A4) and its supply"
        }
        Fault::Motor1Stalled | Fault::Motor2Stalled => {
            "check that the flagellum turns freely, the motor's supply, and the encoder's wires"
        }
    }
}

fn silence_cure(cause: Option<ResetCause>) -> &'static str {
    match cause {
        Some(ResetCause::Hang) => fault_cure(Fault::Hang),
        Some(ResetCause::Panic) => fault_cure(Fault::Panic),
        _ => "check the supply of board and motors, and the cable",
    }
}

fn leap_cure(cause: Option<ResetCause>) -> &'static str {
    match cause {
        Some(_) => silence_cure(cause),
        None => "keep this computer from sleeping while it records",
    }
}

fn restart_text(cause: &Option<ResetCause>) -> String {
    match cause {
        Some(ResetCause::BrownOut) => ": it restarted because its supply sagged".into(),
        Some(cause) => format!(": it restarted ({cause:?})"),
        None => String::new(),
    }
}

/// A frame of the stream with the board's time, unwrapped.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// Microseconds since the board's start.
    pub board_us: u64,
    /// Seconds since the trial's first frame.
    pub time_s: f64,
    /// When it came, on the host's clock.
    pub host: SystemTime,
    /// The frame.
    pub telemetry: Telemetry,
}

/// No stream for so long, and the trial is lost. The slowest that the emulated board runs still gives many frames.
const SILENCE: Duration = Duration::from_secs(1);

/// Writes what comes into a log, and follows the trial's time.
pub(super) struct Recorder<'a> {
    pub(super) link: &'a Link,
    pub(super) log: Writer,
    pub(super) monitor: Monitor,
    /// The attitude over the trial, for what is said of it right after it.
    pub(super) attitude: Series,
    /// When its phases were.
    pub(super) times: PhaseTimes,
    /// Speeds over the last second.
    speeds: VecDeque<[CentiRpm; 2]>,
    interrupted: &'a AtomicBool,
    /// Of a simulated robot.
    truth: Option<Truth<'a>>,
    /// The frame that ended a phase, which is the first of the next one.
    ahead: Option<Frame>,
    clock: BoardClock,
    /// The board's clock at the trial's first frame, µs.
    begun_us: u64,
    /// The board's clock at the last frame that was kept, µs; `None` before the first.
    reached_us: Option<u64>,
    pings: PingClock,
    last_heard: Instant,
    state: (State, Fault),
}

impl<'a> Recorder<'a> {
    pub(super) fn new(link: &'a Link, log: Writer, interrupted: &'a AtomicBool, truth: Option<Truth<'a>>) -> Self {
        Self {
            link,
            log,
            monitor: Monitor::default(),
            attitude: Series::default(),
            times: PhaseTimes::default(),
            speeds: VecDeque::new(),
            interrupted,
            truth,
            ahead: None,
            clock: BoardClock::default(),
            begun_us: 0,
            reached_us: None,
            pings: PingClock::default(),
            last_heard: Instant::now(),
            state: (State::Idle, Fault::None),
        }
    }

    /// Starts the stream and begins the trial with its first frame that bears a fresh reading of the sensor, which takes
    /// a moment to start after new settings. A sensor that does not start becomes a fault. A simulated robot's trial
    /// begins where its shape is sampled, so that its samples are at the same times whenever the stream started.
    ///
    /// What the board sent before belongs to no trial: another program may have left it streaming.
    pub(super) fn begin(&mut self) -> Result<(), RecordError> {
        self.command(Command::Stream { rate_hz: 0 })?;
        match self.command(Command::ClearFault) {
            // Its cause lasts; the first frame tells which fault it is.
            Ok(()) | Err(RecordError::Link(LinkError::Refused { .. })) => {}
            Err(error) => return Err(error),
        }
        while let Some(received) = self.link.next(Duration::ZERO) {
            self.take(received)?;
        }
        // Some of it may be of another start of the board, by another clock.
        self.clock = BoardClock::default();
        self.pings = PingClock::default();
        self.command(Command::Stream { rate_hz: TICK_HZ })?;
        self.last_heard = Instant::now();
        loop {
            let frame = self.next_frame()?;
            let fresh = frame.telemetry.imu_fresh && self.is_sampled(&frame)?;
            if fresh || frame.telemetry.fault != Fault::None {
                self.begun_us = frame.board_us;
                self.ahead = Some(Frame { time_s: 0.0, ..frame });
                return Ok(());
            }
        }
    }

    /// Keeps what comes until a frame that `ends` this phase and belongs to the next one; answers its time, s.
    pub(super) fn until(&mut self, mut ends: impl FnMut(&Frame) -> bool) -> Result<f64, RecordError> {
        loop {
            let frame = match self.ahead.take() {
                Some(frame) => frame,
                None => self.next_frame()?,
            };
            if ends(&frame) {
                self.ahead = Some(frame);
                return Ok(frame.time_s);
            }
            self.keep(frame)?;
        }
    }

    /// Sends a command of the trial; it is logged with the next thing that is taken from the link.
    pub(super) fn command(&mut self, command: Command) -> Result<(), RecordError> {
        Ok(self.link.command(command)?)
    }

    /// The result of the last calibration of the gyroscope.
    pub(super) fn calibration(&mut self) -> Result<Calibration, RecordError> {
        match self.link.ask(Command::ReadCalibration)? {
            Reply::Calibration(calibration) => Ok(calibration),
            other => Err(self.link.wrong_answer(&Command::ReadCalibration, &other).into()),
        }
    }

    /// Speeds of the flagella over the last second.
    pub(super) fn last_speeds(&self) -> [CentiRpm; 2] {
        let count = self.speeds.len().max(1) as i32;
        let sum = |motor: usize| self.speeds.iter().map(|speeds| i32::from(speeds[motor].0)).sum::<i32>();
        [0, 1].map(|motor| CentiRpm((sum(motor) / count) as i16))
    }

    /// The robot has hung at rest until now, so that its attitude can be levelled.
    pub(super) fn level(&mut self) -> Result<(), RecordError> {
        if let Some(level) = self.log.level(SystemTime::now())? {
            self.attitude.level(&level);
        }
        Ok(())
    }

    /// Notes an event at this moment.
    pub(super) fn event(&mut self, kind: EventKind, text: &str) -> Result<(), RecordError> {
        Ok(self.log.event(kind, text, SystemTime::now())?)
    }

    /// Begins a phase with the frame that ended the one before.
    pub(super) fn phase(&mut self, name: &str) -> Result<(), RecordError> {
        if let Some(frame) = &self.ahead {
            self.log.board_time(frame.board_us, frame.host);
            self.times.begin(name, frame.time_s);
        }
        self.event(EventKind::Phase, name)
    }

    /// Keeps what has come already, without waiting: the answers to the last commands, and after a failure what the board
    /// sent meanwhile.
    pub(super) fn drain(&mut self, frames_too: bool) -> Result<(), RecordError> {
        while let Some(received) = self.link.next(Duration::ZERO) {
            if matches!(received.event, Event::Closed) {
                break;
            }
            if let Some((telemetry, host)) = self.take(received)?.filter(|_| frames_too)
                && let Some(frame) = self.frame(telemetry, host)
            {
                self.keep(frame)?;
            }
        }
        Ok(())
    }

    /// Returns whether a simulated robot gives its shape in this frame's tick; true where there is none.
    fn is_sampled(&mut self, frame: &Frame) -> Result<bool, RecordError> {
        self.truth.as_mut().map_or(Ok(true), |truth| Ok(truth.has_shape_in(frame.board_us)?))
    }

    /// Keeps the truth up to the last frame that was kept, where a simulated robot tells it.
    fn keep_truth(&mut self) -> Result<(), RecordError> {
        match (&mut self.truth, self.reached_us) {
            (Some(truth), Some(until_us)) => truth.keep(&mut self.log, (self.begun_us, until_us)),
            _ => Ok(()),
        }
    }

    /// The same at the trial's end: all that came before the frame that ended it, so that the number of samples does not
    /// depend on where they lie between the frames.
    pub(super) fn end_truth(&mut self) -> Result<(), RecordError> {
        if let Some(end) = &self.ahead {
            self.reached_us = self.reached_us.max(end.board_us.checked_sub(1));
        }
        if let Some(truth) = &mut self.truth {
            truth.ask()?;
        }
        self.keep_truth()
    }

    /// Forgets the attitude so far: the calibration changed what the rates mean.
    pub(super) fn restart_attitude(&mut self) {
        self.attitude.restart();
    }

    fn next_frame(&mut self) -> Result<Frame, RecordError> {
        loop {
            if self.interrupted.load(Ordering::Relaxed) {
                return Err(RecordError::Interrupted);
            }
            self.log.tick()?;
            self.keep_truth()?;
            let Some(received) = self.link.next(Duration::from_millis(20)) else {
                // Only an empty queue is silence: this program itself may have been kept from reading it.
                if self.last_heard.elapsed() > SILENCE {
                    return Err(RecordError::Silent(self.restart()));
                }
                continue;
            };
            if let Some((telemetry, host)) = self.take(received)? {
                self.last_heard = Instant::now();
                return self.frame(telemetry, host).ok_or_else(|| RecordError::Leapt(self.restart()));
            }
        }
    }

    /// A frame with its time; `None` where the board's clock leapt.
    fn frame(&mut self, telemetry: Telemetry, host: SystemTime) -> Option<Frame> {
        let board_us = self.clock.unwrap(telemetry.time)?;
        let time_s = board_us.saturating_sub(self.begun_us) as f64 * 1e-6;
        Some(Frame { board_us, time_s, host, telemetry })
    }

    /// Keeps a frame of the trial.
    fn keep(&mut self, frame: Frame) -> Result<(), RecordError> {
        if let Some(gap) = self.monitor.frame(&frame.telemetry) {
            self.log.dropout(gap.first.0, u32::from(gap.count), frame.host)?;
        }
        let reading = self.log.telemetry(&frame.telemetry, frame.board_us, frame.host)?;
        self.reached_us = Some(frame.board_us);
        if self.speeds.len() == usize::from(TICK_HZ) {
            self.speeds.pop_front();
        }
        self.speeds.push_back(frame.telemetry.speed);
        self.times.go_on(frame.time_s);
        self.attitude.push(frame.time_s, &reading);
        let now = (frame.telemetry.state, frame.telemetry.fault);
        let before = std::mem::replace(&mut self.state, now);
        if now.0 != before.0 {
            self.log.event(EventKind::State, &format!("{:?}", now.0), frame.host)?;
        }
        if now.1 != before.1 {
            self.log.event(EventKind::Fault, &format!("{:?}: {}", now.1, fault_text(now.1)), frame.host)?;
        }
        match now.1 {
            Fault::None => Ok(()),
            fault => Err(RecordError::Faulted(fault)),
        }
    }

    /// Keeps anything but a frame of the stream, which it hands back with the time at which it came.
    fn take(&mut self, received: Received) -> Result<Option<(Telemetry, SystemTime)>, RecordError> {
        let Received { wall: host, at, event } = received;
        match event {
            Event::Telemetry(telemetry) => return Ok(Some((telemetry, host))),
            Event::Raw(bytes) => self.log.raw(&bytes, host)?,
            Event::Damaged(error) => {
                self.monitor.damaged(error);
                self.log.event(EventKind::Warning, &format!("a frame was damaged: {error}"), host)?;
            }
            Event::Exchange(Exchange { request, attempts, reply, sent, sent_at }) => {
                if let (Some(Reply::Pong(board)), 1) = (reply, attempts) {
                    // A board that has restarted counts anew, which tells nothing of the clock that the trial is on.
                    if let Some(board_us) = self.clock.unwrap(board) {
                        self.pings.add(board_us, sent_at, at);
                    }
                } else {
                    self.monitor.asked(attempts);
                    let Request { seq, command } = request;
                    self.log.command(&CommandRecord { seq, command, attempts, reply, sent, ended: host })?;
                }
            }
            Event::Closed => return Err(LinkError::Closed { path: self.link.path().to_owned() }.into()),
        }
        Ok(None)
    }

    /// The board's clock against the host's, where enough pings came back.
    pub(super) fn clock_fit(&self) -> Option<ClockFit> {
        let fit = self.pings.fit()?;
        let opened = self.link.opened().duration_since(SystemTime::UNIX_EPOCH).ok()?;
        Some(ClockFit {
            pings: u32::try_from(fit.pings).unwrap_or(u32::MAX),
            offset_ns: i64::try_from(opened.as_nanos()).ok()? + (fit.offset_s * 1e9) as i64,
            drift_ppm: (1.0 / fit.rate - 1.0) * 1e6,
            residual_us: fit.residual_s * 1e6,
        })
    }

    /// Why the board started again since the link was opened, if it did.
    pub(super) fn restart(&self) -> Option<ResetCause> {
        match self.link.ask(Command::Hello) {
            Ok(Reply::Info(info)) if info.boot_count != self.link.info().boot_count => Some(info.reset_cause),
            _ => None,
        }
    }
}
