//! Signals by which a user ends a program.

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::{flag, low_level};
use std::ffi::c_int;
use std::io::{Read, Result};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;

/// Sets a flag at Ctrl-C, at a request to end, and when the terminal closes; also calls a function, on a thread of its own,
/// for each Ctrl-C. To be called once in a program.
///
/// A signal that was ignored when the program started stays ignored: `nohup` and shells ask for this, so that jobs in the
/// background survive the end of the terminal and a Ctrl-C for the job in front.
pub fn hear(interrupted: &Arc<AtomicBool>, mut pressed: impl FnMut() + Send + 'static) -> Result<()> {
    let hears_ctrl_c = !is_ignored(SIGINT);
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if !is_ignored(signal) {
            flag::register(signal, Arc::clone(interrupted))?;
        }
    }
    if hears_ctrl_c {
        let (mut presses, signals) = UnixStream::pair()?;
        low_level::pipe::register(SIGINT, signals)?;
        thread::Builder::new().name("Ctrl-C".into()).spawn(move || {
            while let Ok(1..) = presses.read(&mut [0; 16]) {
                pressed();
            }
        })?;
    }
    Ok(())
}

/// Ends the program at once, whatever its threads wait for.
pub fn end(code: u8) -> ! {
    low_level::exit(code.into())
}

/// Makes a write beyond the limit on the size of files (`ulimit -f`) an error instead of the end of the program.
pub fn survive_file_limits() {
    // Where the signal cannot be handled, the program ends as before. Nobody reads the flag: the write itself fails.
    let _ = flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

/// Returns whether this program ignores a signal, as its parent may have arranged. This is known on Linux only; other systems
/// give `false`.
pub fn is_ignored(signal: c_int) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|set| set & 1 << (signal - 1) != 0)
}
