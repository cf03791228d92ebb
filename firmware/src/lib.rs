//! The firmware of the robot's Arduino Nano: 200 times a second it reads the IMU, updates the attitude, controls the speed
//! of both motors and sends telemetry to the host.
//!
//! All logic is in this library, generic over the traits of embedded-hal 1.0 and tested on the host. The binary adds the
//! registers (`board/`) and the loop that calls [`app::App`].
//!
//! | module | content |
//! | --- | --- |
//! | [`app`] | the steps of a tick, and the host's requests |
//! | [`imu`] | the MPU6050: set-up, one reading per tick, failures |
//! | [`calibration`] | the gyroscope's bias, averaged at rest |
//! | [`gap`] | the turn in a time without readings |
//! | [`attitude`] | the filter that turns rates and gravity into a quaternion |
//! | [`encoder`] | the edges of an encoder that are motion, and the speed of its flagellum |
//! | [`speed`] | control of a motor's speed and angle |
//! | [`drive`], [`bridge`] | both motors; one channel of their bridge |
//! | [`guard`] | stall, runaway, overload, failed encoder |
//! | [`positions`] | the shafts' positions over a loss of power |
//! | [`schedule`] | the speeds of a trial over its ticks |
//! | [`link`] | requests in, answers and telemetry out, the deadline |
//! | [`storage`], [`settings`], [`fault_log`] | the EEPROM: its bytes, settings and the number of starts, the last faults |
//! | [`supply`] | the board's supply voltage |
//! | [`fault`] | the fault latch, and the cause of a start |
//!
//! # Tests
//!
//! Each module tests its own arithmetic. `tests/app` and `tests/guard.rs` run the application on a bench with a sensor,
//! motors and a host; `tests/imu.rs` asserts every transaction of the sensor's bus; `sim/virtual-nano` runs the image.
//!
//! `make mutants` changes each operator, return value, match arm and condition of this library and of `protocol`, one at a
//! time, and prints each change that their tests do not notice. `.cargo/mutants.toml` lists what it leaves out, with the
//! reasons: the registers (`board/`, `main.rs`), which the emulated board tests, and the changes without an effect.

#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod app;
pub mod attitude;
pub mod bridge;
pub mod calibration;
pub mod drive;
pub mod encoder;
pub mod fault;
pub mod fault_log;
pub mod gap;
pub mod guard;
pub mod imu;
pub mod link;
pub mod positions;
pub mod schedule;
pub mod settings;
pub mod speed;
pub mod storage;
pub mod supply;

/// Returns the integer nearest to `x * 2^places`, saturated; 0 for NaN. Works in integers, and in this one place,
/// because each conversion by `as` takes four comparisons of f32, 400 cycles and 100 bytes.
#[inline(never)]
fn round_to_i16(x: f32, places: u8) -> i16 {
    let bits = x.to_bits();
    let magnitude = match ((bits >> 23) as u8).saturating_add(places) {
        // Below a half.
        0..=125 => 0,
        // Sixteen bits of the mantissa, shifted so that the last one is a half, for rounding.
        exponent @ 126..=141 => {
            let halves = (bits >> 8 | 0x8000) as u16 >> (141 - exponent);
            (halves >> 1) + (halves & 1)
        }
        142..=254 => i16::MAX as u16,
        255 if x.is_nan() => 0,
        255 => i16::MAX as u16,
    };
    let magnitude = magnitude.min(i16::MAX as u16) as i16;
    if x.is_sign_negative() { -magnitude } else { magnitude }
}

/// Length of a tick in seconds.
pub const TICK_S: f32 = 1.0 / protocol::TICK_HZ as f32;

/// Length of a tick in milliseconds.
pub const TICK_MS: u16 = 1000 / protocol::TICK_HZ as u16;

#[cfg(test)]
mod tests {
    use super::round_to_i16;

    #[test]
    fn numbers_are_rounded_to_the_nearest_integer() {
        for step in -400_000..400_000 {
            let x = step as f32 * 0.1;
            let nearest = x.round().clamp(-32767.0, 32767.0) as i16;
            assert_eq!(round_to_i16(x, 0), nearest, "{x}");
        }
        for (x, nearest) in [(0.49999997, 0), (0.5, 1), (32766.5, 32767), (1e30, 32767), (f32::NEG_INFINITY, -32767)] {
            assert_eq!(round_to_i16(x, 0), nearest, "{x}");
        }
        for (x, nearest) in
            [(f32::NAN, 0), (-0.0, 0), (f32::MIN_POSITIVE, 0), (0.5, 16384), (-0.25, -8192), (1.0, 32767)]
        {
            assert_eq!(round_to_i16(x, 15), nearest, "{x}");
        }
    }
}
