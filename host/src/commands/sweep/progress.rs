//! The progress of a sweep on stderr.

use crate::lock::lock;
use crate::progress::Progress;
use crate::sweep::{Counts, Record};
use crate::text::count;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Time between two lines, or two texts of the bar.
const INTERVAL: Duration = Duration::from_secs(5);

/// Counts points and shows them; a point counts as a second of the bar.
pub struct Counter {
    name: String,
    points: u64,
    progress: Progress,
    counted: Mutex<Counted>,
}

struct Counted {
    done: u64,
    failed: u64,
    /// Points that were done before.
    before: u64,
    shown: Instant,
}

impl Counter {
    /// Starts with the points that were done `before`.
    pub fn new(name: &str, points: u64, before: &Counts) -> Self {
        let (done, failed) = (before.done.count(), before.failed.count());
        let progress = Progress::new((points - done) as f64);
        let counted = Mutex::new(Counted { done, failed, before: done, shown: Instant::now() });
        let counter = Self { name: name.to_owned(), points, progress, counted };
        counter.show(done, failed);
        counter
    }

    /// Counts a point.
    pub fn count(&self, record: &Record) {
        let mut counted = lock(&self.counted);
        counted.done += 1;
        counted.failed += u64::from(record.outcome.is_failed());
        self.progress.within((counted.done - counted.before) as f64);
        if counted.shown.elapsed() > INTERVAL {
            counted.shown = Instant::now();
            self.show(counted.done, counted.failed);
        }
    }

    fn show(&self, done: u64, failed: u64) {
        let failures = if failed > 0 { format!(", {failed} failed") } else { String::new() };
        let state = format!("{done} of {}{failures}", count(self.points as usize, "point"));
        self.progress.phase(&self.name, &state);
    }

    /// Removes the bar; returns the points done and failed, with those from before.
    pub fn finish(self) -> (u64, u64) {
        self.progress.finish();
        let counted = self.counted.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        (counted.done, counted.failed)
    }
}
