//! Exclusive use of a board. Opening the port of a Nano resets it, so only one biflag may use it, even while avrdude
//! has the port open on its behalf.
//!
//! The claim is the name of an abstract socket. It needs no file, and the kernel releases it however the program ends.
//! Keeping the port open would not work: avrdude could then not reset the board by opening it.

use super::LinkError;
use super::port::{busy, classify};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

/// Exclusive use of a port until it is dropped.
#[derive(Debug)]
pub struct Claim {
    _name: UnixDatagram,
}

impl Claim {
    /// Claims the port.
    ///
    /// # Errors
    /// [`LinkError::Busy`] if another biflag has it, [`LinkError::NotFound`], [`LinkError::Port`].
    pub fn take(path: &str) -> Result<Self, LinkError> {
        let failed = |error| classify(path, error);
        // A device can have several names, and links to them.
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
    fn a_port_is_claimed_once_under_all_its_names() {
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
