//! The functions on Unix, above all on Linux.

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
