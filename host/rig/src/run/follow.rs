//! Follows the sensor of a board with its motors off, to measure the sensor itself: every reading goes to a function
//! and into a log.

use super::error::{RecordError, fault_text};
use super::stream::Silences;
use crate::link::{Arrival, BoardClock, Event, Exchange, Link, Monitor, PingClock};
use biflag_log::{Converter, EventKind, LinkStats, Writer};
use protocol::{Command, Fault, Reply, Settings, Telemetry};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime};
use study::sensor::RawReading;

/// Interval of the pings that compare the clocks.
const PING_INTERVAL: Duration = Duration::from_millis(250);

/// Largest gap between two readings, s. A turn by hand during a longer gap would be lost.
const LONGEST_GAP_S: f64 = 0.25;

/// Result of following the sensor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Followed {
    /// Counts of the link.
    pub link: LinkStats,
    /// Relative rate error of the board's clock against the computer's; `None` if it is not known, or for an emulated
    /// board, whose time runs at its own speed.
    pub clock_error: Option<f64>,
}

/// Streams readings to `take` until it returns `false`. `settings` are the board's settings.
///
/// # Errors
/// [`RecordError`], and the error of `take`.
pub fn follow<E: From<RecordError>>(
    link: &Link,
    settings: &Settings,
    log: &mut Writer,
    interrupted: &AtomicBool,
    mut take: impl FnMut(&RawReading, &mut Writer) -> Result<bool, E>,
) -> Result<Followed, E> {
    let mut stream = Stream::start(link, settings, interrupted)?;
    let mut step = || stream.next(log)?.map_or(Ok(true), |reading| take(&reading, log));
    let outcome = loop {
        match step() {
            Ok(true) => {}
            ended => break ended,
        }
    };
    let ended = link.command(Command::Stream { rate_hz: 0 });
    outcome?;
    ended.map_err(RecordError::from)?;
    let is_emulated = system::port::is_emulated(link.path());
    let clock = stream.pings.fit(link.opened).filter(|_| !is_emulated);
    Ok(Followed { link: stream.monitor.stats, clock_error: clock.map(|clock| clock.drift_ppm * 1e-6) })
}

struct Stream<'a> {
    link: &'a Link,
    settings: &'a Settings,
    interrupted: &'a AtomicBool,
    converter: Converter,
    clock: BoardClock,
    monitor: Monitor,
    pings: PingClock,
    pinged: Instant,
    silences: Silences,
    last: Option<(Telemetry, f64)>,
}

impl<'a> Stream<'a> {
    fn start(link: &'a Link, settings: &'a Settings, interrupted: &'a AtomicBool) -> Result<Self, RecordError> {
        super::stream::begin(link)?;
        Ok(Self {
            link,
            settings,
            interrupted,
            converter: Converter::new(*settings, link.info().imu_id),
            clock: BoardClock::default(),
            monitor: Monitor::default(),
            pings: PingClock::default(),
            pinged: Instant::now(),
            silences: Silences::new(link),
            last: None,
        })
    }

    /// Waits a moment for the next reading.
    fn next(&mut self, log: &mut Writer) -> Result<Option<RawReading>, RecordError> {
        if self.interrupted.load(Ordering::Relaxed) {
            return Err(RecordError::Interrupted);
        }
        if self.pinged.elapsed() >= PING_INTERVAL {
            self.pinged = Instant::now();
            // Its answer arrives as an event.
            self.link.send(Command::Ping)?;
        }
        let Some(received) = self.link.next(Duration::from_millis(20)) else {
            log.tick()?;
            return Ok(None);
        };
        match received.event {
            Event::Telemetry(frame) => {
                self.silences.hear();
                self.frame(&frame, received.wall, log)
            }
            Event::Exchange(Exchange { attempts: 1, reply: Some(Reply::Pong(board)), sent_at, .. }) => {
                if let Some(board_us) = self.clock.unwrap(board) {
                    self.pings.add(board_us, sent_at, received.at);
                }
                Ok(None)
            }
            Event::Damaged(error) => {
                self.monitor.damaged(error);
                Ok(None)
            }
            Event::Silent { bytes } => Ok(self.silences.add(bytes).map(|()| None)?),
            Event::Closed => Err(self.link.closed().into()),
            Event::Raw(_) | Event::Exchange(_) => Ok(None),
        }
    }

    fn frame(
        &mut self,
        frame: &Telemetry,
        host: SystemTime,
        log: &mut Writer,
    ) -> Result<Option<RawReading>, RecordError> {
        let arrival = self.monitor.frame(frame);
        if arrival == Arrival::Repeated {
            return Ok(None);
        }
        let board_us = self.clock.unwrap(frame.time).ok_or(RecordError::ClockJumped(None))?;
        if let Arrival::After(gap) = arrival {
            log.dropout(gap.first.0, gap.count.into(), host)?;
        }
        let time_s = log.board_time(board_us, host) as f64 * 1e-6;
        log.message(&self.converter.telemetry(frame, board_us, time_s), host)?;
        if frame.fault != Fault::None {
            log.event(EventKind::Fault, &format!("{:?}: {}", frame.fault, fault_text(frame.fault)), host)?;
            return Err(RecordError::Faulted(frame.fault));
        }
        if !frame.imu_fresh {
            return Ok(None);
        }
        if let Some((last, last_s)) = self.last.replace((*frame, time_s)) {
            if frame.clipped != last.clipped {
                return Err(RecordError::Clipped { range_dps: self.settings.gyro_range.full_scale_dps() });
            }
            if time_s - last_s > LONGEST_GAP_S {
                return Err(RecordError::Gap { gap_s: time_s - last_s });
            }
        }
        Ok(Some(RawReading::of(frame, self.settings, time_s)))
    }
}
