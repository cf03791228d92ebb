//! This computer in a network.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::net::TcpListener;
use std::time::Duration;

/// Returns the name of the computer.
pub fn name() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

/// Waits until a connection can be accepted, or until this time has passed. A failure ends the wait.
pub fn wait_for_connection(listener: &TcpListener, longest: Duration) {
    let longest = Timespec { tv_sec: longest.as_secs() as i64, tv_nsec: longest.subsec_nanos().into() };
    let _ = poll(&mut [PollFd::new(listener, PollFlags::IN)], Some(&longest));
}
