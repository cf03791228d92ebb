//! One biflag at a time has a board, also while it has lent the port to avrdude: who opens the port of a Nano resets it.
//!
//! The claim is a name among the abstract sockets, which needs no file, and which the kernel gives back however the
//! program ends. Holding the port itself open instead would keep avrdude's opening of it from resetting the board.

use super::LinkError;
use super::port::{busy, classify};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

/// The right to a port, until it is dropped.
#[derive(Debug)]
pub struct Claim {
    _name: UnixDatagram,
}

impl Claim {
    /// Claims the port.
    ///
    /// # Errors
    /// [`LinkError::Busy`] where another biflag has it, [`LinkError::NotFound`], [`LinkError::Port`].
    pub fn take(path: &str) -> Result<Self, LinkError> {
        let failed = |error| classify(path, error);
        // One device has many names, by links too.
        let device = std::fs::metadata(path).map_err(failed)?;
        let name = format!("biflag-port-{:x}-{:x}-{:x}", device.rdev(), device.dev(), device.ino());
        let address = SocketAddr::from_abstract_name(name).map_err(failed)?;
        match UnixDatagram::bind_addr(&address) {
            Ok(name) => Ok(Self { _name: name }),
            Err(error) if error.kind() == std::io::ErrorKind::AddrInUse => Err(busy(path)),
            Err(error) => Err(failed(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_claimed_once_by_whatever_name_and_given_back() {
        let folder = tempfile::tempdir().unwrap();
        let [port, link] = ["ttyUSB0", "by-id"].map(|name| folder.path().join(name).to_str().unwrap().to_owned());
        std::fs::write(&port, "").unwrap();
        std::os::unix::fs::symlink(&port, &link).unwrap();
        let claim = Claim::take(&port).unwrap();
        assert!(matches!(Claim::take(&port), Err(LinkError::Busy { .. })));
        assert!(matches!(Claim::take(&link), Err(LinkError::Busy { .. })));
        drop(claim);
        Claim::take(&link).unwrap();
        assert!(matches!(Claim::take("/dev/no-such-port"), Err(LinkError::NotFound { .. })));
    }
}
