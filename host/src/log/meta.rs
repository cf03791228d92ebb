//! The metadata records of a log.

use crate::stats::LinkStats;
use serde::{Deserialize, Serialize};

/// Where a trial was run.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// On the rig.
    #[default]
    Rig,
    /// On the emulated board.
    VirtualRig,
    /// In the model.
    Model,
}

/// How a trial ended.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// All phases were gone through.
    Complete,
    /// The user ended it.
    Aborted,
    /// The board latched a fault.
    Faulted,
    /// The host could not go on: the port went, the disk was full.
    #[default]
    Failed,
}

/// What a trial came to; the last record of its log.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug, Default)]
#[serde(default)]
pub struct Summary {
    /// How it ended.
    pub end: End,
    /// Why, where it is not complete.
    pub reason: String,
    /// How well the link worked.
    #[serde(flatten)]
    pub link: LinkStats,
    /// Steady yaw, unwrapped, corrected for the gyroscope's drift.
    pub yaw_deg: Option<f64>,
    /// Its 95 % uncertainty.
    pub yaw_uncertainty_deg: Option<f64>,
    /// Steady pitch.
    pub pitch_deg: Option<f64>,
    /// Steady roll.
    pub roll_deg: Option<f64>,
}

/// The board's clock against the host's: a line through the pings.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug, Default)]
#[serde(default)]
pub struct ClockFit {
    /// Pings that were used.
    pub pings: u32,
    /// Host time when the board's clock was zero, ns since 1970.
    pub offset_ns: i64,
    /// How much faster the board's clock runs, parts per million.
    pub drift_ppm: f64,
    /// Standard deviation of the pings about the line, µs.
    pub residual_us: f64,
}
