//! Makes a trial's log of what other instruments measured: a camera, another laboratory's rig, a published table.
//!
//! A [`Mapping`] says which column of a table holds which quantity. The [`states`](Table::states) of its rows, with the
//! [`Conditions`] of the trial, become a log ([`write()`]), which every command reads as it reads a recording.
//! A table of a trial that the board has recorded as well is put on that recording's clock ([`Beside`]).

mod clock;
mod error;
mod log;
mod mapping;
mod run;
mod table;

pub use clock::{Beside, Clock};
pub use error::ImportError;
pub use log::{Conditions, Imported, write};
pub use mapping::{Mapping, Quantity};
pub use table::{State, States, Table};

#[cfg(test)]
mod tests;
