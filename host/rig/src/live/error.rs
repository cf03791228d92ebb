//! Errors of the server for viewers.

use miette::Diagnostic;
use std::net::SocketAddr;
use thiserror::Error;

/// Why viewers cannot be served.
#[derive(Debug, Error, Diagnostic)]
#[expect(missing_docs, reason = "the messages say what the fields are")]
pub enum LiveError {
    /// Another program is listening at the address.
    #[error("viewers cannot be served at {address}: another program is listening there")]
    #[diagnostic(help(
        "end it, or name another address: --listen for `biflag live`, --live for `biflag record`, such as \
         --live=127.0.0.1:8766"
    ))]
    Busy { address: SocketAddr },
    /// The system does not allow listening at the address.
    #[error("viewers cannot be served at {address}: {reason}")]
    #[diagnostic(
        code(wrong_use),
        help("name an address of this computer with a port above 1023, such as 127.0.0.1:8765")
    )]
    Address { address: SocketAddr, reason: String },
}
