//! Runs work that Ctrl-C can end, with the interpreter's lock released.

use crate::failure::Failure;
use crate::threads;
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

/// Longest time until Python handles a signal.
const SIGNALS: Duration = Duration::from_millis(50);

/// Runs `work` on a thread of its own, while this one lets Python handle signals. After Ctrl-C, the flag that `work` gets
/// is set, its result is dropped, and the exception of the signal is returned.
///
/// # Errors
/// The exception of a signal, or the error of the work.
pub fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    counted(py, None, [0; 2], |stop, _| work(stop))
}

/// Like `interruptible`, and calls `progress` now and then with the number of finished points, which `work` counts from `before`
/// on, and the number of all points. An exception of `progress` ends the work like a signal.
pub fn counted<T: Send>(
    py: Python<'_>,
    progress: Option<Bound<'_, PyAny>>,
    [before, all]: [u64; 2],
    work: impl FnOnce(&AtomicBool, &AtomicU64) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let (stop, ended, done, mut shown) = (AtomicBool::new(false), AtomicBool::new(false), AtomicU64::new(before), None);
    let mut show = || {
        let now = done.load(Ordering::Relaxed);
        match &progress {
            Some(call) if shown.replace(now) != Some(now) => call.call1((now, all)).map(drop),
            _ => Ok(()),
        }
    };
    let waiting = thread::current();
    let result = thread::scope(|scope| {
        let worker = scope.spawn(|| {
            let result = threads::run(|| work(&stop, &done));
            ended.store(true, Ordering::Release);
            waiting.unpark();
            result
        });
        let mut signal = Ok(());
        while signal.is_ok() && !ended.load(Ordering::Acquire) && !worker.is_finished() {
            py.detach(|| thread::park_timeout(SIGNALS));
            signal = py.check_signals().and_then(|()| show());
        }
        stop.store(signal.is_err(), Ordering::Relaxed);
        let result = py.detach(|| worker.join());
        signal?;
        result.unwrap_or_else(|panic| resume_unwind(panic)).map_err(PyErr::from)
    })?;
    show()?;
    Ok(result)
}
