//! Time that the processor has spent.

use rustix::time::{ClockId, clock_gettime};

/// Returns the processor time of this thread, s.
pub fn thread_s() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}
