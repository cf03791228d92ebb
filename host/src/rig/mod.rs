//! The rig: the board with its motors and sensor, real or emulated, and the trials that run on it.

mod avrdude;
mod image;
mod progress;
mod recorder;
mod simulated;
mod trial;
mod virtual_nano;

pub use avrdude::{BOOTLOADER_BAUDS, FlashError, flash};
pub use image::{Image, ImageError, commit_text, source_folder};
pub use progress::Progress;
pub use recorder::{RecordError, fault_text};
pub use simulated::SimulatedRobot;
pub use trial::{Bench, TrialRun, run};
pub use virtual_nano::{VirtualError, VirtualNano};
