//! Numbers of threads that users give.

use crate::failure::Failure;
use std::thread::available_parallelism;

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
