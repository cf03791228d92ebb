//! A long rest: the gyroscope's noise from the Allan deviation, the flicker and walk of its bias, and the bias's change
//! with temperature.
//!
//! The Allan deviation uses the overlapping estimator of IEEE Std 952-2020, annex C, over bins of 0.1 s. At short
//! averaging times τ it is N/√τ, where N is the angle random walk. From n/m independent differences, its relative
//! uncertainty is 1/√(2 (n/m - 1)). [`bias_noise`] estimates flicker and random walk of the bias.

use super::file::{AXES, MeasuredSensor};
use super::reading::{Mean, Motion, RawReading, Rests};
use super::{Estimate, NotMeasured, bias_noise};
use crate::statistics::{Line, extremes};
use sim::functions::{ln, powi};

/// Length of a bin, s.
const BIN_S: f64 = 0.1;

/// Averaging time at which the white noise is measured, s: longer than the delay of every filter, and too short for the
/// bias to change.
const WHITE_S: f64 = 0.8;

/// The longest averaging time is the rest divided by this.
const LEAST_AVERAGES: usize = 8;

/// Bins per point in the fit of the bias against temperature.
const POINT: usize = 100;

/// Smallest change of temperature for this fit, K.
const LEAST_KELVIN: f64 = 1.0;

/// Longest wait for the sensor to come to rest, s.
const PATIENCE_S: f64 = 60.0;

/// Follows the rest as the readings come in.
#[derive(Clone, Debug)]
pub struct StillWatch {
    seconds: f64,
    rests: Rests,
    first_s: Option<f64>,
    begun_s: Option<f64>,
    /// The bin of the readings to come.
    bin: Mean,
    bins: Vec<Mean>,
}

impl StillWatch {
    /// Returns a watch for a rest of `seconds`.
    pub fn new(seconds: f64) -> Self {
        Self { seconds, rests: Rests::default(), first_s: None, begun_s: None, bin: Mean::default(), bins: Vec::new() }
    }

    /// Adds a reading. Returns the remaining time, s; 0 at the end.
    ///
    /// # Errors
    /// [`NotMeasured`] if the sensor moved, or was never still.
    pub fn push(&mut self, reading: &RawReading) -> Result<f64, NotMeasured> {
        let first_s = *self.first_s.get_or_insert(reading.time_s);
        let motion = self.rests.push(reading);
        let Some(begun_s) = self.begun_s else {
            if self.rests.is_resting() && self.rests.rest.length_s() > 1.0 {
                self.begun_s = Some(reading.time_s);
            } else if reading.time_s - first_s > PATIENCE_S {
                let what = format!("the sensor was not still within {PATIENCE_S:.0} s");
                return Err(NotMeasured::new(what, "put it on a table that does not shake, and start again"));
            }
            return Ok(self.seconds);
        };
        let length_s = reading.time_s - begun_s;
        if motion == Motion::Moving {
            let what = format!("the sensor moved after {length_s:.0} of {:.0} s", self.seconds);
            let cure = "lay it where nobody walks or works, away from fans, and start again";
            return Err(NotMeasured::new(what, cure));
        }
        // Bins without a reading repeat the last one, so that the time stays right.
        while length_s >= (self.bins.len() + 1) as f64 * BIN_S {
            let full = if self.bin.count > 0.0 { self.bin } else { self.bins.last().copied().unwrap_or_default() };
            self.bins.push(full);
            self.bin = Mean::default();
        }
        self.bin.push(reading);
        Ok((self.seconds - length_s).max(0.0))
    }

    /// Returns the result.
    ///
    /// # Errors
    /// [`NotMeasured`] after a short rest.
    pub fn result(&self) -> Result<StillResult, NotMeasured> {
        let seconds = self.bins.len() as f64 * BIN_S;
        let temperature_c: Vec<f64> = self.bins.iter().map(|bin| bin.temperature_c).collect();
        let axis = |i: usize| {
            let rates_dps: Vec<f64> = self.bins.iter().map(|bin| bin.rate_dps[i]).collect();
            AxisNoise::of(&rates_dps, &temperature_c).ok_or_else(|| {
                let cure = "give at least 30 s; 600 s and more tell the instability of the bias";
                NotMeasured::new(format!("{seconds:.0} s at rest are too short"), cure)
            })
        };
        Ok(StillResult { seconds, axes: [axis(0)?, axis(1)?, axis(2)?], warming: self.warming() })
    }

    /// Returns the change of each bias with temperature, °/s/K; `None` if the temperature did not change enough.
    fn warming(&self) -> Option<[Estimate; 3]> {
        let points: Vec<_> = self.bins.chunks_exact(POINT).collect();
        let mean = |point: &[Mean], of: &dyn Fn(&Mean) -> f64| point.iter().map(of).sum::<f64>() / POINT as f64;
        let warmth: Vec<f64> = points.iter().map(|point| mean(point, &|bin| bin.temperature_c)).collect();
        let [least, most] = extremes(warmth.iter().copied());
        if most - least < LEAST_KELVIN || points.len() < 6 {
            return None;
        }
        let slope = |i: usize| {
            let rates = points.iter().map(|point| mean(point, &|bin| bin.rate_dps[i]));
            let of_warmth: Vec<(f64, f64)> = warmth.iter().copied().zip(rates).collect();
            let line = Line::through(of_warmth.iter().copied());
            let left: Vec<f64> = of_warmth.iter().map(|point| line.off(*point)).collect();
            let lagged: f64 = left.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / line.squares;
            // Correlated neighbours count for less.
            let correlation = lagged.clamp(0.0, 0.95);
            let longer = (1.0 + correlation) / (1.0 - correlation);
            let variance = line.squares / (of_warmth.len() - 2) as f64 / line.spread;
            Estimate { value: line.slope, u: (variance * longer).sqrt() }
        };
        Some([0, 1, 2].map(slope))
    }
}

/// Result of a long rest.
#[derive(Clone, PartialEq, Debug)]
pub struct StillResult {
    /// Length of the rest, s.
    pub seconds: f64,
    /// Each axis.
    pub axes: [AxisNoise; 3],
    /// Change of each bias with temperature, °/s/K; `None` if the temperature did not change enough.
    pub warming: Option<[Estimate; 3]>,
}

/// Noise of the gyroscope about an axis.
#[derive(Clone, PartialEq, Debug)]
pub struct AxisNoise {
    /// Averaging times, s, with the Allan deviation, °/s.
    pub allan: Vec<(f64, Estimate)>,
    /// Angle random walk, °/√s.
    pub walk_of_angle: Estimate,
    /// Bias instability, °/s: the size of the flicker.
    pub instability_dps: Estimate,
    /// Random walk of the bias, °/s/√s.
    pub walk_of_bias: Estimate,
}

impl AxisNoise {
    /// Returns the noise of rates in bins; `None` if there are too few.
    fn of(rates_dps: &[f64], temperature_c: &[f64]) -> Option<Self> {
        let allan = allan_deviation(rates_dps);
        let nearest = |(a, _): &&(f64, Estimate), (b, _): &&(f64, Estimate)| {
            ln(a / WHITE_S).abs().total_cmp(&ln(b / WHITE_S).abs())
        };
        if allan.len() < 5 {
            return None;
        }
        let (tau_s, at) = *allan.iter().min_by(nearest)?;
        let walk_of_angle = Estimate { value: at.value * tau_s.sqrt(), u: at.u * tau_s.sqrt() };
        let bias = bias_noise::of_rest(rates_dps, temperature_c, BIN_S, walk_of_angle.value);
        Some(Self { walk_of_angle, instability_dps: bias.instability_dps, walk_of_bias: bias.walk, allan })
    }
}

/// Returns the Allan deviation for averaging times in octaves.
fn allan_deviation(rates_dps: &[f64]) -> Vec<(f64, Estimate)> {
    let mut angle_deg = vec![0.0];
    for rate in rates_dps {
        angle_deg.push(angle_deg[angle_deg.len() - 1] + rate * BIN_S);
    }
    let lengths = std::iter::successors(Some(1usize), |m| Some(2 * m));
    let points = lengths.take_while(|m| m * LEAST_AVERAGES <= rates_dps.len()).map(|m| {
        let tau_s = m as f64 * BIN_S;
        let windows = angle_deg.windows(2 * m + 1);
        let count = windows.len() as f64;
        let squares: f64 = windows.map(|angle| powi(angle[2 * m] - 2.0 * angle[m] + angle[0], 2)).sum();
        let value = (squares / (2.0 * count)).sqrt() / tau_s;
        let differences = rates_dps.len() as f64 / m as f64 - 1.0;
        (tau_s, Estimate { value, u: value / (2.0 * differences).sqrt() })
    });
    points.collect()
}

impl StillResult {
    /// Enters the result into the file of the sensor.
    pub fn enter(&self, file: &mut MeasuredSensor) {
        for (i, axis) in AXES.iter().enumerate() {
            let noise = &self.axes[i];
            file.set("angle_random_walk_deg_per_root_s", axis, noise.walk_of_angle);
            file.set("bias_instability_dps", axis, noise.instability_dps);
            file.set("bias_walk_dps_per_root_s", axis, noise.walk_of_bias);
            if let Some(warming) = &self.warming {
                file.set("bias_dps_per_kelvin", axis, warming[i]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::tests::Random;

    /// Returns a rest with white noise of this density and a walk of the bias, warming by 0.01 K/s unless `kelvin_dps` is zero.
    fn watch(density: f64, walk: f64, seconds: f64, kelvin_dps: f64) -> StillWatch {
        let mut watch = StillWatch::new(seconds);
        let mut random = Random::new(11);
        let mut bias = [1.0, -0.5, 0.2];
        let mut time_s = 0.0;
        loop {
            time_s += 0.005;
            let warmer = if kelvin_dps == 0.0 { 0.0 } else { 0.01 * time_s };
            let rate_dps = std::array::from_fn(|i| {
                bias[i] += walk * 0.005f64.sqrt() * random.normal();
                bias[i] + kelvin_dps * warmer + density / 0.005f64.sqrt() * random.normal()
            });
            let reading = RawReading { time_s, rate_dps, force_g: [0.0, 0.0, 1.0], temperature_c: 25.0 + warmer };
            if watch.push(&reading).unwrap() == 0.0 {
                return watch;
            }
        }
    }

    #[test]
    fn white_noise_and_a_walk_are_found() {
        let result = watch(0.005, 0.0, 600.0, 0.0).result().unwrap();
        for axis in &result.axes {
            assert!((axis.walk_of_angle.value - 0.005).abs() < 3.0 * axis.walk_of_angle.u, "{axis:?}");
            assert!(axis.walk_of_angle.u < 0.0005 && axis.walk_of_bias.value < 3.0 * axis.walk_of_bias.u, "{axis:?}");
        }
        assert_eq!(result.warming, None);
        let result = watch(0.005, 0.002, 600.0, 0.0).result().unwrap();
        for axis in &result.axes {
            // Some of it may be flicker: `bias_noise` has the tests of both.
            assert!((0.0012..0.0026).contains(&axis.walk_of_bias.value) && axis.walk_of_bias.u < 5e-4, "{axis:?}");
        }
    }

    #[test]
    fn the_change_with_temperature_is_found() {
        let warming = watch(0.005, 0.0, 400.0, 0.02).result().unwrap().warming.unwrap();
        for slope in warming {
            assert!((slope.value - 0.02).abs() < 4.0 * slope.u && slope.u < 0.002, "{slope:?}");
        }
    }

    #[test]
    fn a_push_and_a_short_rest_are_errors() {
        let mut watch = watch(0.005, 0.0, 20.0, 0.0);
        let last_s = watch.begun_s.unwrap() + 20.0;
        let pushed = (0..200).find_map(|n| {
            let reading = RawReading {
                time_s: last_s + 0.005 * f64::from(n),
                rate_dps: [30.0, 0.0, 0.0],
                ..RawReading::default()
            };
            watch.push(&reading).err()
        });
        assert!(pushed.unwrap().to_string().starts_with("the sensor moved after "));
        assert_eq!(StillWatch::new(5.0).result().unwrap_err().to_string(), "0 s at rest are too short");
    }
}
