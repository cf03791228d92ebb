//! The host side of the rig: what the `biflag` program is made of.
//!
//! A trial is a trial: a [`plan`] lists trials, the [`rig`] or the model runs them, and both write the same [`log`] into
//! the same [`session`] folder. Whatever comes after reads a session without asking where it came from.

pub mod atomic_file;
pub mod attitude;
pub mod commands;
pub mod export;
pub mod link;
pub mod live;
pub mod log;
pub mod model;
pub mod overview;
pub mod plan;
pub mod report;
pub mod rig;
pub mod session;
pub mod stats;
pub mod twin;
