//! Trials for whoever watches: the messages of a log, as they are, over Foxglove's WebSocket protocol.
//!
//! What is shown comes from a trial that is being recorded ([`Live::tap`]), from a log ([`play`]), or from a board that is
//! only listened to ([`watch`]). Viewers may be slow, dead or many: each has a queue of its own, and what does not fit
//! into it is lost to that viewer alone.

mod board;
mod error;
mod playback;
mod server;

pub use board::{WatchError, watch};
pub use error::LiveError;
pub use playback::{Played, play, wait_for_viewer};
pub use server::{ADDRESS, Live};
