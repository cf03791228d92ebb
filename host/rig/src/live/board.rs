//! Serves the telemetry of a board without recording it.

use super::server::Live;
use crate::link::{Arrival, BoardClock, Event, Link, LinkError, Monitor};
use crate::run::fault_text;
use biflag_log::schema::biflag;
use biflag_log::{Converter, EventKind, LinkStats, event};
use protocol::{Command, Fault, Settings, State, TICK_HZ, Telemetry};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use study::attitude::rotation;
use study::draw;
use study::trial::DAMAGED_FRAME;

/// Starts the board's telemetry and serves it until the user interrupts the program. It neither sends speeds nor clears
/// faults. The motors are at rest, because a board stops them if no host is connected.
///
/// # Errors
/// [`LinkError`].
pub fn watch(link: &Link, settings: Settings, live: &Live, interrupted: &AtomicBool) -> Result<LinkStats, LinkError> {
    let mut stream = Stream {
        live,
        converter: Converter::new(settings, link.info().imu_id),
        clock: BoardClock::default(),
        first: None,
        now_ns: 0,
        monitor: Monitor::default(),
        state: None,
    };
    link.command(Command::Stream { rate_hz: TICK_HZ })?;
    while !interrupted.load(Ordering::Relaxed) {
        let Some(received) = link.next(Duration::from_millis(20)) else { continue };
        match received.event {
            Event::Telemetry(telemetry) => stream.frame(&telemetry, received.wall),
            Event::Damaged(error) => {
                stream.monitor.damaged(error);
                stream.event(EventKind::Warning, &format!("{DAMAGED_FRAME}: {error}"));
            }
            Event::Silent { .. } => return Err(LinkError::Stopped { path: link.path().to_owned() }),
            Event::Closed => return Err(link.closed()),
            Event::Raw(_) | Event::Exchange(_) => {}
        }
    }
    link.command(Command::Stream { rate_hz: 0 })?;
    Ok(stream.monitor.stats)
}

/// Converts frames to messages for viewers.
struct Stream<'a> {
    live: &'a Live,
    converter: Converter,
    clock: BoardClock,
    /// The board's clock, µs, and the host's clock, ns, at the first frame.
    first: Option<(u64, u64)>,
    /// Time of the last frame, ns: the board's time, counted from the host's clock at the first frame.
    now_ns: u64,
    monitor: Monitor,
    state: Option<(State, Fault)>,
}

impl Stream<'_> {
    fn frame(&mut self, frame: &Telemetry, host: SystemTime) {
        let arrival = self.monitor.frame(frame);
        if arrival == Arrival::Repeated {
            return;
        }
        let board_us = self.clock.unwrap(frame.time).unwrap_or_else(|| {
            // After a restart of the board, the time for viewers continues from the host's clock.
            (self.clock, self.first) = (BoardClock::default(), None);
            self.clock.unwrap(frame.time).unwrap_or_default()
        });
        let host_ns = host.duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos() as u64;
        let (first_us, first_ns) = *self.first.get_or_insert((board_us, host_ns));
        let elapsed_us = board_us.saturating_sub(first_us);
        self.now_ns = first_ns + elapsed_us * 1000;
        if let Arrival::After(gap) = arrival {
            let dropout = biflag::Dropout { first_seq: gap.first.0.into(), count: gap.count.into() };
            self.live.message(self.now_ns, &dropout);
        }
        let telemetry = self.converter.telemetry(frame, board_us, elapsed_us as f64 * 1e-6);
        self.live.message(self.now_ns, &telemetry);
        if let Some(q) = &telemetry.attitude {
            let attitude = rotation([q.w, q.x, q.y, q.z]);
            self.live.message(self.now_ns, &draw::attitude(&attitude, self.now_ns));
        }
        let before = self.state.replace((frame.state, frame.fault));
        if before.is_none_or(|(state, _)| state != frame.state) {
            self.event(EventKind::State, &format!("{:?}", frame.state));
        }
        if before.map_or(Fault::None, |(_, fault)| fault) != frame.fault {
            self.event(EventKind::Fault, &format!("{:?}: {}", frame.fault, fault_text(frame.fault)));
        }
    }

    fn event(&self, kind: EventKind, text: &str) {
        self.live.message(self.now_ns, &event(kind, text));
    }
}
