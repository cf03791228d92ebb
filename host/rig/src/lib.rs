//! The robot's board, real or emulated: the serial [`link`], trials on it ([`run`]), and [`live`] viewers.
//!
//! It is a separate crate because it is the only part of the host that touches hardware: the serial port, the clock and
//! other programs (`avrdude`, `vnano`). It records through [`study::run::Recorder`], like a modelled trial, so both
//! write logs of the same form. The Python module does not need it.

pub mod link;
pub mod live;
pub mod run;
