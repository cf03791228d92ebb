//! Keeps web pages from reading an experiment. Browsers let any page connect to a WebSocket on this computer, and only
//! name the page in the `Origin` header of the handshake.
//!
//! The server of Foxglove's library cannot refuse a handshake. Viewers therefore connect to this door, which reads the
//! handshake and copies the bytes of admitted viewers. The server behind it listens on a random address of this
//! computer ([`hidden_address`](system::network::hidden_address)), which pages cannot guess.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};
use system::network::wait_for_connection;

/// Longest head of a handshake, bytes. Browsers include all cookies of this computer's other servers.
const HEAD: usize = 64 * 1024;

/// Time limit of a handshake.
const HANDSHAKE: Duration = Duration::from_secs(5);

/// A viewer that takes no byte for this time is disconnected.
const DEAD_AFTER: Duration = Duration::from_secs(90);

/// Interval of the checks whether the door was closed.
const CHECK_EVERY: Duration = Duration::from_millis(20);

const REFUSAL: &str = "HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain\r\nContent-Length: 42\r\nConnection: close\r\n\r\n\
                       this web page may not read the experiment\n";

/// The door. Dropping it releases the port; viewers inside stay until the server ends.
pub struct Door {
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Door {
    /// Admits viewers from `listener` to `server`.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn open(listener: TcpListener, server: SocketAddr) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        let ended = Arc::new(AtomicBool::new(false));
        let until = ended.clone();
        let thread = Builder::new().name("viewers".into()).spawn(move || {
            while !until.load(Ordering::Relaxed) {
                // Errors here, or of a connection that has already closed, do not affect later viewers.
                wait_for_connection(&listener, CHECK_EVERY);
                match listener.accept() {
                    Ok((viewer, _)) => {
                        // A viewer without a thread is disconnected.
                        let _ = Builder::new().name("viewer".into()).spawn(move || admit(viewer, server));
                    }
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                    // For example, too many open files: the connection stays in the queue, and the wait ends at once.
                    Err(_) => std::thread::sleep(CHECK_EVERY),
                }
            }
        })?;
        Ok(Self { ended, thread: Some(thread) })
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Serves a viewer until one side ends.
fn admit(viewer: TcpStream, server: SocketAddr) {
    let Ok(head) = handshake(&viewer) else { return };
    if !origins(&head).all(|origin| is_allowed(&origin)) {
        let _ = (&viewer).write_all(REFUSAL.as_bytes());
        return;
    }
    let copied = || -> io::Result<()> {
        let server = TcpStream::connect(server)?;
        for side in [&viewer, &server] {
            side.set_nodelay(true)?;
        }
        viewer.set_read_timeout(None)?;
        viewer.set_write_timeout(Some(DEAD_AFTER))?;
        (&server).write_all(&head)?;
        let copy = |mut from: &TcpStream, mut to: &TcpStream| {
            let _ = io::copy(&mut from, &mut to);
            // Ends the copy in the other direction. Bytes already written are still sent.
            let _ = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
        };
        std::thread::scope(|scope| {
            Builder::new().name("viewer".into()).spawn_scoped(scope, || copy(&server, &viewer))?;
            copy(&viewer, &server);
            Ok(())
        })
    };
    // An error only disconnects this viewer.
    let _ = copied();
}

/// Reads the head of the handshake, and any bytes that the viewer has sent after it.
fn handshake(mut viewer: &TcpStream) -> io::Result<Vec<u8>> {
    viewer.set_nonblocking(false)?;
    let until = Instant::now() + HANDSHAKE;
    let (mut head, mut buffer) = (Vec::new(), [0; 4096]);
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() || head.len() > HEAD {
            return Err(ErrorKind::InvalidData.into());
        }
        viewer.set_read_timeout(Some(left))?;
        match viewer.read(&mut buffer)? {
            0 => return Err(ErrorKind::UnexpectedEof.into()),
            read => head.extend_from_slice(&buffer[..read]),
        }
    }
    Ok(head)
}

/// Returns the values of all `Origin` headers.
fn origins(head: &[u8]) -> impl Iterator<Item = String> {
    let lines = head.split(|byte| *byte == b'\n').map(String::from_utf8_lossy);
    let headers =
        lines.map(|line| line.split_once(':').map(|(name, value)| (name.trim().to_owned(), value.trim().to_owned())));
    headers.flatten().filter(|(name, _)| name.eq_ignore_ascii_case("origin")).map(|(_, value)| value)
}

/// Returns whether a viewer of this origin may read the experiment: Foxglove's pages, pages of this computer, and
/// installed programs. Foxglove's desktop program, built on Electron, sends `file://`.
fn is_allowed(origin: &str) -> bool {
    let origin = origin.to_ascii_lowercase();
    // `null` has no scheme: any page can send it from a sandboxed frame.
    let Some((scheme, authority)) = origin.split_once("://") else { return false };
    let host = match authority.rsplit_once(':') {
        Some((host, port)) if !port.is_empty() && port.bytes().all(|digit| digit.is_ascii_digit()) => host,
        _ => authority,
    };
    match scheme {
        "http" | "https" if ["localhost", "127.0.0.1", "[::1]"].contains(&host) => true,
        "https" => authority == "foxglove.dev" || authority.ends_with(".foxglove.dev"),
        "http" => false,
        // The other schemes of browsers.
        _ if scheme.ends_with("-extension") => false,
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_foxglove_this_computer_and_programs_are_allowed() {
        for origin in [
            "https://app.foxglove.dev",
            "https://embed.foxglove.dev",
            "HTTPS://App.Foxglove.dev",
            "http://localhost:8080",
            "https://localhost",
            "http://127.0.0.1:3000",
            "http://[::1]:8080",
            "file://",
            "app://foxglove",
        ] {
            assert!(is_allowed(origin), "{origin}");
        }
        for origin in [
            "https://evil.example",
            "http://app.foxglove.dev",
            "https://app.foxglove.dev.evil.example",
            "https://evilfoxglove.dev",
            "https://app.foxglove.dev:8443",
            "https://foxglove.dev@evil.example",
            "https://localhost.evil.example",
            "http://127.0.0.1.evil.example:8765",
            "http://192.168.0.7",
            "http://[::1].evil.example",
            "chrome-extension://abc",
            "null",
            "",
        ] {
            assert!(!is_allowed(origin), "{origin}");
        }
    }

    #[test]
    fn every_origin_of_a_head_is_found() {
        let head =
            b"GET / HTTP/1.1\r\nHost: localhost\r\nORIGIN:https://a.example:1\r\nX-Origin: b\r\norigin : null \r\n\r\n";
        assert_eq!(origins(head).collect::<Vec<_>>(), ["https://a.example:1", "null"]);
        assert_eq!(origins(b"GET /?Origin: HTTP/1.1\r\nHost: a\r\n\r\n").count(), 0);
    }

    #[test]
    fn length_of_the_refusal_is_that_of_its_body() {
        let (head, body) = REFUSAL.split_once("\r\n\r\n").unwrap();
        assert!(head.contains(&format!("Content-Length: {}\r\n", body.len())), "{}", body.len());
    }
}
