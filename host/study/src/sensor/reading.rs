//! Readings of a sensor that lies still or is moved by hand, and the detection of its rests.

use protocol::units::STANDARD_GRAVITY_MPS2;
use protocol::{GENUINE_IMU_ID, Settings, Telemetry};
use std::collections::VecDeque;

/// An uncorrected reading in physical units and body axes: it contains the bias, and the scale error that the board
/// would correct.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct RawReading {
    /// The board's clock, s.
    pub time_s: f64,
    /// Angular rate, °/s.
    pub rate_dps: [f64; 3],
    /// Specific force, standard gravity.
    pub force_g: [f64; 3],
    /// Temperature of the sensor, °C, converted as an MPU6050's. Only its changes are used.
    pub temperature_c: f64,
}

impl RawReading {
    /// Returns the reading in a frame at `time_s` of the board's clock. `settings` are the board's settings.
    pub fn of(frame: &Telemetry, settings: &Settings, time_s: f64) -> Self {
        let Settings { gyro_range, accel_range, gyro_axes, accel_axes, .. } = settings;
        Self {
            time_s,
            rate_dps: gyro_axes.apply(frame.gyro.map(|counts| gyro_range.rad_per_s(counts).to_degrees())),
            force_g: accel_axes.apply(frame.accel.map(|counts| accel_range.mps2(counts) / STANDARD_GRAVITY_MPS2)),
            temperature_c: frame.temperature.celsius(GENUINE_IMU_ID),
        }
    }
}

/// Length of a block, s: a rest consists of blocks.
pub const BLOCK_S: f64 = 0.25;

/// Unused still blocks at either end of a rest, because a hand lets go slowly.
const MARGIN: usize = 2;

/// Largest standard deviation of the rates in a block at rest, °/s: ten times the noise of the data sheet (0.05 °/s at
/// 92 Hz). In a hand it is several °/s.
const STILL_NOISE_DPS: f64 = 0.5;

/// Largest change of the mean rate from a block at rest to the next, °/s.
const STILL_CHANGE_DPS: f64 = 0.4;

/// Largest difference between a block's mean rate and the bias of the last rest, °/s. A bias changes less between two
/// poses (0.2 °/s) or in minutes.
const STILL_BIAS_DPS: f64 = 1.0;

/// The largest bias of a working sensor, °/s: twice the zero-rate output of the data sheet.
const LARGEST_BIAS_DPS: f64 = 40.0;

/// Means over a block, or over the blocks of a rest.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Mean {
    /// Number of readings.
    pub count: f64,
    /// Time of the first and of the last reading, s.
    pub span_s: [f64; 2],
    /// Mean time, s.
    pub time_s: f64,
    /// Mean rate, °/s.
    pub rate_dps: [f64; 3],
    /// Mean specific force, standard gravity.
    pub force_g: [f64; 3],
    /// Mean temperature, °C.
    pub temperature_c: f64,
    /// Sum of the squared deviations of each rate, (°/s)².
    squares: [f64; 3],
}

impl Mean {
    /// Adds a reading (Welford's method).
    pub fn push(&mut self, reading: &RawReading) {
        if self.count == 0.0 {
            self.span_s[0] = reading.time_s;
        }
        self.span_s[1] = reading.time_s;
        self.count += 1.0;
        let share = 1.0 / self.count;
        self.time_s += share * (reading.time_s - self.time_s);
        self.temperature_c += share * (reading.temperature_c - self.temperature_c);
        for i in 0..3 {
            let off = reading.rate_dps[i] - self.rate_dps[i];
            self.rate_dps[i] += share * off;
            self.squares[i] += off * (reading.rate_dps[i] - self.rate_dps[i]);
            self.force_g[i] += share * (reading.force_g[i] - self.force_g[i]);
        }
    }

    /// Adds the readings of a later block.
    fn join(&mut self, later: &Self) {
        if self.count == 0.0 {
            *self = *later;
            return;
        }
        let count = self.count + later.count;
        let share = later.count / count;
        let mix = |a: &mut f64, b: f64| *a += share * (b - *a);
        for i in 0..3 {
            let off = later.rate_dps[i] - self.rate_dps[i];
            self.squares[i] += later.squares[i] + off * off * self.count * share;
            mix(&mut self.rate_dps[i], later.rate_dps[i]);
            mix(&mut self.force_g[i], later.force_g[i]);
        }
        mix(&mut self.time_s, later.time_s);
        mix(&mut self.temperature_c, later.temperature_c);
        self.span_s[1] = later.span_s[1];
        self.count = count;
    }

    /// Returns the time from the first reading to the last, s.
    pub fn length_s(&self) -> f64 {
        self.span_s[1] - self.span_s[0]
    }

    /// Returns the standard uncertainty of each mean rate from the scatter of its readings, °/s. Two readings count as
    /// one: they pass a filter of about 42 Hz, so neighbours are not independent.
    pub fn rate_u_dps(&self) -> [f64; 3] {
        self.squares.map(|squares| (2.0 * squares).sqrt() / self.count.max(1.0))
    }
}

/// Effect of a new reading on the rest.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Motion {
    /// The block is not full yet.
    Unknown,
    /// The last block was still and belongs to the rest.
    Still,
    /// The last block moved. The rest before it is over, if there was one.
    Moving,
}

/// Detects the rests in a stream of readings.
#[derive(Clone, Debug, Default)]
pub struct Rests {
    block: Mean,
    last: Option<Mean>,
    /// Still blocks in a row.
    still: usize,
    /// The last still blocks that are not in the rest yet.
    margin: VecDeque<Mean>,
    /// The rest so far, without its first and last blocks, in which a movement may end or begin.
    pub rest: Mean,
    bias_dps: Option<[f64; 3]>,
}

impl Rests {
    /// Adds a reading.
    pub fn push(&mut self, reading: &RawReading) -> Motion {
        self.block.push(reading);
        if self.block.length_s() < BLOCK_S {
            return Motion::Unknown;
        }
        let block = std::mem::take(&mut self.block);
        let before = self.last.replace(block);
        if !before.is_some_and(|before| self.is_still(&before, &block)) {
            self.still = 0;
            return Motion::Moving;
        }
        self.still += 1;
        if self.still == 1 {
            self.rest = Mean::default();
            self.margin.clear();
        }
        if self.still > MARGIN {
            self.margin.push_back(block);
        }
        if self.margin.len() > MARGIN
            && let Some(inner) = self.margin.pop_front()
        {
            self.rest.join(&inner);
            if self.rest.length_s() > 1.0 {
                self.bias_dps = Some(self.rest.rate_dps);
            }
        }
        Motion::Still
    }

    /// Returns whether the sensor rests.
    pub fn is_resting(&self) -> bool {
        self.still > 0
    }

    fn is_still(&self, before: &Mean, block: &Mean) -> bool {
        let off = |from: &[f64; 3]| (0..3).map(|i| (block.rate_dps[i] - from[i]).abs()).fold(0.0, f64::max);
        let squares = block.squares.into_iter().fold(0.0, f64::max);
        (squares / block.count.max(1.0)).sqrt() < STILL_NOISE_DPS
            && off(&before.rate_dps) < STILL_CHANGE_DPS
            && self.bias_dps.map_or(off(&[0.0; 3]) < LARGEST_BIAS_DPS, |bias_dps| off(&bias_dps) < STILL_BIAS_DPS)
    }
}
