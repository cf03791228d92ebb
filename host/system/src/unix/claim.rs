//! Exclusive use of a board. Opening the port of a Nano resets it, so only one biflag may use it, even while avrdude
//! has the port open on its behalf.
//!
//! The claim is the name of an abstract socket of Linux, which needs no file; elsewhere it is a locked file. The kernel
//! releases it however the program ends. Keeping the port open would not work: avrdude could then not reset the board by
//! opening it.

use std::io::{Error, ErrorKind, Result};
use std::os::fd::OwnedFd;
use std::os::unix::fs::MetadataExt;
use std::time::{Duration, Instant};

/// Longest wait of a claim: for a moment, a program that is being started holds the names of the program that starts it.
const WAIT: Duration = Duration::from_millis(200);

/// Exclusive use of a port until it is dropped.
#[derive(Debug)]
pub struct Claim {
    _name: OwnedFd,
}

impl Claim {
    /// Claims the port.
    ///
    /// # Errors
    /// [`ErrorKind::ResourceBusy`] if another biflag has it; errors of the look-up of its device.
    pub fn take(path: &str) -> Result<Self> {
        // A device can have several names, and links to them.
        let device = std::fs::metadata(path)?;
        let name = format!("biflag-port-{:x}-{:x}-{:x}", device.rdev(), device.dev(), device.ino());
        let begun = Instant::now();
        loop {
            match hold(&name)? {
                Some(name) => return Ok(Self { _name: name }),
                None if begun.elapsed() > WAIT => return Err(Error::from(ErrorKind::ResourceBusy)),
                None => std::thread::sleep(WAIT / 20),
            }
        }
    }
}

/// Takes a name; returns `None` while another program has it.
#[cfg(target_os = "linux")]
fn hold(name: &str) -> Result<Option<OwnedFd>> {
    use std::os::{linux::net::SocketAddrExt, unix::net};
    match net::UnixDatagram::bind_addr(&net::SocketAddr::from_abstract_name(name)?) {
        Err(error) if error.kind() == ErrorKind::AddrInUse => Ok(None),
        socket => Ok(Some(socket?.into())),
    }
}

#[cfg(not(target_os = "linux"))]
fn hold(name: &str) -> Result<Option<OwnedFd>> {
    let file = std::fs::File::options().append(true).create(true).open(std::env::temp_dir().join(name))?;
    match file.try_lock() {
        Err(std::fs::TryLockError::WouldBlock) => Ok(None),
        locked => Ok(Some(locked.map(|()| file.into())?)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_claimed_once_under_all_its_names() {
        let folder = tempfile::tempdir().unwrap();
        let [port, link] = ["ttyUSB0", "by-id"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
        std::fs::write(&port, "").unwrap();
        std::os::unix::fs::symlink(&port, &link).unwrap();
        let claim = Claim::take(&port).unwrap();
        let failed = |path: &str| Claim::take(path).unwrap_err().kind();
        assert_eq!([failed(&port), failed(&link)], [ErrorKind::ResourceBusy; 2]);
        drop(claim);
        Claim::take(&link).unwrap();
        assert_eq!(failed("/dev/no-such-port"), ErrorKind::NotFound);
    }
}
