//! The emulated board, alone and with the real program in it. One program, because each has to be linked.

mod chip;
mod common;
mod eeprom;
mod hostile;
mod image;
mod imu;
mod link;
mod motors;
mod phase;
mod program;
mod rigs;
mod scales;
mod sensor;
