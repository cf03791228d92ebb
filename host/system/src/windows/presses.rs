//! Events of the console: Ctrl-C, Ctrl-Break, and its end.

use std::io::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use windows_sys::Win32::Foundation::TRUE;
use windows_sys::Win32::System::Console::{CTRL_BREAK_EVENT, CTRL_C_EVENT, SetConsoleCtrlHandler};
use windows_sys::Win32::System::Threading::{GetCurrentProcess, TerminateProcess};

/// The flag to set, and the function to call.
struct Hearing {
    interrupted: Arc<AtomicBool>,
    pressed: Mutex<Box<dyn FnMut() + Send>>,
}

static HEARING: OnceLock<Hearing> = OnceLock::new();

/// Sets a flag at Ctrl-C and Ctrl-Break, and when the console closes; also calls a function, on a thread of its own, for each
/// Ctrl-C and Ctrl-Break. To be called once in a program.
pub fn hear(interrupted: &Arc<AtomicBool>, pressed: impl FnMut() + Send + 'static) -> Result<()> {
    let interrupted = Arc::clone(interrupted);
    HEARING.get_or_init(|| Hearing { interrupted, pressed: Mutex::new(Box::new(pressed)) });
    // SAFETY: the handler may be called at any time from now on.
    match unsafe { SetConsoleCtrlHandler(Some(handle), TRUE) } {
        0 => Err(Error::last_os_error()),
        _ => Ok(()),
    }
}

/// Called by the system, on a new thread each time.
unsafe extern "system" fn handle(event: u32) -> i32 {
    let Some(hearing) = HEARING.get() else { return TRUE };
    hearing.interrupted.store(true, Ordering::Relaxed);
    if event == CTRL_C_EVENT || event == CTRL_BREAK_EVENT {
        hearing.pressed.lock().unwrap_or_else(PoisonError::into_inner)();
        return TRUE;
    }
    // The console closes. The system ends the program as soon as this returns, or after five seconds.
    loop {
        std::thread::park();
    }
}

/// Ends the program at once, whatever its threads wait for.
pub fn end(code: u8) -> ! {
    // SAFETY: the handle of this program is valid.
    unsafe { TerminateProcess(GetCurrentProcess(), code.into()) };
    std::process::abort()
}

/// Nothing limits the size of files here but the disk, whose writes fail.
pub fn survive_file_limits() {}
