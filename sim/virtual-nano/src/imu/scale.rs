//! Constants of the part, from its data sheet PS-MPU-6000A-00 and its register map RM-MPU-6000A-00.

/// A measuring range.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Range {
    /// Full scale, in °/s or g.
    pub full_scale: f64,
    /// Counts per °/s or g.
    pub counts_per_unit: f64,
}

const fn range(full_scale: f64, counts_per_unit: f64) -> Range {
    Range { full_scale, counts_per_unit }
}

/// The gyroscope's ranges in the order of FS_SEL (data sheet, section 6.1).
pub const GYRO: [Range; 4] = [range(250.0, 131.0), range(500.0, 65.5), range(1000.0, 32.8), range(2000.0, 16.4)];

/// The accelerometer's ranges in the order of AFS_SEL (data sheet, section 6.2).
pub const ACCEL: [Range; 4] = [range(2.0, 16384.0), range(4.0, 8192.0), range(8.0, 4096.0), range(16.0, 2048.0)];

/// A setting of the low-pass filter.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LowPass {
    /// The gyroscope's bandwidth.
    pub gyro_hz: f64,
    /// The accelerometer's bandwidth.
    pub accel_hz: f64,
    /// The gyroscope's delay, s. The accelerometer's is within 1 ms of it.
    pub delay_s: f64,
}

const fn low_pass(gyro_hz: f64, accel_hz: f64, delay_s: f64) -> LowPass {
    LowPass { gyro_hz, accel_hz, delay_s }
}

/// The low-pass filter's settings in the order of DLPF_CFG (register map, section 4.3). The last value is reserved: the
/// part then filters as little as possible.
pub const LOW_PASS: [LowPass; 8] = [
    low_pass(256.0, 260.0, 0.98e-3),
    low_pass(188.0, 184.0, 1.9e-3),
    low_pass(98.0, 94.0, 2.8e-3),
    low_pass(42.0, 44.0, 4.8e-3),
    low_pass(20.0, 21.0, 8.3e-3),
    low_pass(10.0, 10.0, 13.4e-3),
    low_pass(5.0, 5.0, 18.6e-3),
    low_pass(256.0, 260.0, 0.98e-3),
];

/// Samples a second before the divider, with the low-pass filter off (register map, section 4.2).
pub const RATE_UNFILTERED_HZ: f64 = 8000.0;
/// The same with the filter on.
pub const RATE_FILTERED_HZ: f64 = 1000.0;

/// Density of the gyroscope's noise, one-sided, °/s per root Hz (data sheet, section 6.1).
pub const GYRO_NOISE_DPS: f64 = 0.005;
/// Density of the accelerometer's noise, one-sided, g per root Hz (data sheet, section 6.2).
pub const ACCEL_NOISE_G: f64 = 400e-6;

/// Returns the temperature's reading (register map, section 4.18).
pub fn temperature_counts(celsius: f64) -> f64 {
    (celsius - 36.53) * 340.0
}

/// Returns the temperature of a reading, °C.
pub fn celsius(counts: f64) -> f64 {
    counts / 340.0 + 36.53
}

/// Returns the number rounded, and saturated like the part.
pub fn counts(x: f64) -> i16 {
    x.round() as i16
}
