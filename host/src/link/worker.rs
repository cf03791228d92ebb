//! The thread that owns the port: it reads, decodes, answers nothing late, and tells what came.

use protocol::frame::{Accumulator, FrameError, MAX_FRAME, encode};
use protocol::units::Micros;
use protocol::{Command, Message, Reply, Request, Telemetry};
use serialport::SerialPort;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::time::{Duration, Instant, SystemTime};

/// Something that came over the link.
#[derive(Debug)]
pub struct Received {
    /// When, on the host's wall clock.
    pub wall: SystemTime,
    /// When, since the link was opened.
    pub at: Duration,
    /// What.
    pub event: Event,
}

/// What came.
#[derive(Debug)]
pub enum Event {
    /// Bytes as they came.
    Raw(Vec<u8>),
    /// A frame of the stream.
    Telemetry(Telemetry),
    /// A frame that could not be read.
    Damaged(FrameError),
    /// A request was answered or given up.
    Exchange(Exchange),
    /// The port is gone; nothing comes after this.
    Closed,
}

/// A request and what became of it.
#[derive(Debug, Clone, Copy)]
pub struct Exchange {
    /// What was asked.
    pub request: Request,
    /// How often.
    pub attempts: u32,
    /// What was answered; `None`: nothing in time.
    pub reply: Option<Reply>,
    /// When it was sent first, on the host's wall clock.
    pub sent: SystemTime,
    /// When it was sent first, since the link was opened.
    pub sent_at: Duration,
}

/// Something to ask the board.
pub(super) struct Question {
    pub(super) command: Command,
    pub(super) answer: Sender<Answer>,
}

/// A reply, or the number of attempts that brought none.
pub(super) type Answer = Result<Reply, u32>;

/// Waits before the attempts after the first.
const BACK_OFF: [Duration; 5] = [
    Duration::from_millis(50),
    Duration::from_millis(100),
    Duration::from_millis(200),
    Duration::from_millis(300),
    Duration::from_millis(400),
];

/// Between pings, which feed the motors' deadline (500 ms by default) and hold the two clocks together. By the host's
/// clock or by the board's, whichever is earlier: an emulated board may run faster than real time.
const PING_EVERY: Duration = Duration::from_millis(20);

/// A program that neither asks nor listens for so long hangs. Bringing a log to a slow disk may take its time.
const HANG: Duration = Duration::from_secs(5);

pub(super) struct Worker {
    port: Box<dyn SerialPort>,
    asked: Receiver<Question>,
    waiting: VecDeque<Question>,
    events: Sender<Received>,
    /// When the program's end last showed a sign of life, ms since the link was opened.
    alive: Arc<AtomicU64>,
    begun: Instant,
    accumulator: Accumulator,
    open: Option<Open>,
    seq: u8,
    greeted: bool,
    next_ping: Instant,
    /// The board's clock in the last frame of its stream, and in the last one before something was sent.
    board_time: Option<Micros>,
    board_time_at_send: Option<Micros>,
}

/// The request that waits for its answer.
struct Open {
    request: Request,
    answer: Option<Sender<Answer>>,
    attempts: u32,
    sent: SystemTime,
    sent_at: Duration,
    again_at: Instant,
}

/// The port is gone, or nobody listens any more.
struct Ended;

impl Worker {
    pub(super) fn new(
        port: Box<dyn SerialPort>,
        asked: Receiver<Question>,
        events: Sender<Received>,
        alive: Arc<AtomicU64>,
    ) -> Self {
        let begun = Instant::now();
        Self {
            port,
            asked,
            waiting: VecDeque::new(),
            events,
            alive,
            begun,
            accumulator: Accumulator::new(),
            open: None,
            seq: begun_seq(),
            greeted: false,
            next_ping: begun,
            board_time: None,
            board_time_at_send: None,
        }
    }

    pub(super) fn run(mut self) {
        while self.turn().is_ok() {}
        // Whatever ended the link: ask for a stop once more. If it is lost, the board's own deadline does it.
        let _ = self.send(Command::Stop);
        self.emit(Event::Closed);
    }

    fn turn(&mut self) -> Result<(), Ended> {
        self.read()?;
        loop {
            match self.asked.try_recv() {
                Ok(question) => self.waiting.push_back(question),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) if self.waiting.is_empty() => return Err(Ended),
                Err(TryRecvError::Disconnected) => break,
            }
        }
        if self.open.is_some() {
            return self.insist();
        }
        if let Some(question) = self.waiting.pop_front() {
            return self.post(question.command, Some(question.answer));
        }
        if self.greeted && self.is_ping_due() && self.is_program_alive() {
            return self.post(Command::Ping, None);
        }
        Ok(())
    }

    fn is_ping_due(&self) -> bool {
        let times = self.board_time.zip(self.board_time_at_send);
        times.is_some_and(|(now, at_send)| u128::from(now.since(at_send)) >= PING_EVERY.as_micros())
            || Instant::now() >= self.next_ping
    }

    /// A program that hangs must not keep the motors turning: without pings the board stops them.
    fn is_program_alive(&self) -> bool {
        let alive = Duration::from_millis(self.alive.load(Ordering::Relaxed));
        self.begun.elapsed() < alive + HANG
    }

    fn read(&mut self) -> Result<(), Ended> {
        let mut buffer = [0; 1024];
        let read = match self.port.read(&mut buffer) {
            Ok(0) => return Err(Ended),
            Ok(read) => read,
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => return Ok(()),
            Err(_) => return Err(Ended),
        };
        self.emit(Event::Raw(buffer[..read].to_vec()));
        for byte in &buffer[..read] {
            match self.accumulator.push::<Message>(*byte) {
                None => {}
                Some(Ok(Message::Telemetry(telemetry))) => {
                    self.board_time = Some(telemetry.time);
                    self.emit(Event::Telemetry(telemetry));
                }
                Some(Ok(Message::Reply { to, reply })) => self.answered(to, reply),
                Some(Err(error)) => self.emit(Event::Damaged(error)),
            }
        }
        Ok(())
    }

    fn post(&mut self, command: Command, answer: Option<Sender<Answer>>) -> Result<(), Ended> {
        let (sent, sent_at) = (SystemTime::now(), self.begun.elapsed());
        let request = self.send(command)?;
        self.open = Some(Open { request, answer, attempts: 1, sent, sent_at, again_at: Instant::now() + BACK_OFF[0] });
        Ok(())
    }

    /// Sends the open request again when its time has come, and gives it up in the end. An idle question is not worth
    /// insisting on: the next ping is due anyway.
    fn insist(&mut self) -> Result<(), Ended> {
        let Some(open) = &mut self.open else { return Ok(()) };
        if Instant::now() < open.again_at {
            return Ok(());
        }
        let Some(wait) = BACK_OFF.get(open.attempts as usize).filter(|_| open.answer.is_some()) else {
            if let Some(open) = self.open.take() {
                self.close(open, None);
            }
            return Ok(());
        };
        open.attempts += 1;
        open.again_at = Instant::now() + *wait;
        let request = open.request;
        self.write(&request)
    }

    fn answered(&mut self, to: u8, reply: Reply) {
        if let Some(open) = self.open.take_if(|open| open.request.seq == to) {
            self.greeted |= matches!(reply, Reply::Info(_));
            self.close(open, Some(reply));
        }
    }

    fn close(&mut self, open: Open, reply: Option<Reply>) {
        let Open { request, answer, attempts, sent, sent_at, .. } = open;
        self.emit(Event::Exchange(Exchange { request, attempts, reply, sent, sent_at }));
        if let Some(answer) = answer {
            // Nobody waits any more where the asker was interrupted.
            let _ = answer.send(reply.ok_or(attempts));
        }
    }

    fn send(&mut self, command: Command) -> Result<Request, Ended> {
        self.seq = self.seq.wrapping_add(1);
        let request = Request { seq: self.seq, command };
        self.write(&request)?;
        Ok(request)
    }

    /// A leading delimiter ends whatever the line's noise left in the board's buffer.
    fn write(&mut self, request: &Request) -> Result<(), Ended> {
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(request, &mut buffer).map_err(|_| Ended)?;
        self.next_ping = Instant::now() + PING_EVERY;
        self.board_time_at_send = self.board_time;
        let line = [&[0], &*frame].concat();
        self.port.write_all(&line).map_err(|_| Ended)
    }

    fn emit(&mut self, event: Event) {
        // Nobody listening is no failure here: the questions' end will be seen next.
        let _ = self.events.send(Received { wall: SystemTime::now(), at: self.begun.elapsed(), event });
    }
}

/// A first sequence number that differs from that of the program before us, whose last request the board remembers.
fn begun_seq() -> u8 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.subsec_micros() as u8)
}
