//! Faults, and the log of them.

use crate::units::{CentiRpm, Duty, Micros};
use serde::{Deserialize, Serialize};
use serde_repr::{Deserialize_repr, Serialize_repr};
#[cfg(target_arch = "avr")]
use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes};

/// A fault. The first fault stays latched until it is cleared.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[repr(u8)]
pub enum Fault {
    /// No fault.
    #[default]
    None,
    /// No frame came from the host within the motors' deadline.
    LinkLost,
    /// The program hung and was restarted, or was reset while a motor was on.
    Hang,
    /// The program panicked and was restarted. Only in the log of older firmware: the present image cannot panic.
    Panic,
    /// The IMU does not acknowledge.
    ImuSilent,
    /// The IMU's bus is stuck, and clock pulses did not free it.
    ImuBusStuck,
    /// The IMU has no new data, or reports old data as new: the same data again and again, or a gyroscope of zero.
    ImuFrozen,
    /// The IMU loses its configuration repeatedly.
    ImuLostConfig,
    /// The board's supply is below [`MIN_SUPPLY_MV`].
    SupplyLow,
    /// Motor 1 hardly moves although its duty turns a free motor.
    Motor1Stalled,
    /// The same for motor 2.
    Motor2Stalled,
    /// Motor 1 turns against its duty.
    Motor1Runaway,
    /// The same for motor 2.
    Motor2Runaway,
    /// The current of motor 1, estimated from duty and speed, would overheat its winding.
    Motor1Overloaded,
    /// The same for motor 2.
    Motor2Overloaded,
    /// The direction of encoder 1 changes from edge to edge: one of its channels is dead. Or motor 1 had reached its speed
    /// and is driven, but the encoder has no edges: it is disconnected, or the rotor is blocked.
    Encoder1Failed,
    /// The same for encoder 2.
    Encoder2Failed,
    /// Encoder 1 has more edges than the motor can cause.
    Encoder1Noisy,
    /// The same for encoder 2.
    Encoder2Noisy,
}

impl Fault {
    /// All faults, in the order of their numbers on the wire and in the fault log.
    pub const ALL: [Self; 19] = [
        Self::None,
        Self::LinkLost,
        Self::Hang,
        Self::Panic,
        Self::ImuSilent,
        Self::ImuBusStuck,
        Self::ImuFrozen,
        Self::ImuLostConfig,
        Self::SupplyLow,
        Self::Motor1Stalled,
        Self::Motor2Stalled,
        Self::Motor1Runaway,
        Self::Motor2Runaway,
        Self::Motor1Overloaded,
        Self::Motor2Overloaded,
        Self::Encoder1Failed,
        Self::Encoder2Failed,
        Self::Encoder1Noisy,
        Self::Encoder2Noisy,
    ];
}

/// Supply of the board below which the motors stop, millivolts: below it the motors' bridge and the sensor's regulator are
/// outside of their data sheets.
pub const MIN_SUPPLY_MV: u16 = 4300;

/// An entry of the fault log, which survives resets and loss of power.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[cfg_attr(target_arch = "avr", repr(C), serde(remote = "Self"))]
pub struct FaultRecord {
    /// [`Info::boot_count`](crate::Info::boot_count) of the start after which it occurred.
    #[serde(with = "crate::fixed::u16")]
    pub boot: u16,
    /// The board's clock.
    pub time: Micros,
    /// The fault.
    pub fault: Fault,
    /// Duties of the bridges at that time.
    pub duty: [Duty; 2],
    /// Measured speeds.
    pub speed: [CentiRpm; 2],
    /// Address in flash at which the program hung, bytes. 0 for other faults, or if it is not known.
    #[serde(with = "crate::fixed::u16")]
    pub program_counter: u16,
}

/// Entries of the fault log.
pub const FAULT_RECORDS: u8 = 8;
