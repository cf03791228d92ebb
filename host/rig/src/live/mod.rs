//! Serves trials to viewers: the messages of a log, unchanged, over Foxglove's WebSocket protocol.
//!
//! [`Browser`] serves biflag's own page to a browser on this computer, without another program.
//!
//! The messages come from a running recording ([`Live::tap`]), from a log ([`play`]), or from a board without recording
//! ([`watch`]). Each viewer has its own queue, so a slow or dead viewer loses messages but does not affect the trial or
//! other viewers. Web pages other than Foxglove's and this computer's are refused.

mod board;
mod browser;
mod error;
mod feed;
mod origin;
mod playback;
mod server;

pub use board::watch;
pub use browser::Browser;
pub use error::LiveError;
pub use feed::Feed;
pub use playback::{Played, play, wait_for_viewer};
pub use server::Live;

/// The default address of viewers, reachable from this computer only.
pub const ADDRESS: &str = "127.0.0.1:8765";
