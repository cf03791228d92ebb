//! Stand-in for the server in a program built without it: it never starts.

use super::{Feed, LiveError};
use biflag_log::Tap;
use biflag_log::schema::{ChannelSpec, LogMessage};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A server that does not exist.
#[derive(Clone, Debug)]
pub enum Live {}

impl Live {
    /// # Errors
    /// [`LiveError::NotBuilt`].
    pub fn listen(_address: SocketAddr) -> Result<Self, LiveError> {
        Err(LiveError::NotBuilt)
    }

    /// Returns the address for viewers.
    pub fn url(&self) -> String {
        match *self {}
    }

    /// Returns instructions for the user.
    pub fn invitation(&self) -> String {
        match *self {}
    }

    /// Returns whether a viewer has subscribed to a channel.
    pub fn is_watched(&self) -> bool {
        match *self {}
    }

    /// Sends a message to all subscribers of its channel.
    pub fn show(&self, _channel: &ChannelSpec, _log_time_ns: u64, _bytes: &[u8]) {
        match *self {}
    }

    /// Encodes and sends a message.
    pub fn message<M: LogMessage>(&self, _log_time_ns: u64, _message: &M) {
        match *self {}
    }

    /// Returns a tap that sends every message of a log.
    pub fn tap(&self) -> Tap {
        match *self {}
    }
}

/// A server for browsers that does not exist.
#[derive(Debug)]
pub enum Browser {}

impl Browser {
    /// # Errors
    /// [`LiveError::NotBuilt`].
    pub fn serve(_page: String, _feed: Feed, _stop: Arc<AtomicBool>) -> Result<Self, LiveError> {
        Err(LiveError::NotBuilt)
    }

    /// Returns the address of the page.
    pub fn url(&self) -> String {
        match *self {}
    }

    /// Ends the recording for the page.
    pub fn end(&self, _words: &str) {
        match *self {}
    }
}
