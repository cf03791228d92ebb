//! A pseudo-terminal in the place of the Nano's serial port.
//!
//! A pseudo-terminal has no DTR line; opening it stands for DTR going low. It has no speed either, but it keeps the
//! speed that the host sets, so that a wrong one is noticed.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::io;
use std::os::fd::OwnedFd;
use std::time::Duration;

/// Speed of a new port, bit/s, until the host sets another.
const BAUD: u32 = 500_000;

/// Bytes that Linux keeps for a program that does not read the port of a Nano's USB converter: `TTYB_DEFAULT_MEM_LIMIT` of
/// its `drivers/tty/tty_buffer.c`, for the CH340, whose driver `ch341` does not stop the device before. They also wait there
/// while the kernel's own worker, which passes them on to the terminal, gets no processor. A pseudo-terminal keeps 20 kB.
pub const DRIVER_BUFFER: usize = 640 << 10;

/// The board's side of the port.
#[derive(Debug)]
pub struct Port {
    master: OwnedFd,
    /// The path that the host opens, such as `/dev/pts/3`.
    pub path: String,
    /// Whether the host has it open.
    pub is_open: bool,
}

/// Bytes from the board that no host got.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PortCount {
    /// Sent while nobody had the port open.
    pub unheard: u64,
    /// Sent to a host that did not read in time.
    pub lost: u64,
}

impl Port {
    /// Returns a new port, raw and at the speed of the board's program until the host sets another.
    pub fn new() -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        fcntl_setfl(&master, OFlags::NONBLOCK)?;
        let path = ptsname(&master, Vec::new())?.into_string().map_err(io::Error::other)?;
        let mut attributes = tcgetattr(&master)?;
        attributes.make_raw();
        attributes.set_speed(BAUD)?;
        tcsetattr(&master, OptionalActions::Now, &attributes)?;
        // The kernel reports a closed port only after it was open once.
        drop(open(&*path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?);
        Ok(Self { master, path, is_open: false })
    }

    /// Returns whether the host has opened it since the last call.
    pub fn was_opened(&mut self) -> io::Result<bool> {
        // The kernel reports a hang-up while nobody has the other side open.
        let open = !self.ready(PollFlags::empty(), Duration::ZERO)?.contains(PollFlags::HUP);
        Ok(!std::mem::replace(&mut self.is_open, open) && open)
    }

    /// Returns the speed that the host has set, bit/s.
    pub fn baud(&self) -> io::Result<u32> {
        Ok(tcgetattr(&self.master)?.output_speed())
    }

    /// Reads the bytes that the host has sent.
    pub fn read(&self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; 4096];
        match rustix::io::read(&self.master, &mut bytes) {
            Ok(length) => {
                bytes.truncate(length);
                Ok(bytes)
            }
            // EIO: the port is not open.
            Err(Errno::AGAIN | Errno::IO | Errno::INTR) => Ok(Vec::new()),
            Err(error) => Err(error.into()),
        }
    }

    /// Sends as many of `bytes` to the host as there is room for; returns their number.
    pub fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        match rustix::io::write(&self.master, bytes) {
            Ok(length) => Ok(length),
            Err(Errno::AGAIN | Errno::IO | Errno::INTR) => Ok(0),
            Err(error) => Err(error.into()),
        }
    }

    /// Waits until the host makes room, for `limit` at most.
    pub fn wait_for_room(&self, limit: Duration) -> io::Result<()> {
        self.ready(PollFlags::OUT, limit).map(drop)
    }

    /// Waits until the host has sent something, or for `limit`.
    pub fn wait_for_host(&self, limit: Duration) -> io::Result<()> {
        self.ready(PollFlags::IN, limit).map(drop)
    }

    fn ready(&self, wanted: PollFlags, limit: Duration) -> io::Result<PollFlags> {
        let mut fds = [PollFd::new(&self.master, wanted)];
        let limit = Timespec::try_from(limit).map_err(io::Error::other)?;
        match poll(&mut fds, Some(&limit)) {
            Ok(_) | Err(Errno::INTR) => Ok(fds[0].revents()),
            Err(error) => Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::OpenOptions;
    use std::io::{Read, Write};

    #[test]
    fn bytes_pass_unchanged_and_opening_shows() {
        let mut port = Port::new().unwrap();
        assert!(!port.was_opened().unwrap());
        let mut host = OpenOptions::new().read(true).write(true).open(&port.path).unwrap();
        assert!(port.was_opened().unwrap() && port.is_open);
        assert!(!port.was_opened().unwrap(), "it was open before");
        let every: Vec<u8> = (0..=255).collect();
        host.write_all(&every).unwrap();
        assert_eq!(port.read().unwrap(), every);
        assert_eq!(port.write(&every).unwrap(), 256);
        let mut back = vec![0; 256];
        host.read_exact(&mut back).unwrap();
        assert_eq!(back, every);
        assert_eq!(port.baud().unwrap(), BAUD);
        drop(host);
        assert!(!port.was_opened().unwrap() && !port.is_open);
        assert!(port.read().unwrap().is_empty());
    }
}
