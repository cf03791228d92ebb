//! Time that the processor has spent.

use windows_sys::Win32::Foundation::FILETIME;
use windows_sys::Win32::System::Threading::{GetCurrentThread, GetThreadTimes};

/// Returns the processor time of this thread, s.
pub fn thread_s() -> f64 {
    let [mut created, mut ended, mut kernel, mut user] = [FILETIME::default(); 4];
    // SAFETY: the pointers are valid. The handle of this thread is too, so the call cannot fail.
    unsafe { GetThreadTimes(GetCurrentThread(), &mut created, &mut ended, &mut kernel, &mut user) };
    let seconds =
        |time: FILETIME| 1e-7 * (f64::from(time.dwHighDateTime) * 2_f64.powi(32) + f64::from(time.dwLowDateTime));
    seconds(kernel) + seconds(user)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, Instant};

    #[test]
    fn work_takes_time_and_sleep_takes_none() {
        let begun = thread_s();
        std::thread::sleep(Duration::from_millis(200));
        let rested = thread_s();
        let start = Instant::now();
        while start.elapsed() < Duration::from_millis(400) {}
        assert!(rested - begun < 0.1 && thread_s() - rested > 0.1);
    }
}
