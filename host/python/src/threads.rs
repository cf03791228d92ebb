//! Numbers of threads that users give, and threads after a fork.

use crate::failure::Failure;
use std::process::id;
use std::sync::LazyLock;
use std::thread::available_parallelism;

/// The process that has imported the module.
pub static IMPORTED_IN: LazyLock<u32> = LazyLock::new(id);

/// Runs work on threads that exist: a process forked from the one that imported the module lacks the shared threads, and would
/// wait for them for ever.
pub fn run<T: Send>(work: impl FnOnce() -> Result<T, Failure> + Send) -> Result<T, Failure> {
    if *IMPORTED_IN == id() { work() } else { pool(None)?.install(work) }
}

/// Returns the number of threads: as many as cores if it is not given.
///
/// # Errors
/// A number that is not possible.
pub fn count(threads: Option<usize>) -> Result<usize, Failure> {
    match threads {
        Some(0) => Err(Failure::parameter("threads", "must be at least 1")),
        Some(threads) => Ok(threads),
        None => Ok(available_parallelism().map_or(1, usize::from)),
    }
}

/// Returns a pool of that many threads.
///
/// # Errors
/// A number that is not possible.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count(threads)?).build();
    pool.map_err(|error| Failure::parameter("threads", error.to_string()))
}
