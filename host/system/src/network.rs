//! This computer in a network.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::hash::{BuildHasher, RandomState};
use std::net::{Ipv4Addr, TcpListener};
use std::time::Duration;

/// Returns the name of the computer.
pub fn name() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

/// Returns a random address of this computer. On Linux, all 16 million addresses of 127.0.0.0/8 belong to it: with the port,
/// which the system selects, a web page would have to try 10¹¹ combinations.
pub fn hidden_address() -> Ipv4Addr {
    if cfg!(not(target_os = "linux")) {
        return Ipv4Addr::LOCALHOST;
    }
    // Seeded by the system's random numbers.
    let [a, b, c, ..] = RandomState::new().hash_one("address").to_le_bytes().map(|byte| 1 + byte % 254);
    Ipv4Addr::new(127, a, b, c)
}

/// Waits until a connection can be accepted, or until this time has passed. A failure ends the wait.
pub fn wait_for_connection(listener: &TcpListener, longest: Duration) {
    let longest = Timespec { tv_sec: longest.as_secs() as i64, tv_nsec: longest.subsec_nanos().into() };
    let _ = poll(&mut [PollFd::new(listener, PollFlags::IN)], Some(&longest));
}
