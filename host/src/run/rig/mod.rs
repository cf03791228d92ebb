//! Runs trials on the rig: the board with its motors and sensor, real or emulated.

mod avrdude;
mod error;
mod health;
mod image;
mod recorder;
mod schedule;
mod simulated;
mod trial;
mod virtual_nano;

pub use avrdude::{BOOTLOADER_BAUDS, FlashError, flash};
pub use error::{RecordError, fault_text};
pub use image::{Image, ImageError, commit_text, source_folder};

pub use simulated::SimulatedRobot;
pub use trial::{RigRun, RunContext, run};
pub use virtual_nano::{VirtualError, VirtualNano};
