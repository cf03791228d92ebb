//! The host side of the rig: the library behind the `biflag` program.
//!
//! The [`commands`] are here. Their work is in three crates: `study` (plans, trials, model runs, comparison), `page` (reports
//! and figures) and `rig` (the board). This crate re-exports their modules, so that its users need no other. The front page
//! of each crate gives the reason for it.

pub mod commands;
mod image;
pub mod pack;

pub use page::{figure, film, report};
pub use rig::{link, live};
pub use study::{
    aim, attitude, colour, export, import, lock, output, plan, preview, program, progress, sensor, session, statistics,
    sweep, text, trial, twin,
};
pub use system::{claim, signals};

/// Runs trials on the rig or in the model, which write the same kind of log.
pub mod run {
    pub use rig::run as rig;
    pub use study::run::*;
}
