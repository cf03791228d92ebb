//! Signals: interruption by the user, and limits on the size of files.

use miette::{IntoDiagnostic, WrapErr};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::{flag, low_level};
use std::ffi::c_int;
use std::io::{self, Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

/// The exit code of a program that the user has interrupted.
pub const INTERRUPTED: u8 = 130;

/// A Ctrl-C that follows another one sooner is the same: wrappers pass on the signal that the terminal has sent already.
const SAME: Duration = Duration::from_millis(500);

/// Longest wait for the last words: the terminal may hang as well.
const LAST_WORDS: Duration = Duration::from_millis(500);

/// The flag of [`interruption`].
static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Returns whether the user has interrupted a command that handles it.
pub fn is_interrupted() -> bool {
    FLAG.get().is_some_and(|flag| flag.load(Ordering::Relaxed))
}

/// Returns a flag that is set by Ctrl-C, by a request to end, and when the terminal closes. To be called once in a
/// program.
///
/// The program then closes its files, which takes for ever on a disk that hangs: a second Ctrl-C, half a second later or
/// more, ends it at once.
///
/// A signal that was ignored when the program started stays ignored: `nohup` and shells ask for this, so that jobs in the
/// background survive the end of the terminal and a Ctrl-C for the job in front.
///
/// # Errors
/// If the system does not allow the program to handle a signal.
pub fn interruption() -> miette::Result<Arc<AtomicBool>> {
    let interrupted = Arc::clone(FLAG.get_or_init(Arc::default));
    let hears_ctrl_c = !is_ignored(SIGINT);
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        if !is_ignored(signal) {
            flag::register(signal, Arc::clone(&interrupted)).into_diagnostic().wrap_err("Ctrl-C")?;
        }
    }
    if hears_ctrl_c {
        end_at_second().into_diagnostic().wrap_err("Ctrl-C")?;
    }
    Ok(interrupted)
}

/// Ends the program at the second Ctrl-C.
fn end_at_second() -> io::Result<()> {
    let (mut presses, signals) = UnixStream::pair()?;
    low_level::pipe::register(SIGINT, signals)?;
    thread::Builder::new().name("Ctrl-C".into()).spawn(move || {
        let mut first: Option<Instant> = None;
        while let Ok(1..) = presses.read(&mut [0; 16]) {
            if first.get_or_insert_with(Instant::now).elapsed() > SAME {
                say_what_is_lost();
                low_level::exit(INTERRUPTED.into());
            }
        }
    })?;
    Ok(())
}

/// Prints the program's last words, from a thread of their own.
fn say_what_is_lost() {
    let (said, is_said) = channel();
    thread::spawn(move || {
        let _ = writeln!(
            io::stderr(),
            "interrupted again: ended at once. What was not on the disk yet is lost, and the last log may be cut off \
             (`biflag recover` keeps its beginning). Motors that turn stop at the board's deadline."
        );
        let _ = said.send(());
    });
    let _ = is_said.recv_timeout(LAST_WORDS);
}

/// Makes a write beyond the limit on the size of files (`ulimit -f`) an error instead of the end of the program.
pub fn survive_file_limits() {
    // Where the signal cannot be handled, the program ends as before. Nobody reads the flag: the write itself fails.
    let _ = flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
}

/// Returns whether this program ignores a signal, as it may have been started to. It is known on Linux only; other systems
/// give `false`.
pub fn is_ignored(signal: c_int) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|set| set & 1 << (signal - 1) != 0)
}
