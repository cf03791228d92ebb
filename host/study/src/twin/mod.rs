//! Compares experiment and model: replay, comparison, calibration.
//!
//! A recorded trial is [replayed](replay()): its measured speeds drive a model with the parameters of its robot. Then
//! both are [compared](compare()) on a common clock and from a common zero, with the drift of the yaw removed and the
//! uncertainty of the measurement. If the robot's parameters are wrong, they can be
//! [calibrated](calibrate::calibrate()).

pub mod calibrate;
mod compare;
mod compatibility;
mod error;
mod replay;
mod replay_folder;
mod session;
mod shift;
mod source;
mod speeds;

pub use compare::{
    Compared, Comparison, Difference, OnMismatch, Point, SessionComparison, Sides, Skipped, compare, is_replay_of,
};
pub use error::TwinError;
pub use replay::{REPLAY_HZ, Replayed, Replays, Settings, replay};
pub use session::{Pairs, compare_pairs};
pub use source::{Source, logs};
