//! The quantities on the wire, each with its unit, range and conversions.
//!
//! On the wire every number has a fixed width, little-endian, so that a message always has the same length and the
//! board's encoding time does not depend on the data.

use core::fmt;
use serde::{Deserialize, Serialize};
use serde_repr::{Deserialize_repr, Serialize_repr};
#[cfg(target_arch = "avr")]
use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes};

/// Standard gravity, m/s².
pub const STANDARD_GRAVITY_MPS2: f64 = 9.80665;

/// The thermometers of the MPU6050 and of the parts that are sold as one: WHO_AM_I, name, counts per °C, and temperature at zero
/// counts, °C. By register map RM-MPU-6000A, section 4.18, and for the others by the sensitivity and the offset in their data
/// sheets (PS-MPU-6500A, PS-MPU-9250A, DS-000143), which Linux's driver `inv_mpu6050` uses, too.
const THERMOMETERS: [(u8, &str, f64, f64); 4] = [
    (crate::GENUINE_IMU_ID, "MPU6050", 340.0, 36.53),
    (0x70, "MPU6500", 333.87, 21.0),
    (0x71, "MPU9250", 333.87, 21.0),
    (0x98, "ICM-20689", 326.8, 25.0),
];

macro_rules! wire_number {
    ($(#[$doc:meta])* $name:ident($inner:ty), $with:literal) => {
        $(#[$doc])*
        #[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Hash)]
        #[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable), repr(transparent))]
        pub struct $name(#[serde(with = $with)] pub $inner);
    };
}

wire_number! {
    /// Speed of a flagellum in hundredths of rpm, positive counter-clockwise seen from above (about z_B).
    CentiRpm(i16), "crate::fixed::i16"
}
wire_number! {
    /// A number in [-1, 1) as a signed fraction of 2^15.
    Q15(i16), "crate::fixed::i16"
}
wire_number! {
    /// A raw reading of the MPU6050; [`GyroRange`] and [`AccelRange`] give it its unit.
    SensorCounts(i16), "crate::fixed::i16"
}
wire_number! {
    /// A raw temperature of the sensor, whose part gives it its unit.
    TemperatureCounts(i16), "crate::fixed::i16"
}
wire_number! {
    /// Duty of a motor's bridge, -255 (full reverse) to 255 (full forward).
    Duty(i16), "crate::fixed::i16"
}
wire_number! {
    /// Position of an encoder in counts, not wrapped within 2^31 counts (41 days at 90 rpm).
    EncoderCounts(i32), "crate::fixed::i32"
}
wire_number! {
    /// The board's clock in microseconds since its start; wraps after 71.6 minutes.
    Micros(u32), "crate::fixed::u32"
}
wire_number! {
    /// A voltage in millivolts.
    Millivolts(u16), "crate::fixed::u16"
}
wire_number! {
    /// A count of events since the board's start; wraps at 65536.
    Count(u16), "crate::fixed::u16"
}

/// The gyroscope's low-pass filter for each value of [`crate::Settings::low_pass`] (register map RM-MPU-6000A, section
/// 4.3): bandwidth in Hz and delay in seconds. With the filter off (0) the sensor's own 256 Hz remain; the accelerometer's
/// delay is within 0.3 ms of the gyroscope's.
pub const LOW_PASS: [(f64, f64); 7] = [
    (256.0, 0.98e-3),
    (188.0, 1.9e-3),
    (98.0, 2.8e-3),
    (42.0, 4.8e-3),
    (20.0, 8.3e-3),
    (10.0, 13.4e-3),
    (5.0, 18.6e-3),
];

impl CentiRpm {
    /// The largest speed that the board accepts, in either direction.
    pub const LIMIT: Self = Self(9000);

    /// A speed that is not measured.
    pub const UNKNOWN: Self = Self(i16::MIN);

    /// Returns the nearest value to `rpm`; saturates at ±327.67 rpm.
    pub fn from_rpm(rpm: f64) -> Self {
        Self(round_to_i16(rpm * 100.0))
    }

    /// Returns the speed in rpm; NaN if it is unknown.
    pub fn rpm(self) -> f64 {
        if self == Self::UNKNOWN { f64::NAN } else { f64::from(self.0) / 100.0 }
    }

    /// Returns the speed in rad/s.
    pub fn rad_per_s(self) -> f64 {
        self.rpm() * core::f64::consts::TAU / 60.0
    }
}

impl Q15 {
    /// Returns the nearest value to `x`; saturates at -1 and 32767/32768.
    pub fn from_f64(x: f64) -> Self {
        Self(round_to_i16(x * 32768.0))
    }

    /// Returns the number.
    pub fn to_f64(self) -> f64 {
        f64::from(self.0) / 32768.0
    }
}

/// Returns the name of a sensor with a known thermometer.
pub fn imu_part(imu_id: u8) -> Option<&'static str> {
    THERMOMETERS.iter().find(|(id, ..)| *id == imu_id).map(|(_, part, ..)| *part)
}

impl TemperatureCounts {
    /// Returns the nearest value to a temperature in °C, for an MPU6050.
    pub fn from_celsius(celsius: f64) -> Self {
        Self(round_to_i16((celsius - 36.53) * 340.0))
    }

    /// Returns the temperature in °C by the part with this WHO_AM_I; NaN if its thermometer is unknown. With the formula of
    /// an MPU6050, differences are right within 4 % for the other parts, too.
    pub fn celsius(self, imu_id: u8) -> f64 {
        let of_part = THERMOMETERS.iter().find(|(id, ..)| *id == imu_id);
        of_part.map_or(f64::NAN, |(.., per_c, zero_c)| f64::from(self.0) / per_c + zero_c)
    }
}

impl Duty {
    /// Full voltage.
    pub const FULL: Self = Self(255);

    /// Returns the fraction of the supply voltage, -1 to 1.
    pub fn fraction(self) -> f64 {
        f64::from(self.0) / 255.0
    }
}

impl Millivolts {
    /// Returns the voltage in volts.
    pub fn volts(self) -> f64 {
        f64::from(self.0) / 1000.0
    }
}

impl Micros {
    /// Returns the microseconds from `earlier` to this, across one wrap of the clock.
    pub fn since(self, earlier: Self) -> u32 {
        self.0.wrapping_sub(earlier.0)
    }
}

/// Attitude as a unit quaternion `[w, x, y, z]` (Hamilton, body to world, scalar first), with 16 bits per component.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable), repr(transparent))]
pub struct Quaternion(pub [Q15; 4]);

impl Quaternion {
    /// No rotation, to the resolution of [`Q15`].
    pub const IDENTITY: Self = Self([Q15(i16::MAX), Q15(0), Q15(0), Q15(0)]);

    /// Returns the nearest value to a unit quaternion.
    pub fn from_f64(wxyz: [f64; 4]) -> Self {
        Self(wxyz.map(Q15::from_f64))
    }

    /// Returns the normalised components; the identity if all of them are zero.
    pub fn to_f64(self) -> [f64; 4] {
        let parts = self.0.map(Q15::to_f64);
        let square: f64 = parts.iter().map(|part| part * part).sum();
        if square == 0.0 {
            return [1.0, 0.0, 0.0, 0.0];
        }
        let scale = 1.0 / sqrt(square);
        parts.map(|part| part * scale)
    }
}

impl Default for Quaternion {
    fn default() -> Self {
        Self::IDENTITY
    }
}

/// Full scale of the gyroscope (register GYRO_CONFIG).
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[repr(u8)]
pub enum GyroRange {
    /// ±250 °/s, 131 counts per °/s.
    #[default]
    Dps250,
    /// ±500 °/s, 65.5 counts per °/s.
    Dps500,
    /// ±1000 °/s, 32.8 counts per °/s.
    Dps1000,
    /// ±2000 °/s, 16.4 counts per °/s.
    Dps2000,
}

impl GyroRange {
    /// All ranges, in the order of their register codes.
    pub const ALL: [Self; 4] = [Self::Dps250, Self::Dps500, Self::Dps1000, Self::Dps2000];

    /// Returns the full scale in °/s.
    pub const fn full_scale_dps(self) -> u16 {
        250 << self as u8
    }

    /// Returns the counts per °/s (data sheet PS-MPU-6000A, table 6.1).
    pub const fn counts_per_dps(self) -> f32 {
        match self {
            Self::Dps250 => 131.0,
            Self::Dps500 => 65.5,
            Self::Dps1000 => 32.8,
            Self::Dps2000 => 16.4,
        }
    }

    /// Returns a reading in rad/s.
    pub fn rad_per_s(self, counts: SensorCounts) -> f64 {
        (f64::from(counts.0) / f64::from(self.counts_per_dps())).to_radians()
    }
}

/// Full scale of the accelerometer (register ACCEL_CONFIG).
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Default, Hash)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[repr(u8)]
pub enum AccelRange {
    /// ±2 g, 16384 counts per g.
    #[default]
    G2,
    /// ±4 g, 8192 counts per g.
    G4,
    /// ±8 g, 4096 counts per g.
    G8,
    /// ±16 g, 2048 counts per g.
    G16,
}

impl AccelRange {
    /// All ranges, in the order of their register codes.
    pub const ALL: [Self; 4] = [Self::G2, Self::G4, Self::G8, Self::G16];

    /// Returns the full scale in g.
    pub const fn full_scale_g(self) -> u8 {
        2 << self as u8
    }

    /// Returns the counts per g (data sheet PS-MPU-6000A, table 6.2).
    pub const fn counts_per_g(self) -> u16 {
        16384 >> self as u8
    }

    /// Returns a reading in m/s².
    pub fn mps2(self, counts: SensorCounts) -> f64 {
        f64::from(counts.0) / f64::from(self.counts_per_g()) * STANDARD_GRAVITY_MPS2
    }
}

/// A signed axis of the sensor.
#[derive(Serialize_repr, Deserialize_repr, Clone, Copy, PartialEq, Eq, Debug, Hash)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable))]
#[repr(u8)]
pub enum Axis {
    /// +x
    PlusX,
    /// -x
    MinusX,
    /// +y
    PlusY,
    /// -y
    MinusY,
    /// +z
    PlusZ,
    /// -z
    MinusZ,
}

impl Axis {
    /// All signed axes with their names in files.
    pub const NAMES: [(Self, &'static str); 6] = [
        (Self::PlusX, "+x"),
        (Self::MinusX, "-x"),
        (Self::PlusY, "+y"),
        (Self::MinusY, "-y"),
        (Self::PlusZ, "+z"),
        (Self::MinusZ, "-z"),
    ];

    /// Returns the index of the axis, 0 to 2.
    pub const fn index(self) -> usize {
        self as usize / 2
    }

    /// Returns whether the axis is negative.
    pub const fn is_negative(self) -> bool {
        self as u8 % 2 == 1
    }

    /// Returns the axis with this name (`"x"` is `"+x"`).
    pub fn from_name(name: &str) -> Option<Self> {
        Self::NAMES
            .iter()
            .find(|(_, full)| *full == name || full.strip_prefix('+') == Some(name))
            .map(|(axis, _)| *axis)
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::NAMES[*self as usize].1)
    }
}

/// Orientation of a sensor in the robot: entry i is the axis of the sensor that reads body axis i.
///
/// The two sensors of one chip have a map each, because some boards have a gyroscope with a flipped axis.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(target_arch = "avr", derive(IntoBytes, TryFromBytes, KnownLayout, Immutable), repr(transparent))]
pub struct AxisMap(pub [Axis; 3]);

impl AxisMap {
    /// The sensor's axes are the body's.
    pub const IDENTITY: Self = Self([Axis::PlusX, Axis::PlusY, Axis::PlusZ]);

    /// Returns whether each axis of the sensor is used once.
    pub fn is_permutation(self) -> bool {
        let mut seen = 0u8;
        for axis in self.0 {
            seen |= 1 << axis.index();
        }
        seen == 0b111
    }

    /// Returns a vector of the sensor in body axes.
    pub fn apply<T: Copy + core::ops::Neg<Output = T>>(self, sensor: [T; 3]) -> [T; 3] {
        self.0.map(|axis| {
            let value = sensor[axis.index()];
            if axis.is_negative() { -value } else { value }
        })
    }
}

impl Default for AxisMap {
    fn default() -> Self {
        Self::IDENTITY
    }
}

fn round_to_i16(x: f64) -> i16 {
    // `as` saturates, and `f64::round` is not in `core`.
    (x + 0.5f64.copysign(x)) as i16
}

/// Returns the square root by Newton's method: `core` has none, and the host needs it to the last digit.
fn sqrt(x: f64) -> f64 {
    let mut root = f64::from_bits((x.to_bits() >> 1) + (1023 << 51));
    for _ in 0..5 {
        root = 0.5 * (root + x / root);
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_round_to_the_nearest_hundredth_and_saturate() {
        assert_eq!(CentiRpm::from_rpm(-12.346), CentiRpm(-1235));
        assert_eq!(CentiRpm::from_rpm(1e9), CentiRpm(i16::MAX));
        assert!((CentiRpm(6000).rad_per_s() - core::f64::consts::TAU).abs() < 1e-12);
    }

    #[test]
    fn the_clock_counts_across_its_wrap() {
        assert_eq!(Micros(100).since(Micros(u32::MAX - 99)), 200);
    }

    #[test]
    fn a_quaternion_keeps_its_direction_within_its_resolution() {
        let q = [0.5, -0.5, 0.1, -0.7];
        let norm = q.iter().map(|x| x * x).sum::<f64>();
        let unit = q.map(|x| x / sqrt(norm));
        for (back, part) in Quaternion::from_f64(unit).to_f64().iter().zip(unit) {
            assert!((back - part).abs() < 3e-5);
        }
        assert_eq!(Quaternion([Q15(0); 4]).to_f64(), [1.0, 0.0, 0.0, 0.0]);
        assert_eq!([Q15(-16384), Q15(i16::MIN)].map(Q15::to_f64), [-0.5, -1.0]);
        let short = Quaternion::from_f64([0.15, 0.0, -0.2, 0.0]).to_f64();
        assert!((short[0] - 0.6).abs() < 1e-4 && (short[2] + 0.8).abs() < 1e-4, "{short:?}");
    }

    #[test]
    fn square_roots_are_exact_to_the_last_digit() {
        for step in 1..4000 {
            let x = f64::from(step) * 1e-3;
            assert!((sqrt(x) / x.sqrt() - 1.0).abs() <= f64::EPSILON, "{} of {x}", sqrt(x));
        }
    }

    #[test]
    fn duties_are_fractions_of_the_supply_and_millivolts_are_volts() {
        assert_eq!([Duty(-255), Duty(0), Duty(51), Duty::FULL].map(Duty::fraction), [-1.0, 0.0, 0.2, 1.0]);
        assert_eq!(Millivolts(4987).volts(), 4.987);
    }

    #[test]
    fn temperature_follows_the_part() {
        let genuine = TemperatureCounts::from_celsius(25.0);
        // By the formula of an MPU6050, the reading of an MPU6500 at 25 °C is 40.5 °C.
        for (imu_id, part, counts) in [
            (0x68, "MPU6050", genuine),
            (0x70, "MPU6500", TemperatureCounts(1335)),
            (0x71, "MPU9250", TemperatureCounts(1335)),
            (0x98, "ICM-20689", TemperatureCounts(0)),
        ] {
            assert_eq!(imu_part(imu_id), Some(part));
            assert!((counts.celsius(imu_id) - 25.0).abs() < 2e-3, "{part}");
        }
        assert!((TemperatureCounts(0).celsius(0x68) - 36.53).abs() < 1e-9);
        assert!([0, 0x72].iter().all(|id| imu_part(*id).is_none() && genuine.celsius(*id).is_nan()));
    }

    #[test]
    fn full_scales_double_from_range_to_range() {
        assert_eq!(GyroRange::ALL.map(GyroRange::full_scale_dps), [250, 500, 1000, 2000]);
        assert_eq!(AccelRange::ALL.map(AccelRange::full_scale_g), [2, 4, 8, 16]);
        assert_eq!(AccelRange::ALL.map(AccelRange::counts_per_g), [16384, 8192, 4096, 2048]);
        assert!((AccelRange::G8.mps2(SensorCounts(4096)) - STANDARD_GRAVITY_MPS2).abs() < 1e-12);
    }

    /// Data sheet PS-MPU-6000A, table 6.1.
    #[test]
    fn a_reading_of_90_degrees_a_second_has_the_data_sheets_counts_in_every_range() {
        assert_eq!(GyroRange::ALL.map(GyroRange::counts_per_dps), [131.0, 65.5, 32.8, 16.4]);
        for (range, counts) in GyroRange::ALL.into_iter().zip([11_790, 5895, 2952, 1476]) {
            for sign in [1, -1] {
                let rate = range.rad_per_s(SensorCounts(sign * counts));
                assert!((rate - f64::from(sign) * core::f64::consts::FRAC_PI_2).abs() < 1e-6, "{rate} at {range:?}");
            }
        }
    }

    #[test]
    fn an_axis_map_permutes_and_flips() {
        let map = AxisMap([Axis::MinusY, Axis::PlusX, Axis::PlusZ]);
        assert!(map.is_permutation());
        assert_eq!(map.apply([1, 2, 3]), [-2, 1, 3]);
        assert!(!AxisMap([Axis::PlusX, Axis::MinusX, Axis::PlusZ]).is_permutation());
        for (axis, name) in Axis::NAMES {
            assert_eq!(Axis::from_name(name), Some(axis));
            assert_eq!(axis.to_string(), name);
            assert_eq!((["x", "y", "z"][axis.index()], axis.is_negative()), (&name[1..], name.starts_with('-')));
        }
        assert_eq!(Axis::from_name("z"), Some(Axis::PlusZ));
        assert_eq!(Axis::from_name("w"), None);
    }
}
