//! The progress of a sweep on stderr.

use crate::lock::lock;
use crate::progress::Progress;
use crate::sweep::{Counts, Record, Shard};
use crate::text::count;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Time between two lines, or two texts of the bar.
const INTERVAL: Duration = Duration::from_secs(5);

/// Counts points and shows them; a point counts as a second of the bar.
pub struct Counter {
    name: String,
    shard: Shard,
    points: u64,
    progress: Progress,
    counted: Mutex<Counted>,
}

struct Counted {
    done: u64,
    failed: u64,
    /// Points that were done before.
    before: u64,
    /// Points of other shards.
    helped: u64,
    shown: Instant,
}

impl Counter {
    /// Starts with the points that were done `before`.
    pub fn new(name: &str, shard: Shard, points: u64, before: &Counts) -> Self {
        let (done, failed) = (before.done.count(), before.failed.count());
        let progress = Progress::new((points - done) as f64);
        let counted = Mutex::new(Counted { done, failed, before: done, helped: 0, shown: Instant::now() });
        let counter = Self { name: name.to_owned(), shard, points, progress, counted };
        counter.show(&lock(&counter.counted));
        counter
    }

    /// Counts a point.
    pub fn count(&self, record: &Record) {
        let mut counted = lock(&self.counted);
        if self.shard.has(&record.name) {
            counted.done += 1;
            counted.failed += u64::from(record.outcome.is_err());
        } else {
            counted.helped += 1;
        }
        self.progress.within((counted.done - counted.before) as f64);
        if counted.shown.elapsed() > INTERVAL {
            counted.shown = Instant::now();
            self.show(&counted);
        }
    }

    fn show(&self, counted: &Counted) {
        let mut state = format!("{} of {}", counted.done, count(self.points as usize, "point"));
        for (number, what) in [(counted.failed, "failed"), (counted.helped, "of other shards")] {
            if number > 0 {
                state += &format!(", {number} {what}");
            }
        }
        self.progress.phase(&self.name, &state);
    }

    /// Removes the bar.
    pub fn finish(self) {
        self.progress.finish();
    }
}
