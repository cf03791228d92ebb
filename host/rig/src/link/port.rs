//! Finds and opens the serial port.

use super::LinkError;
use rustix::fs::{FlockOperation, Mode, OFlags};
use serialport::{ClearBuffer, SerialPort, SerialPortType};
use std::fs;
use std::io::{self, IsTerminal};
use std::os::fd::OwnedFd;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::Duration;

/// Longest wait for a byte, and so the longest delay of a request.
const READ_TIMEOUT: Duration = Duration::from_millis(2);

/// Returns the possible ports of a robot: serial converters on USB.
pub fn robots() -> Vec<String> {
    // `serialport` panics without this folder, which is missing in some containers.
    if !Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let usb = |port: &serialport::SerialPortInfo| matches!(port.port_type, SerialPortType::UsbPort(_));
    let mut names: Vec<String> = serialport::available_ports()
        .unwrap_or_default()
        .into_iter()
        .filter(|port| usb(port) || port.port_name.contains("ttyUSB") || port.port_name.contains("ttyACM"))
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
    if lock(path)?.is_terminal() {
        Ok(())
    } else {
        Err(LinkError::NotSerial { path: path.to_owned(), available: robots() })
    }
}

/// Opens and locks the port. The kernel's own exclusive mode does not apply to the superuser, so programs also lock the
/// port.
fn lock(path: &str) -> Result<OwnedFd, LinkError> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let port = rustix::fs::open(path, flags, Mode::empty()).map_err(|error| classify(path, error.into()))?;
    match rustix::fs::flock(&port, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(port),
        Err(rustix::io::Errno::WOULDBLOCK) => Err(busy(path)),
        Err(error) => Err(classify(path, error.into())),
    }
}

/// Opens the port at the protocol's speed and locks it.
pub(super) fn open(path: &str) -> Result<Box<dyn SerialPort>, LinkError> {
    // `serialport` reports a port in use as missing.
    probe(path)?;
    let port = serialport::new(path, protocol::BAUD)
        .timeout(READ_TIMEOUT)
        .open()
        .map_err(|error| classify(path, error.into()))?;
    // An answer to an earlier program must not be taken for the answer to the first request.
    port.clear(ClearBuffer::Input).map_err(|error| classify(path, error.into()))?;
    Ok(port)
}

/// Returns whether the board is emulated by a program: a pseudo-terminal has no cable.
pub(crate) fn is_emulated(path: &str) -> bool {
    fs::canonicalize(path).unwrap_or_else(|_| path.into()).starts_with("/dev/pts")
}

pub(super) fn classify(path: &str, source: io::Error) -> LinkError {
    match source.kind() {
        // Another program was faster; `serialport` reports this as a missing port.
        io::ErrorKind::NotFound if Path::new(path).exists() => busy(path),
        io::ErrorKind::NotFound => LinkError::NotFound { path: path.to_owned(), available: robots() },
        io::ErrorKind::PermissionDenied => LinkError::NotPermitted { path: path.to_owned(), group: group_of(path) },
        io::ErrorKind::IsADirectory => LinkError::NotSerial { path: path.to_owned(), available: robots() },
        io::ErrorKind::ResourceBusy => busy(path),
        _ => LinkError::Port { path: path.to_owned(), source },
    }
}

pub(super) fn busy(path: &str) -> LinkError {
    LinkError::Busy { path: path.to_owned(), holder: holder_of(path) }
}

/// Returns the group that owns the port: `dialout` on Debian.
fn group_of(path: &str) -> String {
    let gid = fs::metadata(path).map(|meta| meta.gid()).ok();
    let groups = fs::read_to_string("/etc/group").unwrap_or_default();
    let name = groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        let id = fields.nth(1)?.parse().ok();
        (id.is_some() && id == gid).then(|| name.to_owned())
    });
    name.unwrap_or_else(|| "dialout".to_owned())
}

/// Returns the process that has the port open, as `name, process 123`, if the system shows it.
fn holder_of(path: &str) -> Option<String> {
    let port = fs::canonicalize(path).ok()?;
    let own = std::process::id().to_string();
    fs::read_dir("/proc").ok()?.flatten().find_map(|process| {
        let id = process.file_name().into_string().ok()?;
        if id == own || !id.bytes().all(|byte| byte.is_ascii_digit()) {
            return None;
        }
        let mut files = fs::read_dir(process.path().join("fd")).ok()?.flatten();
        files.any(|file| fs::read_link(file.path()).is_ok_and(|target| target == port)).then(|| {
            let name = fs::read_to_string(Path::new("/proc").join(&id).join("comm")).unwrap_or_default();
            format!("{}, process {id}", name.trim())
        })
    })
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
        lock(path).unwrap();
        first.lock().unwrap();
        let Err(LinkError::Busy { holder, .. }) = lock(path) else { panic!("the port is in use") };
        assert_eq!(holder, None, "this process does not count");
    }

    #[test]
    fn a_forbidden_port_names_the_group_to_join() {
        let error = LinkError::NotPermitted { path: "/dev/ttyUSB0".into(), group: "dialout".into() };
        assert!(error.help().unwrap().to_string().contains("usermod -aG dialout"));
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(!group_of(file.path().to_str().unwrap()).is_empty());
    }
}
