//! Finds and opens the serial port.

use super::error::LinkError;
use super::worker::{Disconnected, Line};
use serialport::{ClearBuffer, SerialPort, SerialPortInfo, SerialPortType};
use std::io::{self, ErrorKind};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime};
use system::claim::Claim;
use system::port;

/// Longest wait for a byte, and so the longest delay of a request.
const READ_TIMEOUT: Duration = Duration::from_millis(2);

/// Boards with USB ids of their own, and whether they have the chip of the firmware (`boards.txt` of Arduino's cores avr and
/// megaavr). Other boards, such as a Nano, have the ids of their converter.
const ARDUINOS: [(u16, u16, &str, bool); 5] = [
    (0x2341, 0x0043, "Uno R3", true),
    (0x2A03, 0x0043, "Uno R3", true),
    (0x2341, 0x0243, "Uno R3", true),
    (0x2341, 0x0001, "Uno", true),
    (0x2341, 0x0058, "Nano Every", false),
];

fn listed() -> Vec<SerialPortInfo> {
    // `serialport` panics without the list.
    if port::are_listed() { serialport::available_ports().unwrap_or_default() } else { Vec::new() }
}

/// Returns the name of the Arduino on a port, if its USB ids show it, and whether it has the chip of the firmware.
pub fn arduino(path: &str) -> Option<(&'static str, bool)> {
    match listed().into_iter().find(|port| port.port_name == path)?.port_type {
        SerialPortType::UsbPort(usb) => named(usb.vid, usb.pid),
        _ => None,
    }
}

fn named(vid: u16, pid: u16) -> Option<(&'static str, bool)> {
    ARDUINOS.into_iter().find(|board| (board.0, board.1) == (vid, pid)).map(|(.., name, fits)| (name, fits))
}

/// Returns the possible ports of a robot: serial converters on USB.
pub fn robots() -> Vec<String> {
    let usb = |port: &SerialPortInfo| matches!(port.port_type, SerialPortType::UsbPort(_));
    let mut names: Vec<String> = listed()
        .into_iter()
        .filter(|port| usb(port) || port.port_name.contains("ttyUSB") || port.port_name.contains("ttyACM"))
        // A Mac's second name of a port. Opening it would wait for a carrier.
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
/// [`LinkError::NotFound`], [`LinkError::Busy`], [`LinkError::NotPermitted`], [`LinkError::NotSerial`], [`LinkError::OtherChip`] or
/// [`LinkError::Port`].
pub fn probe(path: &str) -> Result<(), LinkError> {
    let is_serial = port::is_serial(path).map_err(|error| classify(path, error))?;
    let path_of = || path.to_owned();
    match arduino(path) {
        _ if !is_serial => Err(LinkError::NotSerial { path: path_of(), available: robots() }),
        Some((name, false)) => Err(LinkError::OtherChip { path: path_of(), name }),
        _ => Ok(()),
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
            // DTR resets the board. Linux sets it by itself, and a pseudo-terminal has no DTR.
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
    fn boards_are_named_by_their_usb_ids() {
        assert_eq!(
            (named(0x2341, 0x0043), named(0x2341, 0x0058)),
            (Some(("Uno R3", true)), Some(("Nano Every", false)))
        );
        // The converters of a Nano and of a clone.
        assert_eq!((named(0x0403, 0x6001), named(0x1A86, 0x7523)), (None, None));
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
