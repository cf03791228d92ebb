//! The program of the robot's Arduino Nano: 200 times a second it reads the IMU, follows the attitude, holds the speed
//! of both motors and reports to the host.
//!
//! Everything that decides is in this library, generic over the traits of embedded-hal 1.0 and tested on the host. The
//! binary adds the registers (`board/`) and the loop that calls [`app::App`].
//!
//! | module | what it is |
//! | --- | --- |
//! | [`app`] | what one tick does, from top to bottom |
//! | [`imu`] | the MPU6050: set-up, one reading a tick, every way in which it fails |
//! | [`calibration`] | the gyroscope's bias, averaged at rest |
//! | [`attitude`] | the filter that turns rates and gravity into a quaternion |
//! | [`encoder`] | the speed of a flagellum from the times of its encoder's edges |
//! | [`motor`] | the bridges, the speed control, stalls |
//! | [`link`] | requests in, answers and telemetry out, the deadline |
//! | [`settings`] | what EEPROM keeps: settings and the count of starts |
//! | [`fault`] | the latch, and the record that survives a restart |

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod app;
pub mod attitude;
pub mod calibration;
pub mod encoder;
pub mod fault;
pub mod imu;
pub mod link;
pub mod motor;
pub mod settings;

/// Length of a tick in seconds.
pub const TICK_S: f32 = 1.0 / protocol::TICK_HZ as f32;

/// Length of a tick in milliseconds.
pub const TICK_MS: u16 = 1000 / protocol::TICK_HZ as u16;
