//! The link to the board: the port, the handshake, requests with retries, the stream, and the board's clock.
//!
//! ```text
//!   board ══ port ══► thread of the link ──► events: raw bytes, telemetry, damage ──► recorder
//!         ◄════════   keep-alive, retries ◄── requests                            ◄──
//! ```
//!
//! The thread only blocks on the port, so a slow disk delays neither the reception of bytes nor the pings that keep the
//! motors running. It only pings
//!
//! - while the program is alive: it has asked for an event or sent a request within the last five seconds;
//! - while the board sends: a telemetry frame, or without a stream an answer, has arrived within the last second.
//!
//! Otherwise the board stops its motors at their deadline.
//!
//! An emulated board that is faster than real time stops its time while this program is busy. The thread sends it a
//! delimiter every 50 ms to signal that the program is waiting for the board, and not the reverse.

mod client;
mod clock;
mod error;
mod lock_step;
mod monitor;
mod port;
mod worker;

pub use client::{Asked, Link};
pub use clock::{BoardClock, PingClock};
pub use error::LinkError;
pub use lock_step::{Advance, SLICE_US};
pub use monitor::{Arrival, Gap, Monitor};
pub use port::{arduino, choose as choose_port, claim as claim_port, probe as probe_port, robots as robot_ports};
pub use worker::{Event, Exchange, Received};
