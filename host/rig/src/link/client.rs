//! The program's interface to the link: opens it, sends requests, receives events.

use super::error::LinkError;
use super::lock_step::{Advance, LockStep};
use super::port::{self, Port};
use super::worker::{Event, Exchange, PendingRequest, Received, Worker};
use protocol::frame::FrameError;
use protocol::units::Micros;
use protocol::{Command, Info, Reply, SCHEMA, VERSION};
use std::cell::RefCell;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};
use study::lock::lock;
use system::claim::Claim;

/// An open link to a board that speaks this protocol. Closing it stops the motors.
pub struct Link {
    path: String,
    /// When the link was opened, on the host's wall clock.
    pub opened: SystemTime,
    info: Info,
    requests: Sender<PendingRequest>,
    events: Receiver<Received>,
    server: Server,
}

impl fmt::Debug for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Link").field("path", &self.path).field("info", &self.info).finish_non_exhaustive()
    }
}

/// The server of the line.
enum Server {
    /// A thread.
    Thread {
        /// Time of the last heartbeat.
        alive: Arc<Mutex<Instant>>,
        thread: Option<JoinHandle<()>>,
        _claim: Claim,
    },
    /// This thread, while it waits for an emulated board that waits for this program; `None` once the board has ended.
    Own(RefCell<Option<Box<Worker<LockStep>>>>),
}

/// A request that waits for its answer.
#[derive(Debug)]
pub struct Asked(Receiver<Exchange>);

impl Link {
    /// Time in which handshake attempts may start. Opening the port resets a Nano, and the older of its bootloaders
    /// waits two seconds.
    pub const HANDSHAKE: Duration = Duration::from_secs(4);

    /// Opens the port and performs the handshake.
    ///
    /// # Errors
    /// The port's errors, [`LinkError::Silent`], [`LinkError::OtherProgram`], [`LinkError::OtherVersion`] or [`LinkError::OtherSchema`].
    pub fn open(path: &str) -> Result<Self, LinkError> {
        Self::open_unless(path, &AtomicBool::new(false))
    }

    /// Opens the port and performs the handshake, which `interrupted` aborts.
    ///
    /// # Errors
    /// As [`Link::open`], and [`LinkError::Interrupted`].
    pub fn open_unless(path: &str, interrupted: &AtomicBool) -> Result<Self, LinkError> {
        let claim = port::claim(path)?;
        let port = Port::open(path)?;
        let opened = SystemTime::now();
        let (requests, pending) = channel();
        let (sender, events) = channel();
        let alive = Arc::new(Mutex::new(Instant::now()));
        let mut worker = Worker::new(port, pending, sender, Some(alive.clone()), first_seq());
        // The time of an emulated board stops without signs of life.
        worker.next_sign = system::port::is_emulated(path).then_some(Duration::ZERO);
        let thread = std::thread::Builder::new()
            .name("link".into())
            .spawn(move || worker.run())
            .map_err(|source| LinkError::Port { path: path.to_owned(), source })?;
        let server = Server::Thread { alive, thread: Some(thread), _claim: claim };
        let link = Self { path: path.to_owned(), opened, info: Info::default(), requests, events, server };
        link.shaken(interrupted)
    }

    /// Performs the handshake with an emulated board that waits for this program. `path`: its port, which is not
    /// opened.
    ///
    /// # Errors
    /// As [`Link::open`].
    pub fn lock_step(path: &str, advance: Advance) -> Result<Self, LinkError> {
        let opened = SystemTime::now();
        let (requests, pending) = channel();
        let (sender, events) = channel();
        let worker = Worker::new(LockStep::new(advance, opened), pending, sender, None, 0);
        let server = Server::Own(RefCell::new(Some(Box::new(worker))));
        let link = Self { path: path.to_owned(), opened, info: Info::default(), requests, events, server };
        link.shaken(&AtomicBool::new(false))
    }

    fn shaken(mut self, interrupted: &AtomicBool) -> Result<Self, LinkError> {
        self.info = self.handshake(interrupted)?;
        Ok(self)
    }

    /// Returns whether the board waits for this program.
    pub fn is_lock_step(&self) -> bool {
        matches!(self.server, Server::Own(_))
    }

    /// Returns the port.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Returns the board's answer to the handshake.
    pub fn info(&self) -> &Info {
        &self.info
    }

    /// Sends a request, repeatedly if necessary, and returns the answer.
    ///
    /// # Errors
    /// [`LinkError::NoAnswer`], [`LinkError::Refused`] or [`LinkError::Closed`].
    pub fn ask(&self, command: Command) -> Result<Reply, LinkError> {
        let asked = self.send(command)?;
        let exchange = match &self.server {
            Server::Thread { .. } => asked.0.recv().ok(),
            Server::Own(worker) => loop {
                match asked.0.try_recv() {
                    Err(TryRecvError::Empty) if step(worker) => {}
                    exchange => break exchange.ok(),
                }
            },
        };
        self.outcome(exchange)
    }

    /// Sends a request without waiting for its answer. [`Link::answer`] returns the answer.
    ///
    /// # Errors
    /// [`LinkError::Closed`].
    pub fn send(&self, command: Command) -> Result<Asked, LinkError> {
        self.heartbeat();
        let (sender, answer) = channel();
        self.requests.send(PendingRequest { command, answer: sender }).map_err(|_| self.closed())?;
        Ok(Asked(answer))
    }

    /// Returns the answer to a request; `None` until it arrives.
    pub fn answer(&self, asked: &Asked) -> Option<Result<Reply, LinkError>> {
        match asked.0.try_recv() {
            Err(TryRecvError::Empty) => None,
            exchange => Some(self.outcome(exchange.ok())),
        }
    }

    /// Converts an exchange to its result; `None` means that the thread has ended.
    fn outcome(&self, exchange: Option<Exchange>) -> Result<Reply, LinkError> {
        let Exchange { request, reply, attempts, .. } = exchange.ok_or_else(|| self.closed())?;
        let command = || name(&request.command);
        match reply {
            Some(Reply::Refused(refusal)) => Err(LinkError::Refused { command: command(), refusal }),
            Some(reply) => Ok(reply),
            None => Err(LinkError::NoAnswer { path: self.path.clone(), command: command(), attempts }),
        }
    }

    /// Returns the error for a port that has disappeared.
    pub fn closed(&self) -> LinkError {
        LinkError::Closed { path: self.path.clone() }
    }

    /// Sends a request answered with [`Reply::Done`].
    ///
    /// # Errors
    /// As [`Link::ask`].
    pub fn command(&self, command: Command) -> Result<(), LinkError> {
        match self.ask(command)? {
            Reply::Done => Ok(()),
            other => Err(self.wrong_answer(&command, &other)),
        }
    }

    /// Asks for the board's clock.
    ///
    /// # Errors
    /// As [`Link::ask`].
    pub fn now(&self) -> Result<Micros, LinkError> {
        match self.ask(Command::Ping)? {
            Reply::Pong(now) => Ok(now),
            other => Err(self.wrong_answer(&Command::Ping, &other)),
        }
    }

    /// Clears a fault. A cause that persists is not an error: the next frame states the fault.
    ///
    /// # Errors
    /// As [`Link::ask`].
    pub fn clear_fault(&self) -> Result<(), LinkError> {
        match self.command(Command::ClearFault) {
            Err(LinkError::Refused { .. }) => Ok(()),
            cleared => cleared,
        }
    }

    fn heartbeat(&self) {
        if let Server::Thread { alive, .. } = &self.server {
            *lock(alive) = Instant::now();
        }
    }

    /// Returns the error for an answer that does not fit the request.
    pub fn wrong_answer(&self, command: &Command, answer: &Reply) -> LinkError {
        LinkError::WrongAnswer { command: name(command), answer: format!("{answer:?}") }
    }

    /// Returns the next event, or `None` if none arrives within `timeout`. A board that waits for this program advances
    /// a little, unless the timeout is zero.
    pub fn next(&self, timeout: Duration) -> Option<Received> {
        self.heartbeat();
        let received = match &self.server {
            Server::Thread { .. } => self.events.recv_timeout(timeout),
            Server::Own(worker) => self.events.recv_timeout(Duration::ZERO).or_else(|nothing| {
                if !timeout.is_zero() && step(worker) { self.events.recv_timeout(Duration::ZERO) } else { Err(nothing) }
            }),
        };
        match received {
            Ok(received) => Some(received),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                Some(Received { wall: SystemTime::now(), at: Duration::ZERO, event: Event::Closed })
            }
        }
    }

    fn handshake(&self, interrupted: &AtomicBool) -> Result<Info, LinkError> {
        let begun = Instant::now();
        let mut bytes = 0;
        let mut frames = 0;
        let mut other_version = None;
        let mut asked_before = false;
        while begun.elapsed() < Self::HANDSHAKE {
            if interrupted.load(Ordering::Relaxed) {
                return Err(LinkError::Interrupted);
            }
            let answer = self.ask(Command::Hello);
            while let Some(received) = self.next(Duration::ZERO) {
                match received.event {
                    Event::Closed => break,
                    Event::Raw(raw) => bytes += raw.len(),
                    Event::Telemetry(_) => frames += 1,
                    Event::Damaged(FrameError::UnknownMessage(Some(version))) => other_version = Some(version),
                    _ => {}
                }
            }
            match (answer, other_version) {
                (Ok(Reply::Info(info)), _) if info.protocol == VERSION && info.schema == SCHEMA => return Ok(info),
                (Ok(Reply::Info(info)), _) if info.protocol == VERSION => {
                    return Err(LinkError::OtherSchema { path: self.path.clone() });
                }
                (Ok(Reply::Info(Info { protocol: theirs, .. })), _) | (_, Some(theirs)) => {
                    return Err(LinkError::OtherVersion { path: self.path.clone(), theirs });
                }
                // The first sequence number may by chance equal the last one of an earlier program. The board then
                // takes the handshake for a repetition of that request, and answers that.
                (Ok(_) | Err(LinkError::Refused { .. }), _) if !asked_before => {}
                (Ok(other), _) => return Err(self.wrong_answer(&Command::Hello, &other)),
                (Err(LinkError::NoAnswer { .. }), _) => {}
                (Err(LinkError::Closed { path }), _) => return Err(LinkError::Vanished { path }),
                (Err(error), _) => return Err(error),
            }
            asked_before = true;
        }
        let path = self.path.clone();
        Err(match bytes {
            0 => LinkError::Silent { path, waited: begun.elapsed() },
            _ if frames > 0 => LinkError::RequestsIgnored { path },
            bytes => LinkError::OtherProgram { path, bytes },
        })
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // The thread stops the motors when the channel of requests closes.
        match &mut self.server {
            Server::Thread { thread, .. } => {
                // A closed channel of requests makes the thread stop the motors.
                (self.requests, _) = channel();
                let _ = thread.take().map(JoinHandle::join);
            }
            Server::Own(worker) => drop(worker.take().map(|worker| worker.end())),
        }
    }
}

/// Lets a board that waits for this program advance by a slice. Returns whether it is still running.
fn step(worker: &RefCell<Option<Box<Worker<LockStep>>>>) -> bool {
    let mut worker = worker.borrow_mut();
    let is_running = worker.as_mut().is_some_and(|worker| worker.step().is_ok());
    if !is_running {
        *worker = None;
    }
    is_running
}

/// Returns a first sequence number that hardly equals an earlier program's last one, which the board remembers.
fn first_seq() -> u8 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.subsec_micros() as u8)
}

fn name(command: &Command) -> String {
    match command {
        Command::Hello => "the handshake".into(),
        Command::SetSpeeds([w1, w2]) => format!("speeds of {} and {} rpm", w1.rpm(), w2.rpm()),
        Command::WriteSettings(_) => "new settings".into(),
        other => format!("{other:?}"),
    }
}
