//! The log of a trial: an MCAP file with protobuf messages, which standard tools can read.
//!
//! ```
//! use biflag_log::schema::biflag::Truth;
//! use biflag_log::{Body, Reader, Start, Summary, Writer};
//! use std::time::SystemTime;
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("turn.mcap");
//! let mut log = Writer::create(&path, &Start::default(), SystemTime::now())?;
//! for tick in 0..100 {
//!     let time_s = 0.005 * f64::from(tick);
//!     log.message_at(time_s, &Truth { time_s, yaw_deg: 6.0 * time_s, ..Truth::default() }, SystemTime::now())?;
//! }
//! log.finish(&Summary::default())?;
//!
//! let mut reader = Reader::open(&path)?;
//! let mut yaw_deg = Vec::new();
//! for message in reader.by_ref() {
//!     if let Body::Truth(truth) = message?.body {
//!         yaw_deg.push(truth.yaw_deg);
//!     }
//! }
//! assert_eq!((yaw_deg.len(), yaw_deg[50]), (100, 1.5));
//! assert!(reader.losses().is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | channel | message | holds |
//! | --- | --- | --- |
//! | `/raw` | `biflag.RawBytes` | the bytes as received, so that a bug in the decoder never loses a trial |
//! | `/telemetry` | `biflag.Telemetry` | the measured state of the robot at each tick, in counts and physical units |
//! | `/attitude` | `foxglove.FrameTransform` | the attitude for viewers, levelled by the rest before the run |
//! | `/command` | `biflag.Command` | each request, its number of attempts, and its reply |
//! | `/dropout` | `biflag.Dropout` | telemetry frames that were lost |
//! | `/event` | `biflag.Event` | phases, states, faults, warnings |
//! | `/truth` | `biflag.Truth` | models: attitude, rates and shafts, unrounded; imported trials: as other instruments measured them |
//! | `/forces` | `biflag.Forces` | models only: forces and torques of the flagella, gaps, contact |
//! | `/nodes` | `biflag.Nodes` | models only, if requested: the centre lines of the flagella |
//! | `/steering` | `biflag.Steering` | steered trials only: each set-point, and the observation that it was made from |
//! | `/flagella` | `foxglove.SceneUpdate` | base and flagella for viewers; without a model, undeformed flagella at the measured angles |
//! | `/flagella_points` | `foxglove.PointCloud` | the centre lines as points, for viewers that cannot draw lines |
//!
//! The log holds measured or computed values; estimates (zero, drift, uncertainty) are computed when it is read. Logs
//! of format 1 can still be read: see [`FORMAT`].
//!
//! The `publish_time` of a message is the host's clock when it was received. Its `log_time` is the trial's clock: the
//! board's time, counted from the host's clock at the first telemetry frame. A message without the board's time takes
//! the time of the previous frame, so a trial recorded faster than real time still has its full length.
//!
//! A modelled trial begins at the epoch, and both times are the trial's. So its log depends only on plan, robot and
//! program, byte for byte: not on the date, the computer, or the number of trials that run in parallel.

// Functions whose last bits depend on the machine; tests may call them.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod atomic_file;
mod chunk;
mod condition;
mod convert;
mod disk;
mod error;
mod meta;
mod model_meta;
mod reader;
mod record;
mod recover;
pub mod sample;
mod scan;
pub mod schema;
pub mod similar;
mod source;
mod stats;
mod table;
#[cfg(test)]
mod tests;
mod time;
mod writer;

pub use condition::{Condition, Loss};
pub use convert::{CommandRecord, Converter, event};
pub use error::LogError;
pub use meta::{
    BoardMeta, CalibrationMeta, ClockMeta, End, FORMAT, FaultMeta, Identity, ImportMeta, LevelMeta, MeasuredSensorMeta,
    Origin, PlanMeta, RecoveryMeta, ReplayMeta, RestMeta, RobotMeta, SteerMeta, Summary, TrialMeta,
};
pub use model_meta::{ModelMeta, SensorMeta, SteadyMeta};
pub use reader::{Message, Reader, TrialClock, check, last_meta, summary};
pub use record::PROFILE;
pub use recover::{Recovery, recover};
pub use schema::Body;
/// The kind of an event: a phase begins (the text is its name), the board's state changed, a fault was latched or
/// cleared, a request was sent again, the gyroscope was calibrated, the clocks were compared, a warning for the user,
/// or a note on anything else.
pub use schema::biflag::event::Kind as EventKind;
pub use sim::steady::Method;
pub use stats::LinkStats;
pub use table::{Meta, Table};
pub use time::LONGEST_TRIAL_S;
pub use writer::{Start, Tap, Writer};
