//! Exclusive use of a board. Opening the port of a Nano resets it, so only one biflag may use it, even while avrdude
//! has the port open on its behalf.
//!
//! The claim is a named mutex that nobody waits for: its name is taken while a program has it open, and the system
//! releases it however the program ends.

use super::{device_name, wide};
use std::io::{Error, ErrorKind, Result};
use std::os::windows::io::{FromRawHandle, OwnedHandle};
use std::ptr::null;
use windows_sys::Win32::Foundation::{ERROR_ACCESS_DENIED, ERROR_ALREADY_EXISTS, FALSE, GetLastError};
use windows_sys::Win32::Storage::FileSystem::QueryDosDeviceW;
use windows_sys::Win32::System::Threading::CreateMutexW;

/// Exclusive use of a port until it is dropped.
#[derive(Debug)]
pub struct Claim {
    _name: OwnedHandle,
}

impl Claim {
    /// Claims the port.
    ///
    /// # Errors
    /// [`ErrorKind::ResourceBusy`] if another biflag has it; errors of the look-up of its device.
    pub fn take(path: &str) -> Result<Self> {
        // A global name is common to all users of this computer.
        let name = wide(&format!(r"Global\biflag-port-{}", device(path)?.replace('\\', "/")));
        // SAFETY: the name ends with a zero.
        let mutex = unsafe { CreateMutexW(null(), FALSE, name.as_ptr()) };
        // SAFETY: it has no conditions.
        let error = unsafe { GetLastError() };
        if mutex.is_null() {
            // Another user's mutex denies access.
            let is_taken = error == ERROR_ACCESS_DENIED;
            return Err(if is_taken { ErrorKind::ResourceBusy.into() } else { Error::from_raw_os_error(error as i32) });
        }
        // SAFETY: the handle is valid, and has no other owner.
        let name = unsafe { OwnedHandle::from_raw_handle(mutex) };
        if error == ERROR_ALREADY_EXISTS { Err(ErrorKind::ResourceBusy.into()) } else { Ok(Self { _name: name }) }
    }
}

/// Returns the device of a port, which can have several names.
fn device(path: &str) -> Result<String> {
    let mut device = [0; 512];
    let name = wide(device_name(path));
    // SAFETY: the name ends with a zero, and the buffer has the stated length.
    let length = unsafe { QueryDosDeviceW(name.as_ptr(), device.as_mut_ptr(), device.len() as u32) };
    if length == 0 {
        return Err(Error::last_os_error());
    }
    let first = device.split(|unit| *unit == 0).next().unwrap_or_default();
    Ok(String::from_utf16_lossy(first).to_uppercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_claimed_once_under_all_its_names() {
        // Every Windows has this device.
        let claim = Claim::take("NUL").unwrap();
        let failed = |path: &str| Claim::take(path).unwrap_err().kind();
        assert_eq!([failed("nul"), failed(r"\\.\NUL")], [ErrorKind::ResourceBusy; 2]);
        drop(claim);
        Claim::take("nul").unwrap();
        assert_eq!(failed("COM251"), ErrorKind::NotFound);
    }
}
