//! Everything for people to look at: pages ([`report`]), figures for print ([`figure`]) and films ([`film`]).
//!
//! It is a crate of its own because words and colours change more often than numbers: a change here does not recompile fits and
//! sweeps. The dependency is one way: this crate takes trials, comparisons and tables from the crate `study` and computes no
//! result of its own, so that a page cannot show another number than a command.

mod error;
pub mod figure;
pub mod film;
mod points;
pub mod report;
mod swept;
mod ticks;
mod viridis;

pub use error::PageError;
