//! The program's end of the link: open it, ask, and hear what comes.

use super::port;
use super::worker::{Event, Question, Received, Worker};
use super::{Claim, LinkError};
use protocol::frame::FrameError;
use protocol::{Command, Info, Reply, VERSION};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// An open link to a board that speaks our protocol. Closing it stops the motors.
#[derive(Debug)]
pub struct Link {
    path: String,
    opened: SystemTime,
    begun: Instant,
    /// When this end last showed a sign of life, ms since the link was opened.
    alive: Arc<AtomicU64>,
    info: Info,
    questions: Sender<Question>,
    events: Receiver<Received>,
    thread: Option<JoinHandle<()>>,
    _claim: Claim,
}

impl Link {
    /// How long a board may take to answer the first handshake: opening the port resets a Nano, and the older of its
    /// bootloaders waits for two seconds.
    pub const HANDSHAKE: Duration = Duration::from_secs(6);

    /// Opens the port and shakes hands.
    ///
    /// # Errors
    /// The port's errors, [`LinkError::Silent`], [`LinkError::OtherProgram`] or [`LinkError::OtherVersion`].
    pub fn open(path: &str) -> Result<Self, LinkError> {
        Self::open_unless(path, &AtomicBool::new(false))
    }

    /// Opens the port and shakes hands, unless the user interrupts it.
    ///
    /// # Errors
    /// As [`Link::open`], and [`LinkError::Interrupted`].
    pub fn open_unless(path: &str, interrupted: &AtomicBool) -> Result<Self, LinkError> {
        let claim = Claim::take(path)?;
        let port = port::open(path)?;
        let (questions, asked) = channel();
        let (sender, events) = channel();
        let opened = SystemTime::now();
        let alive = Arc::new(AtomicU64::new(0));
        let worker = Worker::new(port, asked, sender, alive.clone());
        let thread = std::thread::Builder::new()
            .name("link".into())
            .spawn(move || worker.run())
            .map_err(|source| LinkError::Port { path: path.to_owned(), source })?;
        let mut link = Self {
            path: path.to_owned(),
            opened,
            begun: Instant::now(),
            alive,
            info: Info::default(),
            questions,
            events,
            thread: Some(thread),
            _claim: claim,
        };
        link.info = link.handshake(interrupted)?;
        Ok(link)
    }

    /// The port.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// When it was opened, on the host's wall clock.
    pub fn opened(&self) -> SystemTime {
        self.opened
    }

    /// What the board said of itself in the handshake.
    pub fn info(&self) -> &Info {
        &self.info
    }

    /// Asks the board, and waits for its answer through several attempts.
    ///
    /// # Errors
    /// [`LinkError::NoAnswer`], [`LinkError::Refused`] or [`LinkError::Closed`].
    pub fn ask(&self, command: Command) -> Result<Reply, LinkError> {
        self.show_life();
        let (answer, answered) = channel();
        let closed = || LinkError::Closed { path: self.path.clone() };
        self.questions.send(Question { command, answer }).map_err(|_| closed())?;
        match answered.recv().map_err(|_| closed())? {
            Ok(Reply::Refused(refusal)) => Err(LinkError::Refused { command: name(&command), refusal }),
            Ok(reply) => Ok(reply),
            Err(attempts) => Err(LinkError::NoAnswer { path: self.path.clone(), command: name(&command), attempts }),
        }
    }

    /// Asks for something that is answered with [`Reply::Done`].
    ///
    /// # Errors
    /// As [`Link::ask`].
    pub fn command(&self, command: Command) -> Result<(), LinkError> {
        match self.ask(command)? {
            Reply::Done => Ok(()),
            other => Err(self.wrong_answer(&command, &other)),
        }
    }

    fn show_life(&self) {
        let now = u64::try_from(self.begun.elapsed().as_millis()).unwrap_or(u64::MAX);
        self.alive.store(now, Ordering::Relaxed);
    }

    /// An answer that does not fit its question.
    pub fn wrong_answer(&self, command: &Command, answer: &Reply) -> LinkError {
        LinkError::WrongAnswer { command: name(command), answer: format!("{answer:?}") }
    }

    /// The next thing that came, if any comes within `patience`.
    pub fn next(&self, patience: Duration) -> Option<Received> {
        self.show_life();
        match self.events.recv_timeout(patience) {
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
        let mut foreign = None;
        while begun.elapsed() < Self::HANDSHAKE {
            if interrupted.load(Ordering::Relaxed) {
                return Err(LinkError::Interrupted);
            }
            let answer = self.ask(Command::Hello);
            while let Ok(received) = self.events.try_recv() {
                match received.event {
                    Event::Raw(raw) => bytes += raw.len(),
                    Event::Telemetry(_) => frames += 1,
                    Event::Damaged(FrameError::Foreign(Some(version))) => foreign = Some(version),
                    _ => {}
                }
            }
            match (answer, foreign) {
                (Ok(Reply::Info(info)), _) if info.protocol == VERSION => return Ok(info),
                (Ok(Reply::Info(Info { protocol: theirs, .. })), _) | (_, Some(theirs)) => {
                    return Err(LinkError::OtherVersion { path: self.path.clone(), theirs });
                }
                (Ok(other), _) => return Err(self.wrong_answer(&Command::Hello, &other)),
                (Err(LinkError::NoAnswer { .. }), _) => {}
                (Err(LinkError::Closed { path }), _) => return Err(LinkError::Vanished { path }),
                (Err(error), _) => return Err(error),
            }
        }
        let path = self.path.clone();
        Err(match bytes {
            0 => LinkError::Silent { path, waited: begun.elapsed() },
            _ if frames > 0 => LinkError::Deaf { path },
            bytes => LinkError::OtherProgram { path, bytes },
        })
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // The thread sends a stop when its questions end.
        let (questions, _) = channel();
        self.questions = questions;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn name(command: &Command) -> String {
    match command {
        Command::Hello => "the handshake".into(),
        Command::SetSpeeds([w1, w2]) => format!("speeds of {} and {} rpm", w1.rpm(), w2.rpm()),
        Command::WriteSettings(_) => "new settings".into(),
        other => format!("{other:?}"),
    }
}
