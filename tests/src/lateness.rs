//! The lateness of a busy computer.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Measures how late the computer wakes a thread that sleeps for 5 ms, from its start on.
pub struct Lateness {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    ends: AtomicBool,
    worst_us: AtomicU64,
}

impl Lateness {
    /// A measured action passes through some five threads one after the other, each of which may be woken late.
    const THREADS: u32 = 5;

    /// Starts to measure.
    pub fn measure() -> Self {
        const NAP: Duration = Duration::from_millis(5);
        let shared = Arc::<Shared>::default();
        let own = shared.clone();
        let thread = std::thread::spawn(move || {
            while !own.ends.load(Ordering::Relaxed) {
                let begun = Instant::now();
                std::thread::sleep(NAP);
                let late = begun.elapsed().saturating_sub(NAP);
                own.worst_us.fetch_max(late.as_micros() as u64, Ordering::Relaxed);
            }
        });
        Self { shared, thread: Some(thread) }
    }

    /// Returns the delay that the computer may have added to something measured since the start.
    pub fn allowed(&self) -> Duration {
        Self::THREADS * Duration::from_micros(self.shared.worst_us.load(Ordering::Relaxed))
    }
}

impl Drop for Lateness {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
