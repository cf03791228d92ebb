//! The twin: an experiment held against the model.
//!
//! A recorded trial is [replayed](replay()): its measured speeds drive the model, from its own robot's parameters. Then
//! both are [compared](compare_logs): on one clock, from one zero, with the drift of the yaw taken off and what is left of
//! it stated. What the model gets wrong may be the robot's parameters, which are [calibrated](calibrate::calibrate()).

mod alike;
pub mod calibrate;
mod compare;
mod curve;
mod error;
mod hash;
mod recording;
mod replay;
mod session;
mod shift;
mod speeds;

pub use compare::{Allow, Comparison, Finding, Point, SessionComparison, Skipped, compare_logs};
pub use error::TwinError;
pub use recording::Recording;
pub use replay::{Replayed, Replays, Settings, Source, replay};
pub use session::{compare_replays, compare_sessions};
