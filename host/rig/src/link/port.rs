//! Finds and opens the serial port.

use super::error::LinkError;
use super::worker::{Disconnected, Line};
use serialport::{ClearBuffer, SerialPort, SerialPortType};
use std::io::{self, ErrorKind};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};
use system::claim::Claim;
use system::port;

/// Longest wait for a byte, and so the longest delay of a request.
const READ_TIMEOUT: Duration = Duration::from_millis(2);

/// Returns the possible ports of a robot: serial converters on USB.
pub fn robots() -> Vec<String> {
    // `serialport` panics without the list.
    if !port::are_listed() {
        return Vec::new();
    }
    let usb = |port: &serialport::SerialPortInfo| matches!(port.port_type, SerialPortType::UsbPort(_));
    let mut names: Vec<String> = serialport::available_ports()
        .unwrap_or_default()
        .into_iter()
        .filter(|port| usb(port) || port.port_name.contains("ttyUSB") || port.port_name.contains("ttyACM"))
        // A Mac's other name of a port, whose opening waits for a carrier.
        .filter(|port| !port.port_name.starts_with("/dev/tty."))
        .map(|port| port.port_name)
        .collect();
    names.sort();
    names.dedup();
    names
}

/// Returns the port that the user named, or the only one with a board.
///
/// # Errors
/// [`LinkError::NoBoard`] or [`LinkError::SeveralBoards`].
pub fn choose(named: Option<&str>) -> Result<String, LinkError> {
    named.map_or_else(|| the_only(robots()), |name| Ok(name.to_owned()))
}

fn the_only(mut available: Vec<String>) -> Result<String, LinkError> {
    match available.len() {
        0 => Err(LinkError::NoBoard),
        1 => Ok(available.remove(0)),
        _ => Err(LinkError::SeveralBoards { available }),
    }
}

/// Checks that the path is a serial port that is free and accessible.
///
/// # Errors
/// [`LinkError::NotFound`], [`LinkError::Busy`], [`LinkError::NotPermitted`], [`LinkError::NotSerial`] or
/// [`LinkError::Port`].
pub fn probe(path: &str) -> Result<(), LinkError> {
    if port::is_serial(path).map_err(|error| classify(path, error))? {
        Ok(())
    } else {
        Err(LinkError::NotSerial { path: path.to_owned(), available: robots() })
    }
}

/// Claims the port.
///
/// # Errors
/// [`LinkError::Busy`] if another biflag has it, [`LinkError::NotFound`], [`LinkError::Port`].
pub fn claim(path: &str) -> Result<Claim, LinkError> {
    Claim::take(path).map_err(|error| classify(path, error))
}

/// An open port.
pub(super) struct Port {
    port: Box<dyn SerialPort>,
    opened: Instant,
}

impl Port {
    /// Opens the port at the protocol's speed and locks it.
    pub fn open(path: &str) -> Result<Self, LinkError> {
        // `serialport` reports a port in use as missing.
        probe(path)?;
        let port = serialport::new(path, protocol::BAUD)
            .timeout(READ_TIMEOUT)
            // It resets the board. Linux does so by itself, and a pseudo-terminal has no such line.
            .dtr_on_open(true)
            .open()
            .map_err(|error| classify(path, error.into()))?;
        // An answer to an earlier program must not be taken for the answer to the first request.
        port.clear(ClearBuffer::Input).map_err(|error| classify(path, error.into()))?;
        Ok(Self { port, opened: Instant::now() })
    }
}

impl Line for Port {
    fn read(&mut self) -> Result<Vec<u8>, Disconnected> {
        let mut buffer = [0; 1024];
        match self.port.read(&mut buffer) {
            Ok(0) => Err(Disconnected),
            Ok(read) => Ok(buffer[..read].to_vec()),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(Vec::new()),
            Err(_) => Err(Disconnected),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Disconnected> {
        self.port.write_all(bytes).map_err(|_| Disconnected)
    }

    fn now(&self) -> Duration {
        self.opened.elapsed()
    }

    fn wall(&self) -> SystemTime {
        SystemTime::now()
    }
}

pub(super) fn classify(path: &str, source: io::Error) -> LinkError {
    match source.kind() {
        // Another program was faster; `serialport` reports this as a missing port.
        io::ErrorKind::NotFound if Path::new(path).exists() => busy(path),
        io::ErrorKind::NotFound => LinkError::NotFound { path: path.to_owned(), available: robots() },
        io::ErrorKind::PermissionDenied => LinkError::NotPermitted { path: path.to_owned(), group: port::group(path) },
        io::ErrorKind::IsADirectory => LinkError::NotSerial { path: path.to_owned(), available: robots() },
        io::ErrorKind::ResourceBusy => busy(path),
        _ => LinkError::Port { path: path.to_owned(), source },
    }
}

pub(super) fn busy(path: &str) -> LinkError {
    LinkError::Busy { path: path.to_owned(), holder: port::holder(path) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use miette::Diagnostic;

    #[test]
    fn without_a_name_there_must_be_one_board() {
        assert_eq!(the_only(vec!["/dev/ttyUSB0".into()]).unwrap(), "/dev/ttyUSB0");
        let none = the_only(Vec::new()).unwrap_err();
        assert_eq!(none.to_string(), "No board found. Plug it in or pass --port.");
        let several = the_only(vec!["/dev/ttyUSB0".into(), "/dev/ttyUSB1".into()]).unwrap_err();
        assert_eq!(several.to_string(), "Several boards found: /dev/ttyUSB0, /dev/ttyUSB1. Pass one with --port.");
        assert!([none, several].iter().all(|error| error.code().unwrap().to_string() == "wrong_use"));
    }

    #[test]
    fn a_missing_port_is_named() {
        let error = probe("/dev/no-such-port").unwrap_err();
        assert!(matches!(&error, LinkError::NotFound { path, .. } if path == "/dev/no-such-port"));
        assert!(error.to_string().contains("/dev/no-such-port"));
    }

    #[test]
    fn a_path_that_is_not_a_serial_port_is_refused() {
        for path in ["/dev/null", "/dev"] {
            assert!(matches!(probe(path), Err(LinkError::NotSerial { .. })), "{path}");
        }
    }

    #[test]
    fn a_port_in_use_is_busy() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = file.path().to_str().unwrap();
        let first = std::fs::File::open(path).unwrap();
        assert!(matches!(probe(path), Err(LinkError::NotSerial { .. })));
        first.lock().unwrap();
        let Err(LinkError::Busy { holder, .. }) = probe(path) else { panic!("the port is in use") };
        assert_eq!(holder, None, "this process does not count");
    }

    #[test]
    fn a_forbidden_port_names_the_group_to_join() {
        let error = LinkError::NotPermitted { path: "/dev/ttyUSB0".into(), group: "dialout".into() };
        assert!(error.help().unwrap().to_string().contains("usermod -aG dialout"));
    }
}
