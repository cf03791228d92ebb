//! The frames of the stream.

use crate::fault::Fault;
use crate::units::{
    CentiRpm, Count, Duty, EncoderCounts, Micros, Millivolts, Quaternion, SensorCounts, TemperatureCounts,
};
use serde::{Deserialize, Serialize};
use serde_repr::{Deserialize_repr, Serialize_repr};
#[cfg(target_arch = "avr")]
use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes};

/// The board's state.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[repr(u8)]
pub enum State {
    /// Motors off.
    #[default]
    Idle,
    /// Motors off, averaging the gyroscope.
    Calibrating,
    /// Motors under speed control.
    Running,
    /// Motors driven open-loop.
    Driving,
    /// Motors off until the fault is cleared.
    Faulted,
}

/// State of the robot at one tick of the control loop.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[cfg_attr(target_arch = "avr", repr(C), serde(remote = "Self"))]
pub struct Telemetry {
    /// One more than in the frame before, so that lost frames can be counted.
    pub seq: Count,
    /// The board's clock when the tick began to read the sensor.
    pub time: Micros,
    /// Attitude of the body in the world: z up, yaw from an arbitrary zero.
    pub attitude: Quaternion,
    /// Gyroscope, raw, sensor axes.
    pub gyro: [SensorCounts; 3],
    /// Accelerometer, raw, sensor axes.
    pub accel: [SensorCounts; 3],
    /// The sensor's temperature.
    pub temperature: TemperatureCounts,
    /// Target speeds of flagella 1 and 2.
    pub target: [CentiRpm; 2],
    /// Measured speeds; [`CentiRpm::UNKNOWN`] without encoders.
    pub speed: [CentiRpm; 2],
    /// Duties of the bridges.
    pub duty: [Duty; 2],
    /// Positions of the encoders, meaningless without them; [`Settings::counts_per_turn`](crate::Settings::counts_per_turn) counts are one
    /// revolution of a flagellum. They count from the flagella's marks if
    /// [`Info::angles_known`](crate::Info::angles_known), otherwise from the board's start.
    pub encoder: [EncoderCounts; 2],
    /// The board's state.
    pub state: State,
    /// The latched fault.
    pub fault: Fault,
    /// [`SetPoint::phase`](crate::SetPoint::phase) of the set-point in force; 0 without a schedule. The last one stays
    /// until the next command for the motors.
    pub phase: u8,
    /// The board's supply, measured four times a second against its bandgap reference.
    pub supply: Millivolts,
    /// Whether the sensor was read in this tick; otherwise its values are of the last good reading.
    pub imu_fresh: bool,
    /// Frames of the stream that the board could not send in time.
    pub unsent: Count,
    /// Readings of the sensor that failed.
    pub imu_errors: Count,
    /// Readings with an axis at the end of its range.
    pub clipped: Count,
    /// Edges of both encoders that were too close to be motion.
    pub glitches: Count,
    /// Damaged frames from the host.
    pub bad_frames: Count,
    /// Ticks that were missed because an earlier one took too long.
    pub missed_ticks: Count,
}
