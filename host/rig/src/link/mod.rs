//! The link to the board: the port, the handshake, requests with retries, the stream, and the board's clock.
//!
//! ```text
//!   board ══ port ══► thread of the link ──► events: raw bytes, telemetry, damage ──► recorder
//!         ◄════════   keep-alive, retries ◄── requests                            ◄──
//! ```
//!
//! The thread blocks only on the port, so a slow disk delays neither the reception of bytes nor the pings that keep the
//! motors running. It pings only
//!
//! - while the program is alive, that is, has asked for an event or sent a request within the last five seconds;
//! - while the board sends: a frame of telemetry, or without a stream an answer, has come within the last second.
//!
//! Otherwise the board stops its motors at their deadline.
//!
//! The time of an emulated board that is faster than real time waits for this program. So that it knows that the program
//! waits for it and not the other way round, the thread sends it a delimiter every 50 ms.

mod claim;
mod client;
mod clock;
mod error;
mod lock_step;
mod monitor;
mod port;
mod worker;

pub use claim::Claim;
pub use client::{Asked, Link};
pub use clock::{BoardClock, PingClock};
pub use error::LinkError;
pub use lock_step::{Advance, SLICE_US};
pub use monitor::{Arrival, Gap, Monitor};
pub(crate) use port::is_emulated as is_emulated_port;
pub use port::{choose as choose_port, probe as probe_port, robots as robot_ports};
pub use worker::{Event, Exchange, Received};
