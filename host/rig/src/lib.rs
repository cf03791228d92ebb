//! The robot's board, real or emulated: the serial [`link`], trials on it ([`run`]), and [`live`] viewers.
//!
//! It is a crate of its own because it is the only part of the host that touches hardware: the serial port, the clock and
//! other programs (`avrdude`, `vnano`). What it records goes through [`study::run::Recorder`], the same as for a modelled
//! trial, so that nothing above a log can tell by its form which of the two it was. The Python module does without it.

pub mod link;
pub mod live;
pub mod run;
