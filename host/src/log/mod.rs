//! The log of a trial: an MCAP file with protobuf messages that anyone can read in ten years.
//!
//! | channel | message | holds |
//! | --- | --- | --- |
//! | `/raw` | `biflag.RawBytes` | the bytes as they came, so that a decoder's bug never loses a trial |
//! | `/telemetry` | `biflag.Telemetry` | the state of the robot at each tick, in counts and in physical units |
//! | `/attitude` | `foxglove.FrameTransform` | the attitude again, in the form that viewers know |
//! | `/command` | `biflag.Command` | what was sent, how often, and what was answered |
//! | `/dropout` | `biflag.Dropout` | telemetry frames that were lost |
//! | `/event` | `biflag.Event` | phases, states, faults, warnings |
//! | `/truth` | `biflag.Truth` | in a model: what a board only measures, unrounded |
//! | `/forces` | `biflag.Forces` | in a model: forces and torques of the flagella, gaps, contact |
//! | `/flagella` | `foxglove.SceneUpdate` | in a model, where asked for: the flagella as lines |
//! | `/flagella_points` | `foxglove.PointCloud` | the same as points, for viewers that draw no lines |
//!
//! A message's `publish_time` is the host's clock when it came. Its `log_time` is the trial's clock: the board's time,
//! counted from the host's clock at the first telemetry frame. What has no time of the board's takes that of the frame
//! before it, so that a trial recorded faster than real time still reads as one that lasted its full length.
//!
//! A modelled trial has no clock but its own: it begins at the epoch, and both times are the trial's. So its log is a
//! function of plan, robot and program alone, byte for byte, whoever computed it, when, and beside how many others.

mod chunk;
mod convert;
mod disk;
mod error;
mod meta;
mod model_meta;
mod reader;
mod recover;
mod scan;
pub mod schema;
mod table;
#[cfg(test)]
mod tests;
mod writer;

pub use convert::{CommandRecord, EventKind};
pub(crate) use convert::{Converter, event, frame_transform, timestamp};
pub use error::LogError;
pub use meta::{
    BoardMeta, CalibrationMeta, ClockFit, End, FORMAT, Identity, LevelMeta, Origin, PlanMeta, RecoveryMeta, ReplayMeta,
    RobotMeta, Summary, TrialMeta,
};
pub use model_meta::{ModelMeta, SensorMeta, SteadyMeta};
pub(crate) use reader::TrialClock;
pub use reader::{Body, Message, Reader, check, last_meta, summary};
pub use recover::{Recovery, recover};
pub use scan::{Condition, Loss};
pub use table::{Meta, Table};
pub use writer::{Start, Tap, Writer};

/// The MCAP profile of our logs.
pub const PROFILE: &str = "biflag";

/// A trial that claims to be longer is damaged, s: a week.
pub(crate) const LONGEST_TRIAL_S: f64 = 7.0 * 86_400.0;
