//! Trials of a computed rig: the motion of the model, a sensor drawn from its data sheet, its errors as measured on a bench, and
//! the filter of the firmware. No error of the sensor comes from the code that reads the logs or emulates the board.

mod bench;
mod motion;
mod part;
mod random;
mod recording;

pub use bench::known_but_for;
pub use motion::Motion;
pub use part::{Lot, Part};
pub use random::Random;
pub use recording::{Recording, Rig, Start};

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Interval of the board's frames by its own clock, s.
const TICK_S: f64 = 0.005;

/// Calls a function with the numbers from 0 to `count`, on both cores, and returns its results in their order.
pub fn each<T: Send>(count: usize, of: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let (next, all) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let work = || loop {
        let i = next.fetch_add(1, Ordering::Relaxed);
        if i >= count {
            return;
        }
        let made = of(i);
        all.lock().expect("no panic").push((i, made));
    };
    std::thread::scope(|scope| (0..2).for_each(|_| drop(scope.spawn(work))));
    let mut all = all.into_inner().expect("no panic");
    all.sort_by_key(|(i, _)| *i);
    all.into_iter().map(|(_, made)| made).collect()
}
