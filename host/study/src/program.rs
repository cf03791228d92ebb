//! Version of the program, and the commit that it was built from.

use biflag_log::{FORMAT, Identity, Origin};
use jiff::Timestamp;
use std::time::SystemTime;

/// Version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Commit that the program was built from, with `-dirty` if the working tree had changes.
pub const GIT_HASH: &str = env!("BIFLAG_GIT_HASH");

/// Version and commit, as `biflag --version` prints them.
pub const FULL_VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("BIFLAG_GIT_HASH"), ")");

/// Returns the identity record for logs of this program. The record of a modelled or imported trial has no date,
/// because its log does not depend on the date.
pub fn identity(origin: Origin, time: SystemTime) -> Identity {
    let created = if origin.is_recorded() { timestamp(time) } else { String::new() };
    let [host_version, host_git_hash] = [VERSION, GIT_HASH].map(str::to_owned);
    Identity { format: FORMAT, protocol: protocol::VERSION, host_version, host_git_hash, created, origin }
}

/// Returns a time as text.
pub fn timestamp(time: SystemTime) -> String {
    instant(time).to_string()
}

/// Returns a time that can be written: beyond the year 9999, the last one. `Timestamp::now` panics there.
pub fn instant(time: SystemTime) -> Timestamp {
    Timestamp::try_from(time).unwrap_or(Timestamp::MAX)
}

/// Returns whether a log was written by the same build of this program.
pub fn wrote(identity: &Identity) -> bool {
    identity.host_version == VERSION && identity.host_git_hash == GIT_HASH
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn every_time_has_a_text() {
        for (seconds, text) in [(0, "1970-01-01T00:00:00Z"), (253_402_300_000, "9999-12-30T22:00:00.999999999Z")] {
            assert_eq!(timestamp(SystemTime::UNIX_EPOCH + Duration::from_secs(seconds)), text);
        }
    }
}
