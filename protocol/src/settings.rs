//! The board's settings for its robot.

use crate::units::{AccelRange, AxisMap, GyroRange, Millivolts};
use serde::{Deserialize, Serialize};
use serde_repr::{Deserialize_repr, Serialize_repr};
#[cfg(target_arch = "avr")]
use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes};

/// Settings of one robot, kept in EEPROM with a CRC.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[cfg_attr(target_arch = "avr", repr(C), serde(remote = "Self"))]
pub struct Settings {
    /// A number that identifies the board; 0 if none was set.
    #[serde(with = "crate::fixed::u16")]
    pub board_id: u16,
    /// Range of the gyroscope.
    pub gyro_range: GyroRange,
    /// Range of the accelerometer.
    pub accel_range: AccelRange,
    /// The MPU6050's digital low-pass filter: register CONFIG, 0 (260 Hz) to 6 (5 Hz).
    pub low_pass: u8,
    /// Orientation of the gyroscope in the robot.
    pub gyro_axes: AxisMap,
    /// Orientation of the accelerometer in the robot; it reads +1 g on the axis that points up.
    pub accel_axes: AxisMap,
    /// Mean reading of the gyroscope at rest, counts, sensor axes.
    pub gyro_bias: [f32; 3],
    /// Gain of the attitude filter on the direction of gravity, 1/s.
    #[serde(with = "crate::fixed::f32")]
    pub attitude_kp: f32,
    /// Gain of the attitude filter's own estimate of the gyroscope's bias, 1/s².
    #[serde(with = "crate::fixed::f32")]
    pub attitude_ki: f32,
    /// Proportional gain of the speed control, duty steps per rpm.
    #[serde(with = "crate::fixed::f32")]
    pub speed_kp: f32,
    /// Integral gain of the speed control, duty steps per rpm and second.
    #[serde(with = "crate::fixed::f32")]
    pub speed_ki: f32,
    /// Encoder counts per revolution of a flagellum.
    #[serde(with = "crate::fixed::f32")]
    pub counts_per_turn: f32,
    /// Whether a positive duty turns motors 1 and 2 backwards.
    pub motor_reversed: [bool; 2],
    /// Whether the encoders of motors 1 and 2 count backwards.
    pub encoder_reversed: [bool; 2],
    /// Longest silence of the host while the motors turn, 50 to 5000 ms.
    #[serde(with = "crate::fixed::u16")]
    pub deadline_ms: u16,
    /// Duties above which motors 1 and 2 turn if nothing holds them. A motor that does not turn for a second at such a duty
    /// is stalled.
    pub moving_duty: [u8; 2],
    /// The chip's bandgap voltage, 1000 to 1200 mV (its electrical characteristics), against which the supply is measured.
    pub bandgap: Millivolts,
    /// Inputs of the bridge.
    pub bridge: Bridge,
    /// How the speeds are controlled.
    pub speed_from: SpeedFrom,
}

/// Inputs of a channel of the bridge.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[repr(u8)]
pub enum Bridge {
    /// Enable by PWM and two inputs for the direction: TB6612, L298N, L293D.
    #[default]
    Enable,
    /// Two inputs: PWM on the first, direction on the second; the PWM is inverted backwards: DRV8833, DRV8871, MX1508.
    InIn,
}

/// How the speeds of the motors are controlled.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[repr(u8)]
pub enum SpeedFrom {
    /// Encoders: the board keeps the speeds.
    #[default]
    Encoders,
    /// The motors have no encoders: the board applies the duties of the set-points.
    Duty,
}

impl Settings {
    /// The published robot, with the published speed gains.
    ///
    /// Its encoders have 12 edges per motor revolution on both channels together, before a gear of 100.37:1. The board
    /// counts both edges of one channel, so there are 602 counts per revolution of a flagellum.
    pub const DEFAULT: Self = Self {
        board_id: 0,
        gyro_range: GyroRange::Dps250,
        accel_range: AccelRange::G2,
        low_pass: 3,
        gyro_axes: AxisMap::IDENTITY,
        accel_axes: AxisMap::IDENTITY,
        gyro_bias: [0.0; 3],
        attitude_kp: 1.0,
        attitude_ki: 0.0,
        speed_kp: 1.0,
        speed_ki: 5.0,
        counts_per_turn: 602.22,
        motor_reversed: [false; 2],
        encoder_reversed: [false; 2],
        deadline_ms: 500,
        moving_duty: [100; 2],
        bandgap: Millivolts(1100),
        bridge: Bridge::Enable,
        speed_from: SpeedFrom::Encoders,
    };

    /// Returns whether every value is in its range.
    pub fn is_valid(&self) -> bool {
        self.low_pass <= 6
            && self.gyro_axes.is_permutation()
            && self.accel_axes.is_permutation()
            && self.gyro_bias.iter().all(|bias| is_within(bias.abs(), 32768.0))
            && [self.attitude_kp, self.attitude_ki, self.speed_kp, self.speed_ki]
                .iter()
                .all(|gain| is_within(*gain, 1000.0))
            && is_within(self.counts_per_turn, 100_000.0)
            && self.counts_per_turn.to_bits() >= 1f32.to_bits()
            && (50..=5000).contains(&self.deadline_ms)
            && self.moving_duty.iter().all(|duty| *duty > 0)
            && (1000..=1200).contains(&self.bandgap.0)
    }
}

/// Returns whether `x` is in [0, limit]. Compares the bits as integers, because a comparison of f32 takes a call on the
/// board: positive numbers are in the order of their bits, and NaN and negative numbers are above all of them.
fn is_within(x: f32, limit: f32) -> bool {
    x.to_bits() <= limit.to_bits()
}

impl Default for Settings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Axis;

    const DEFAULT: Settings = Settings::DEFAULT;
    const TWICE_X: AxisMap = AxisMap([Axis::PlusX, Axis::MinusX, Axis::PlusZ]);

    #[test]
    fn settings_are_valid_up_to_their_limits() {
        let least = Settings {
            low_pass: 0,
            gyro_bias: [-32768.0; 3],
            attitude_kp: 0.0,
            attitude_ki: 0.0,
            speed_kp: 0.0,
            speed_ki: 0.0,
            counts_per_turn: 1.0,
            deadline_ms: 50,
            moving_duty: [1; 2],
            bandgap: Millivolts(1000),
            ..DEFAULT
        };
        let most = Settings {
            low_pass: 6,
            gyro_bias: [32768.0; 3],
            attitude_kp: 1000.0,
            attitude_ki: 1000.0,
            speed_kp: 1000.0,
            speed_ki: 1000.0,
            counts_per_turn: 100_000.0,
            deadline_ms: 5000,
            moving_duty: [255; 2],
            bandgap: Millivolts(1200),
            ..DEFAULT
        };
        for settings in [DEFAULT, least, most] {
            assert!(settings.is_valid(), "{settings:?}");
        }
    }

    #[test]
    fn one_value_out_of_its_range_makes_settings_invalid() {
        let mut unfit = vec![
            Settings { low_pass: 7, ..DEFAULT },
            Settings { gyro_axes: TWICE_X, ..DEFAULT },
            Settings { accel_axes: TWICE_X, ..DEFAULT },
            Settings { counts_per_turn: 0.99, ..DEFAULT },
            Settings { deadline_ms: 49, ..DEFAULT },
            Settings { deadline_ms: 5001, ..DEFAULT },
            Settings { moving_duty: [0, 100], ..DEFAULT },
            Settings { moving_duty: [100, 0], ..DEFAULT },
            Settings { bandgap: Millivolts(999), ..DEFAULT },
            Settings { bandgap: Millivolts(1201), ..DEFAULT },
        ];
        for bias in [32769.0, -32769.0, f32::NAN, f32::INFINITY] {
            unfit.extend(
                [[bias, 0.0, 0.0], [0.0, bias, 0.0], [0.0, 0.0, bias]]
                    .map(|gyro_bias| Settings { gyro_bias, ..DEFAULT }),
            );
        }
        for number in [-1.0, 1000.1, f32::NAN] {
            unfit.extend([
                Settings { attitude_kp: number, ..DEFAULT },
                Settings { attitude_ki: number, ..DEFAULT },
                Settings { speed_kp: number, ..DEFAULT },
                Settings { speed_ki: number, ..DEFAULT },
                Settings { counts_per_turn: 100.0 * number, ..DEFAULT },
            ]);
        }
        for settings in unfit {
            assert!(!settings.is_valid(), "{settings:?}");
        }
    }
}
