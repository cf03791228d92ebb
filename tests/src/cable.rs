//! A serial cable between `biflag` and the emulated board, which a test can spoil.

use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// Converts the bytes that entered one direction of a cable since the last call, a fraction of a millisecond ago.
type Spoil = Box<dyn FnMut(&[u8]) -> Vec<u8> + Send>;

/// A cable. Dropping it pulls the plug.
pub struct Cable {
    path: String,
    ends: Arc<Ends>,
    thread: Option<JoinHandle<()>>,
}

struct Ends {
    pulled: AtomicBool,
    from_board: Mutex<Spoil>,
    to_board: Mutex<Spoil>,
}

impl Cable {
    /// Connects a cable to the board on `port`, and so resets it.
    pub fn new(port: &str) -> Self {
        let nonblocking = OFlags::NONBLOCK.bits() as i32;
        let mut board = File::options().read(true).write(true).custom_flags(nonblocking).open(port).expect("the board");
        let host = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a pseudo-terminal");
        grantpt(&host).and_then(|()| unlockpt(&host)).expect("its other end");
        fcntl_setfl(&host, OFlags::NONBLOCK).expect("reading without waiting");
        let mut attributes = tcgetattr(&host).expect("its mode");
        attributes.make_raw();
        tcsetattr(&host, OptionalActions::Now, &attributes).expect("a raw line");
        let path = ptsname(&host, Vec::new()).expect("its name").into_string().expect("text");
        let mut host = File::from(host);
        let clean = || Mutex::new(Box::new(<[u8]>::to_vec) as Spoil);
        let ends = Arc::new(Ends { pulled: AtomicBool::new(false), from_board: clean(), to_board: clean() });
        let shared = ends.clone();
        let thread = std::thread::spawn(move || {
            let (mut to_host, mut to_board) = (Vec::new(), Vec::new());
            while !shared.pulled.load(Ordering::Relaxed) {
                pass(&mut board, &mut host, &shared.from_board, &mut to_host);
                pass(&mut host, &mut board, &shared.to_board, &mut to_board);
                std::thread::sleep(Duration::from_micros(500));
            }
        });
        Self { path, ends, thread: Some(thread) }
    }

    /// Returns the port at the host's end.
    pub fn port(&self) -> &str {
        &self.path
    }

    /// Spoils what the board sends.
    pub fn spoil_from_board(&self, spoil: impl FnMut(&[u8]) -> Vec<u8> + Send + 'static) {
        *self.ends.from_board.lock().unwrap() = Box::new(spoil);
    }

    /// Spoils what the host sends.
    pub fn spoil_to_board(&self, spoil: impl FnMut(&[u8]) -> Vec<u8> + Send + 'static) {
        *self.ends.to_board.lock().unwrap() = Box::new(spoil);
    }
}

/// Passes bytes on. While a full port leaves some of them `waiting`, nothing more is read, so that a board that waits for its
/// reader also waits for the reader behind the cable. A port that no program has open cannot be read.
fn pass(from: &mut File, to: &mut File, spoil: &Mutex<Spoil>, waiting: &mut Vec<u8>) {
    if waiting.is_empty() {
        let mut bytes = [0; 4096];
        let count = from.read(&mut bytes).unwrap_or(0);
        *waiting = (spoil.lock().unwrap())(&bytes[..count]);
    }
    if !waiting.is_empty()
        && let Ok(taken) = to.write(waiting)
    {
        waiting.drain(..taken);
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.ends.pulled.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
