//! Creates a trial's log from measurements of other instruments: a camera, another laboratory's rig, a published table.
//!
//! A [`Mapping`] assigns the columns of a table to quantities. The [`states`](Table::states) of its rows, with the
//! [`Conditions`] of the trial, become a log ([`write()`]), which every command reads like a recording. If the board
//! has also recorded the trial, the table is put on that recording's clock ([`Beside`]).

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
