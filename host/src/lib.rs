//! The host side of the rig: what the `biflag` program is made of.
//!
//! A trial is a trial: a [`plan`] lists trials, the [`rig`] or the model runs them, and both write the same [`log`] into
//! the same [`session`] folder. Whatever comes after reads a session without asking where it came from.

pub mod attitude;
pub mod board_settings;
pub mod commands;
mod exactly;
pub mod export;
pub mod link;
pub mod live;
pub mod log;
pub mod model;
pub mod overview;
pub mod plan;
pub mod report;
pub mod rig;
pub mod robot_file;
pub mod session;
pub mod stats;
pub mod twin;
pub mod whole_file;
