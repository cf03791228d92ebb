//! Serial ports.

use super::device_name;
use std::fs::OpenOptions;
use std::io::{Error, ErrorKind, Result};
use std::mem::zeroed;
use std::os::windows::fs::OpenOptionsExt;
use std::os::windows::io::AsRawHandle;
use windows_sys::Win32::Devices::Communication::GetCommState;
use windows_sys::Win32::Foundation::{ERROR_ACCESS_DENIED, ERROR_SHARING_VIOLATION};

/// The name of a port.
pub const EXAMPLE: &str = "COM5";

/// Whether programs can emulate ports: it takes a driver.
pub const CAN_BE_EMULATED: bool = false;

/// Returns whether the system lists its ports.
pub fn are_listed() -> bool {
    true
}

/// Returns whether the port belongs to a program, and not to a cable.
pub fn is_emulated(_path: &str) -> bool {
    false
}

/// Returns whether the path is a serial port, which must be free and accessible.
///
/// # Errors
/// [`ErrorKind::ResourceBusy`] if another program uses it; errors of opening it.
pub fn is_serial(path: &str) -> Result<bool> {
    let device = format!(r"\\.\{}", device_name(path));
    let port = match OpenOptions::new().read(true).write(true).share_mode(0).open(device) {
        Err(error) if is_busy(&error) => return Err(ErrorKind::ResourceBusy.into()),
        port => port?,
    };
    // SAFETY: it consists of integers.
    let mut settings = unsafe { zeroed() };
    // SAFETY: the file is open, and the pointer is valid.
    Ok(unsafe { GetCommState(port.as_raw_handle(), &mut settings) } != 0)
}

/// One program at a time can open a port, and the others are denied access.
fn is_busy(error: &Error) -> bool {
    [ERROR_ACCESS_DENIED, ERROR_SHARING_VIOLATION].map(|code| Some(code as i32)).contains(&error.raw_os_error())
}

/// Returns the group that owns the port. Ports have no groups here: every user may open them.
pub fn group(_path: &str) -> String {
    String::new()
}

/// Returns the other process that has the port open. The system shows it to administrators only.
pub fn holder(_path: &str) -> Option<String> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_port_and_another_device_are_no_ports() {
        assert_eq!(is_serial("COM251").unwrap_err().kind(), ErrorKind::NotFound);
        assert!(!is_serial("NUL").unwrap());
    }
}
