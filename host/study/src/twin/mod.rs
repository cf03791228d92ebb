//! Compares experiment and model: replay, comparison, calibration.
//!
//! A recorded trial is [replayed](replay()): its measured speeds drive a model with the parameters of its robot. Then
//! both are [compared](compare()) on a common clock and from a common zero, without the drift of the yaw, and within
//! the uncertainty of the measurement. If the robot's parameters are wrong, they can be
//! [calibrated](calibrate::calibrate()).

pub mod calibrate;
mod compare;
mod error;
mod headline;
mod replay;
mod replay_folder;
mod sensor_key;
mod session;
mod source;
mod speeds;

pub use compare::{
    AngleComparison, Compared, Comparison, Difference, Limit, Maker, OnMismatch, Point, Settling, Sides, Transient,
    Uncertainty, Unjudged, compare, is_replay_of,
};
pub use error::TwinError;
pub use replay::{REPLAY_HZ, Replayed, Replays, Settings, replay};
pub use session::{
    Chance, ComparedReplays, Pairs, SessionAngle, SessionComparison, Skipped, compare_pairs, compare_replays,
};
pub use source::{Source, logs};
