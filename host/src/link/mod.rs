//! The link to the board: the port, the handshake, requests with retries, the stream, and the board's clock.
//!
//! ```text
//!   board ══ port ══► thread of the link ──► events: raw bytes, telemetry, damage ──► recorder
//!         ◄════════   keep-alive, retries ◄── requests                            ◄──
//! ```
//!
//! The thread blocks on nothing but the port, so a slow disk delays neither the pings that feed the motors' deadline nor
//! the reading of a byte. It pings only
//!
//! - while the program is alive: it has asked for an event or sent a request within the last five seconds;
//! - while the board is heard: a frame of telemetry has come within the last second, or without a stream, an answer.
//!
//! Otherwise the board stops its motors at their deadline.

mod claim;
mod client;
mod clock;
mod error;
mod monitor;
mod port;
mod worker;

pub use claim::Claim;
pub use client::{Asked, Link};
pub use clock::{BoardClock, ClockMap, PingClock};
pub use error::{LinkError, refusal_text};
pub use monitor::{Arrival, Gap, Monitor};
pub use port::{choose as choose_port, probe as probe_port, robots as robot_ports};
pub use worker::{Event, Exchange, Received};
