//! A line to an emulated board that waits for this program: its time passes only while this program waits for it.
//!
//! Nothing here depends on the computer's clock or on another thread, so requests reach the board at the same time of
//! its clock in every run, at any load of the computer. There are no pings: a program that turns the motors sends
//! speeds more often than the board's deadline.

use super::worker::{BACK_OFF, Event, Exchange, PendingRequest, Received};
use protocol::frame::{Accumulator, MAX_FRAME, encode};
use protocol::{Command, Message, Reply, Request};
use std::collections::VecDeque;
use std::sync::mpsc::Sender;
use std::time::{Duration, SystemTime};

/// Passes bytes to the board, lets [`SLICE_US`] of its time pass, and returns the bytes that it sent; `None` if it has
/// ended.
pub type Advance = Box<dyn FnMut(&[u8]) -> Option<Vec<u8>>>;

/// Time by which the board advances in one step, µs.
pub const SLICE_US: u64 = 1_000;

/// The line.
pub(super) struct LockStep {
    advance: Advance,
    /// Time that has passed for the board, µs.
    passed_us: u64,
    opened: SystemTime,
    events: VecDeque<Received>,
    outgoing: Vec<u8>,
    accumulator: Accumulator,
    waiting: VecDeque<PendingRequest>,
    in_flight: Option<InFlight>,
    seq: u8,
    is_closed: bool,
}

/// The unanswered request.
struct InFlight {
    exchange: Exchange,
    answer: Sender<Exchange>,
    retry_at_us: u64,
}

impl LockStep {
    pub(super) fn new(advance: Advance, opened: SystemTime) -> Self {
        Self {
            advance,
            passed_us: 0,
            opened,
            events: VecDeque::new(),
            outgoing: Vec::new(),
            accumulator: Accumulator::new(),
            waiting: VecDeque::new(),
            in_flight: None,
            seq: 0,
            is_closed: false,
        }
    }

    /// Sends a request after all earlier ones.
    pub(super) fn send(&mut self, request: PendingRequest) {
        self.waiting.push_back(request);
        self.begin();
    }

    /// Returns the next event that has arrived.
    pub(super) fn event(&mut self) -> Option<Received> {
        let closed = || self.received(Event::Closed);
        let is_over = self.events.is_empty() && self.is_closed;
        if is_over { Some(closed()) } else { self.events.pop_front() }
    }

    /// Advances the board by a slice. Returns whether it is still running.
    pub(super) fn step(&mut self) -> bool {
        self.retry();
        let outgoing = std::mem::take(&mut self.outgoing);
        let Some(bytes) = (self.advance)(&outgoing).filter(|_| !self.is_closed) else {
            self.is_closed = true;
            // The requests in flight will not be answered.
            (self.in_flight, self.waiting) = (None, VecDeque::new());
            return false;
        };
        self.passed_us += SLICE_US;
        if bytes.is_empty() {
            return true;
        }
        self.emit(Event::Raw(bytes.clone()));
        for byte in bytes {
            match self.accumulator.push::<Message>(byte) {
                None => {}
                Some(Ok(Message::Telemetry(telemetry))) => self.emit(Event::Telemetry(telemetry)),
                Some(Ok(Message::Reply { to, reply })) => self.answered(to, reply),
                Some(Err(error)) => self.emit(Event::Damaged(error)),
            }
        }
        true
    }

    /// Sends the next request, if none is in flight.
    fn begin(&mut self) {
        if self.in_flight.is_some() {
            return;
        }
        let Some(PendingRequest { command, answer }) = self.waiting.pop_front() else { return };
        self.seq = self.seq.wrapping_add(1);
        let request = Request { seq: self.seq, command };
        self.write(&request);
        let sent_at = Duration::from_micros(self.passed_us);
        let exchange = Exchange { request, attempts: 1, reply: None, sent: self.opened + sent_at, sent_at };
        let retry_at_us = self.passed_us + BACK_OFF[0].as_micros() as u64;
        self.in_flight = Some(InFlight { exchange, answer, retry_at_us });
    }

    /// Retries the request in flight when it is due, and abandons it after the last attempt.
    fn retry(&mut self) {
        let Some(in_flight) = self.in_flight.as_mut().filter(|of| self.passed_us >= of.retry_at_us) else { return };
        let Some(wait) = BACK_OFF.get(in_flight.exchange.attempts as usize) else {
            if let Some(in_flight) = self.in_flight.take() {
                self.finish(in_flight, None);
            }
            return;
        };
        in_flight.exchange.attempts += 1;
        in_flight.retry_at_us = self.passed_us + wait.as_micros() as u64;
        let request = in_flight.exchange.request;
        self.write(&request);
    }

    fn answered(&mut self, to: u8, reply: Reply) {
        if let Some(in_flight) = self.in_flight.take_if(|in_flight| in_flight.exchange.request.seq == to) {
            self.finish(in_flight, Some(reply));
        }
    }

    fn finish(&mut self, InFlight { exchange, answer, .. }: InFlight, reply: Option<Reply>) {
        let exchange = Exchange { reply, ..exchange };
        self.emit(Event::Exchange(exchange));
        // An interrupted program no longer waits for the answer.
        let _ = answer.send(exchange);
        self.begin();
    }

    /// Writes the frame of a request, after a delimiter as on a real line.
    fn write(&mut self, request: &Request) {
        let mut buffer = [0; MAX_FRAME];
        if let Ok(frame) = encode(request, &mut buffer) {
            self.outgoing.push(0);
            self.outgoing.extend_from_slice(frame);
        }
    }

    fn emit(&mut self, event: Event) {
        let received = self.received(event);
        self.events.push_back(received);
    }

    /// Returns an event with its time by the board's clock, so that nothing depends on the computer's.
    fn received(&self, event: Event) -> Received {
        let at = Duration::from_micros(self.passed_us);
        Received { wall: self.opened + at, at, event }
    }
}

impl Drop for LockStep {
    fn drop(&mut self) {
        self.seq = self.seq.wrapping_add(1);
        self.write(&Request { seq: self.seq, command: Command::Stop });
        let outgoing = std::mem::take(&mut self.outgoing);
        let _ = (self.advance)(&outgoing);
    }
}
