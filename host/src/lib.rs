//! The host side of the rig: the library behind the `biflag` program.
//!
//! A [`plan`] lists trials. [`run`] runs them on the rig or in the simulator and writes their logs ([`biflag_log`])
//! into a [`session`] folder. All further commands read logs through [`trial`].

pub mod aim;
pub mod attitude;
mod colour;
pub mod commands;
mod draw;
pub mod export;
pub mod figure;
pub mod link;
pub mod live;
mod lock;
pub mod output;
pub mod plan;
pub mod program;
pub mod progress;
pub mod report;
pub mod run;
pub mod session;
pub mod signals;
mod split_mix;
pub mod sweep;
pub mod text;
mod ticks;
pub mod trial;
pub mod twin;
mod viridis;
