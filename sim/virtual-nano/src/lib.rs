//! The robot's Arduino Nano, emulated: the ATmega328P on simavr running the real firmware, with a virtual MPU6050, motor
//! bridge, motors and encoders wired to it as on the robot.
//!
//! [`Board`] runs in-process with exact cycles, for tests. The program `vnano` gives it a pseudo-terminal in place of the
//! serial port, and takes commands on its standard input (see [`control`]).
//!
//! Modelled to the cycle: the chip with its UART, I2C master, watchdog and EEPROM, and encoder edges. Modelled physically:
//! the motors (first order), the sensor's errors and noise ([`imu::errors`]), the hand that turns it ([`imu::hand`]),
//! and the simulated robot ([`plant`]).

#![warn(unsafe_code)]

pub mod board;
pub mod bootloader;
pub mod bridge;
pub mod clock;
pub mod control;
pub mod coupling;
pub mod drift;
pub mod encoder;
pub mod fault;
pub mod image;
pub mod imu;
mod inject;
pub mod marks;
#[allow(unsafe_code)]
pub mod mcu;
pub mod motor;
pub mod pace;
pub mod plant;
pub mod port;
pub mod push;
pub mod resonator;
pub mod rig;
pub mod run;
pub mod serial;
pub mod setup;
pub mod usb;

pub use board::{Board, BoardOptions};
pub use image::Image;
