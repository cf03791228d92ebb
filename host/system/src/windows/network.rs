//! This computer in a network.

use std::net::TcpListener;
use std::os::windows::io::AsRawSocket;
use std::time::Duration;
use windows_sys::Win32::Networking::WinSock::{POLLRDNORM, WSAPOLLFD, WSAPoll};

/// Returns the name of the computer.
pub fn name() -> String {
    std::env::var("COMPUTERNAME").unwrap_or_default()
}

/// Waits until a connection can be accepted, or until this time has passed. A failure ends the wait.
pub fn wait_for_connection(listener: &TcpListener, longest: Duration) {
    let mut socket = WSAPOLLFD { fd: listener.as_raw_socket() as usize, events: POLLRDNORM, revents: 0 };
    let longest = longest.as_millis().try_into().unwrap_or(i32::MAX);
    // SAFETY: the pointer is to one socket, which is open.
    unsafe { WSAPoll(&mut socket, 1, longest) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpStream;
    use std::time::Instant;

    #[test]
    fn a_connection_ends_the_wait() {
        let listener = TcpListener::bind((crate::network::hidden_address(), 0)).unwrap();
        let begun = Instant::now();
        wait_for_connection(&listener, Duration::from_millis(50));
        assert!(begun.elapsed() >= Duration::from_millis(40));
        let _connection = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        wait_for_connection(&listener, Duration::from_secs(60));
        assert!(begun.elapsed() < Duration::from_secs(30) && !name().is_empty());
    }
}
