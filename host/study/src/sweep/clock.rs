//! The time of the computer that stores a folder. The clocks of the computers that share it may differ from this time,
//! and from each other, by any amount.

use biflag_log::atomic_file::Draft;
use std::io::{Error, Write};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// Returns the time of the computer that stores a folder, seconds after 1970, or this computer's time if the folder
/// cannot be written.
pub fn now_s(folder: &Path) -> f64 {
    let probe = || {
        let mut draft = Draft::create(&folder.join("clock"))?;
        draft.file.write_all(b"now")?;
        draft.file.sync_all()?;
        draft.file.metadata()?.modified()
    };
    seconds(probe().unwrap_or_else(|_: Error| SystemTime::now()))
}

/// Returns the seconds after 1970.
pub fn seconds(time: SystemTime) -> f64 {
    time.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}
