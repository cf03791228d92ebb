//! The functions on Windows.

pub mod avrdude;
pub mod claim;
pub mod clock;
pub mod disk;
pub mod file;
pub mod folders;
pub mod group;
pub mod lock;
pub mod network;
pub mod port;
pub mod presses;
pub mod shell;
pub mod terminal;

/// Returns text in the system's form: UTF-16, with a zero at the end.
fn wide(text: &str) -> Vec<u16> {
    text.encode_utf16().chain([0]).collect()
}

/// Returns the name of a device without its prefix, if it has one: `\\.\COM5`.
fn device_name(path: &str) -> &str {
    path.strip_prefix(r"\\.\").unwrap_or(path)
}
