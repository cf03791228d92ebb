//! Serial ports.

use rustix::fs::{Mode, OFlags};
use std::fs::{self, File, TryLockError};
use std::io::{ErrorKind, IsTerminal, Result};
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// The name of a port.
pub const EXAMPLE: &str = if IS_LINUX { "/dev/ttyUSB0" } else { "/dev/cu.usbserial-10" };

/// Whether the emulated board runs here.
pub const CAN_BE_EMULATED: bool = IS_LINUX;

const IS_LINUX: bool = cfg!(target_os = "linux");

/// Returns whether the system lists its ports: Linux does not in some containers.
pub fn are_listed() -> bool {
    !IS_LINUX || Path::new("/sys/class/tty").is_dir()
}

/// Returns whether the port belongs to a program, and not to a cable: whether it is a pseudo-terminal.
pub fn is_emulated(path: &str) -> bool {
    fs::canonicalize(path).unwrap_or_else(|_| path.into()).starts_with("/dev/pts")
}

/// Returns whether the path is a serial port, which must be free and accessible.
///
/// # Errors
/// [`ErrorKind::ResourceBusy`] if another program uses it; errors of opening it.
pub fn is_serial(path: &str) -> Result<bool> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let port = File::from(rustix::fs::open(path, flags, Mode::empty())?);
    // The kernel's own exclusive mode does not apply to the superuser, so programs also lock the port.
    match port.try_lock() {
        Ok(()) => Ok(port.is_terminal()),
        Err(TryLockError::WouldBlock) => Err(ErrorKind::ResourceBusy.into()),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Returns the group that owns the port: `dialout` on Debian.
pub fn group(path: &str) -> String {
    let id = fs::metadata(path).map(|meta| meta.gid().to_string()).unwrap_or_default();
    let groups = fs::read_to_string("/etc/group").unwrap_or_default();
    let mut groups = groups.lines().map(|line| line.split(':').collect::<Vec<_>>());
    groups.find(|fields| fields.get(2) == Some(&id.as_str())).map_or("dialout", |fields| fields[0]).to_owned()
}

/// Returns the other process that has the port open, as `name, process 123`, if the system shows it.
pub fn holder(path: &str) -> Option<String> {
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

    #[test]
    fn a_file_in_use_has_a_group_and_a_holder() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let path = file.path().to_str().unwrap();
        assert!(!group(path).is_empty());
        assert!(!is_serial(path).unwrap());
        let first = File::open(path).unwrap();
        first.lock().unwrap();
        assert_eq!(is_serial(path).unwrap_err().kind(), ErrorKind::ResourceBusy);
        assert_eq!(holder(path), None, "this process does not count");
        let mut child = std::process::Command::new("sleep").arg("60").stdin(File::open(path).unwrap()).spawn().unwrap();
        assert_eq!(holder(path), Some(format!("sleep, process {}", child.id())));
        child.kill().unwrap();
        child.wait().unwrap();
    }
}
