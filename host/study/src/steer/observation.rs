//! The observation that a controller receives.

use serde::Serialize;

/// The attitude to reach and hold.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct Wanted {
    /// Mean yaw since the start of the run.
    #[serde(rename = "wanted_yaw_deg")]
    pub yaw_deg: f64,
    /// Mean pitch.
    #[serde(rename = "wanted_pitch_deg")]
    pub pitch_deg: f64,
}

/// The robot's measured state at one time: exact in the model, from the board on a rig.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Measured {
    /// Yaw since the start of the run, unwrapped.
    pub yaw_deg: f64,
    /// Pitch.
    pub pitch_deg: f64,
    /// Roll.
    pub roll_deg: f64,
    /// Angular velocity, body axes.
    pub rates_dps: [f64; 3],
    /// Speeds of flagella 1 and 2.
    pub speeds_rpm: [f64; 2],
    /// Turns of flagella 1 and 2 by their encoders.
    pub turns: [f64; 2],
}

/// A pilot's input: the line that a policy reads.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct Observation {
    /// Time since the start of the run by the board's clock.
    pub time_s: f64,
    /// The target attitude.
    #[serde(flatten)]
    pub wanted: Wanted,
    /// The measured state.
    #[serde(flatten)]
    pub measured: Measured,
    /// Mean yaw over the last turns of the flagella.
    pub mean_yaw_deg: f64,
    /// Mean pitch over the same time.
    pub mean_pitch_deg: f64,
}
