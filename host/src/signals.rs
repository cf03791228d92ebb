//! Signals: interruption by the user, and limits on the size of files.

use miette::{IntoDiagnostic, WrapErr};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use std::ffi::c_int;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Returns a flag that is set by Ctrl-C, by a request to end, and when the terminal closes. To be called once in a
/// program.
///
/// A signal that was ignored when the program started stays ignored: `nohup` and shells ask for this, so that jobs in the
/// background survive the end of the terminal and a Ctrl-C for the job in front.
///
/// # Errors
/// If the system does not allow the program to handle a signal.
pub fn interruption() -> miette::Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let ignored = ignored();
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if !is_in(ignored, signal) {
            flag::register(signal, Arc::clone(&interrupted)).into_diagnostic().wrap_err("Ctrl-C")?;
        }
    }
    Ok(interrupted)
}

/// Makes a write beyond the limit on the size of files (`ulimit -f`) an error instead of the end of the program.
pub(crate) fn survive_file_limits() {
    // Where the signal cannot be handled, the program ends as before. Nobody reads the flag: the write itself fails.
    let _ = flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

/// Returns the set of signals that this program was started to ignore, one bit each. It is known on Linux only; other
/// systems give none.
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

fn is_in(set: u64, signal: c_int) -> bool {
    set & 1 << (signal - 1) != 0
}
