//! Serves a line: sends requests with retries, pings the board, decodes received bytes, and passes events on.

use protocol::frame::{Accumulator, FrameError, MAX_FRAME, encode};
use protocol::units::Micros;
use protocol::{Command, Message, Reply, Request, Telemetry};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};
use study::lock::lock;

/// An event with its times.
#[derive(Debug)]
pub struct Received {
    /// Time on the host's wall clock.
    pub wall: SystemTime,
    /// Time since the link was opened.
    pub at: Duration,
    /// The event.
    pub event: Event,
}

/// An event on the link.
#[derive(Debug)]
#[expect(missing_docs, reason = "the variants say what their fields are")]
pub enum Event {
    /// Received bytes, unchanged.
    Raw(Vec<u8>),
    /// A frame of the stream.
    Telemetry(Telemetry),
    /// A frame that could not be read.
    Damaged(FrameError),
    /// A request was answered or abandoned.
    Exchange(Exchange),
    /// The board should be streaming, but no frame has arrived for a second. The event repeats every second until the
    /// next frame.
    Silent { bytes: usize },
    /// The port is gone. This is the last event.
    Closed,
}

/// A request and its outcome.
#[derive(Debug, Clone, Copy)]
pub struct Exchange {
    /// The request.
    pub request: Request,
    /// Number of attempts.
    pub attempts: u32,
    /// The answer; `None` if none came in time.
    pub reply: Option<Reply>,
    /// When it was first sent, on the host's wall clock.
    pub sent: SystemTime,
    /// When it was first sent, since the link was opened.
    pub sent_at: Duration,
}

/// A request that waits to be sent.
pub(super) struct PendingRequest {
    pub(super) command: Command,
    pub(super) answer: Sender<Exchange>,
}

/// Wait after each attempt.
const BACK_OFF: [Duration; 5] = [
    Duration::from_millis(50),
    Duration::from_millis(100),
    Duration::from_millis(200),
    Duration::from_millis(300),
    Duration::from_millis(400),
];

/// Time between pings, which feed the motors' deadline (500 ms by default) and relate the two clocks. By the host's
/// clock or the board's, whichever is earlier, because an emulated board may run faster than real time.
const PING_EVERY: Duration = Duration::from_millis(20);

/// Time between two signs of life to an emulated board, whose time stops without them. It is longer than the 40 ms by
/// which one sign lets the board advance, so that its time does not run ahead of the deadlines here.
const SIGN_OF_LIFE_EVERY: Duration = Duration::from_millis(50);

/// Time without a frame after which the board no longer gets pings: motors that turn unseen must stop.
const SILENCE: Duration = Duration::from_secs(1);

/// Last wait for the answer of an emulated board: a busy computer may keep it from running.
const BUSY: Duration = Duration::from_secs(3);

/// Time without a heartbeat ([`super::Link::ask`], [`super::Link::next`]) after which the program counts as hung, and the
/// board no longer gets pings. Logs are written on a separate thread, so a slow disk does not delay the heartbeat. A
/// terminal that blocks the program's output does.
const HANG_TIMEOUT: Duration = Duration::from_secs(5);

/// The line through which a link speaks.
pub(super) trait Line {
    /// Waits a moment for bytes, and returns those that have arrived.
    fn read(&mut self) -> Result<Vec<u8>, Disconnected>;
    /// Sends bytes.
    fn write(&mut self, bytes: &[u8]) -> Result<(), Disconnected>;
    /// Returns the time since the link was opened.
    fn now(&self) -> Duration;
    /// Returns the time of the host's wall clock.
    fn wall(&self) -> SystemTime;
}

/// The port has disappeared, or the program has closed the link.
pub(super) struct Disconnected;

/// Serves a line: one request after the other, and pings between them. Its times count since the link was opened.
pub(super) struct Worker<L: Line> {
    line: L,
    requests: Receiver<PendingRequest>,
    waiting: VecDeque<PendingRequest>,
    events: Sender<Received>,
    /// Time of the program's last heartbeat; `None` if the board's time waits for this program: such a board needs no pings, and
    /// is never silent.
    alive: Option<Arc<Mutex<Instant>>>,
    accumulator: Accumulator,
    in_flight: Option<InFlight>,
    seq: u8,
    handshake_done: bool,
    /// Whether the board was told to stream.
    streaming: bool,
    /// When the last frame of the stream arrived, or without a stream, the last answer.
    heard: Duration,
    /// Number of bytes received since `heard`.
    unheard: usize,
    /// When its silence was last reported; before that, the same as `heard`.
    silence_told: Duration,
    next_ping: Duration,
    /// When the next sign of life is due; `None` for a board whose time passes anyway.
    pub(super) next_sign: Option<Duration>,
    /// The board's clock in the last frame of its stream, and in the last frame before the last request.
    board_time: Option<Micros>,
    board_time_at_send: Option<Micros>,
}

/// The unanswered request.
struct InFlight {
    exchange: Exchange,
    /// The receiver of the answer; `None` for a ping.
    answer: Option<Sender<Exchange>>,
    retry_at: Duration,
}

impl<L: Line> Worker<L> {
    /// Returns the worker of a line. `seq`: the number before the first request's.
    pub(super) fn new(
        line: L,
        requests: Receiver<PendingRequest>,
        events: Sender<Received>,
        alive: Option<Arc<Mutex<Instant>>>,
        seq: u8,
    ) -> Self {
        Self {
            line,
            requests,
            waiting: VecDeque::new(),
            events,
            alive,
            accumulator: Accumulator::new(),
            in_flight: None,
            seq,
            handshake_done: false,
            streaming: false,
            heard: Duration::ZERO,
            unheard: 0,
            silence_told: Duration::ZERO,
            next_ping: Duration::ZERO,
            next_sign: None,
            board_time: None,
            board_time_at_send: None,
        }
    }

    pub(super) fn run(mut self) {
        while self.step().is_ok() {}
        self.end();
    }

    /// Stops the motors, however the link ended. If this request is lost, the board's own deadline stops them.
    pub(super) fn end(mut self) {
        let _ = self.send(Command::Stop);
        self.emit(Event::Closed);
    }

    /// Sends what is due, and reads what has arrived.
    pub(super) fn step(&mut self) -> Result<(), Disconnected> {
        loop {
            match self.requests.try_recv() {
                Ok(request) => self.waiting.push_back(request),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) if self.waiting.is_empty() => return Err(Disconnected),
                Err(TryRecvError::Disconnected) => break,
            }
        }
        self.show_life()?;
        self.retry()?;
        if self.in_flight.is_none() {
            if let Some(request) = self.waiting.pop_front() {
                self.begin(request.command, Some(request.answer))?;
            } else if self.handshake_done && self.is_program_alive() && self.is_ping_due() && self.is_heard() {
                self.begin(Command::Ping, None)?;
            }
        }
        self.read()
    }

    /// Sends a delimiter to an emulated board while this program waits for it: an empty frame, which has no content and
    /// feeds no deadline.
    fn show_life(&mut self) -> Result<(), Disconnected> {
        let is_due = self.next_sign.is_some_and(|due| self.line.now() >= due);
        if is_due && self.is_program_alive() { self.write_bytes(&[0]) } else { Ok(()) }
    }

    fn is_ping_due(&self) -> bool {
        let times = self.board_time.zip(self.board_time_at_send);
        times.is_some_and(|(now, at_send)| u128::from(now.since(at_send)) >= PING_EVERY.as_micros())
            || self.line.now() >= self.next_ping
    }

    /// Returns whether the program is alive. A hung program must not keep the motors turning: without pings the board
    /// stops them.
    fn is_program_alive(&self) -> bool {
        self.alive.as_ref().is_some_and(|alive| lock(alive).elapsed() < HANG_TIMEOUT)
    }

    /// Returns whether the board was heard in the last second. While it streams, noise and answers are not enough: only
    /// its frames show the motion of the motors.
    fn is_heard(&self) -> bool {
        self.line.now().saturating_sub(self.heard) <= SILENCE
    }

    fn hear(&mut self) {
        self.heard = self.line.now();
        (self.silence_told, self.unheard) = (self.heard, 0);
    }

    fn read(&mut self) -> Result<(), Disconnected> {
        // Silence counts up to here: after a stop of this program, its port has buffered bytes.
        let asked = self.line.now();
        let bytes = self.line.read()?;
        if !bytes.is_empty() {
            self.decode(bytes);
        }
        if self.streaming && self.alive.is_some() && asked.saturating_sub(self.silence_told) > SILENCE {
            self.silence_told = asked;
            self.emit(Event::Silent { bytes: self.unheard });
        }
        Ok(())
    }

    fn decode(&mut self, bytes: Vec<u8>) {
        self.unheard += bytes.len();
        self.emit(Event::Raw(bytes.clone()));
        for byte in bytes {
            match self.accumulator.push::<Message>(byte) {
                None => {}
                Some(Ok(Message::Telemetry(telemetry))) => {
                    self.hear();
                    self.board_time = Some(telemetry.time);
                    self.emit(Event::Telemetry(telemetry));
                }
                Some(Ok(Message::Reply { to, reply })) => self.answered(to, reply),
                Some(Err(error)) => self.emit(Event::Damaged(error)),
            }
        }
    }

    fn begin(&mut self, command: Command, answer: Option<Sender<Exchange>>) -> Result<(), Disconnected> {
        let (sent, sent_at) = (self.line.wall(), self.line.now());
        let request = self.send(command)?;
        let exchange = Exchange { request, attempts: 1, reply: None, sent, sent_at };
        self.in_flight = Some(InFlight { exchange, answer, retry_at: self.line.now() + BACK_OFF[0] });
        Ok(())
    }

    /// Retries the request in flight when it is due, and abandons it after the last attempt. Pings are not retried: the
    /// next one is due soon.
    fn retry(&mut self) -> Result<(), Disconnected> {
        let Some(in_flight) = &mut self.in_flight else { return Ok(()) };
        if self.line.now() < in_flight.retry_at {
            return Ok(());
        }
        let Some(wait) = BACK_OFF.get(in_flight.exchange.attempts as usize).filter(|_| in_flight.answer.is_some())
        else {
            if let Some(in_flight) = self.in_flight.take() {
                self.finish(in_flight, None);
            }
            return Ok(());
        };
        in_flight.exchange.attempts += 1;
        // The handshake has a limit of its own, and after a silence there is nothing to wait for.
        let may_be_busy = self.handshake_done && self.next_sign.is_some() && self.silence_told == self.heard;
        let is_last = in_flight.exchange.attempts as usize == BACK_OFF.len();
        in_flight.retry_at = self.line.now() + if is_last && may_be_busy { BUSY } else { *wait };
        let request = in_flight.exchange.request;
        self.write(&request)
    }

    fn answered(&mut self, to: u8, reply: Reply) {
        if let Some(in_flight) = self.in_flight.take_if(|in_flight| in_flight.exchange.request.seq == to) {
            self.handshake_done |= matches!(reply, Reply::Info(_));
            let was_streaming = self.streaming;
            if let (Command::Stream { rate_hz }, Reply::Done) = (in_flight.exchange.request.command, reply) {
                self.streaming = rate_hz > 0;
            }
            if !(was_streaming && self.streaming) {
                self.hear();
            }
            self.finish(in_flight, Some(reply));
        }
    }

    fn finish(&mut self, in_flight: InFlight, reply: Option<Reply>) {
        let exchange = Exchange { reply, ..in_flight.exchange };
        self.emit(Event::Exchange(exchange));
        if let Some(answer) = in_flight.answer {
            // An interrupted program no longer waits for the answer.
            let _ = answer.send(exchange);
        }
    }

    fn send(&mut self, command: Command) -> Result<Request, Disconnected> {
        self.seq = self.seq.wrapping_add(1);
        let request = Request { seq: self.seq, command };
        self.write(&request)?;
        Ok(request)
    }

    /// Writes the frame of a request. A leading delimiter terminates any noise in the board's buffer.
    fn write(&mut self, request: &Request) -> Result<(), Disconnected> {
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(request, &mut buffer).map_err(|_| Disconnected)?;
        self.next_ping = self.line.now() + PING_EVERY;
        self.board_time_at_send = self.board_time;
        let line = [&[0], &*frame].concat();
        self.write_bytes(&line)
    }

    fn write_bytes(&mut self, bytes: &[u8]) -> Result<(), Disconnected> {
        self.next_sign = self.next_sign.map(|_| self.line.now() + SIGN_OF_LIFE_EVERY);
        self.line.write(bytes)
    }

    fn emit(&mut self, event: Event) {
        // A program that no longer listens also closes the channel of requests, which the next step detects.
        let _ = self.events.send(Received { wall: self.line.wall(), at: self.line.now(), event });
    }
}
