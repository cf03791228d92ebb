//! Work with the interpreter's lock released that Ctrl-C ends.

use crate::failure::Failure;
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Longest time until Python handles a signal.
const SIGNALS: Duration = Duration::from_millis(50);

/// Runs `work` on a thread of its own, while this one lets Python handle signals. After Ctrl-C, the flag that `work` gets
/// is set, its result is dropped, and the exception of the signal is returned.
///
/// # Errors
/// The exception of a signal, or that of the work.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    watched(py, |_| Ok(()), work)
}

/// The same, and calls `look` from time to time, whose exception ends the work as a signal does.
///
/// # Errors
/// The exception of a signal or of `look`, or that of the work.
pub fn watched<'py, T: Send>(
    py: Python<'py>,
    mut look: impl FnMut(Python<'py>) -> PyResult<()>,
    work: impl FnOnce(&AtomicBool) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let (stop, done) = (AtomicBool::new(false), AtomicBool::new(false));
    let waiting = thread::current();
    thread::scope(|scope| {
        let worker = scope.spawn(|| {
            let result = work(&stop);
            done.store(true, Ordering::Release);
            waiting.unpark();
            result
        });
        let mut signal = Ok(());
        while signal.is_ok() && !done.load(Ordering::Acquire) && !worker.is_finished() {
            py.detach(|| thread::park_timeout(SIGNALS));
            signal = py.check_signals().and_then(|()| look(py));
        }
        stop.store(signal.is_err(), Ordering::Relaxed);
        let result = py.detach(|| worker.join());
        signal?;
        result.unwrap_or_else(|panic| resume_unwind(panic)).map_err(PyErr::from)
    })
}
