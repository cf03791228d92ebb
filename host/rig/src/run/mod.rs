//! Runs trials on the rig: the board with its motors and sensor, real or emulated.

mod avrdude;
pub mod board_copy;
mod error;
pub mod fault_log;
mod follow;
mod health;
mod image;
pub mod lines;
pub mod note;
pub mod park;
pub mod preflight;
mod readout;
mod recorder;
mod refusal;
mod schedule;
pub mod self_test;
mod simulated;
mod standing;
mod steer;
mod still;
mod stream;
mod trial;
mod virtual_nano;

pub use avrdude::{FlashError, flash};
pub use error::{RecordError, fault_cure, fault_text};
pub use follow::{Followed, follow};
pub use health::GLITCHES_ALLOWED;
pub use image::{Image, ImageError, commit_of_image, commit_text, repository};
pub use recorder::Notes;
pub use simulated::SimulatedRobot;
pub use steer::{SteeredRun, steer};
pub use trial::{RigRun, RunContext, run};
pub use virtual_nano::{HandMovement, VirtualError, VirtualNano};
