//! The attitude over a trial, with the data for estimating the drift of its yaw.

use super::{Columns, Reading, Track, Unwrap, rotation};
use nalgebra::{UnitQuaternion, Vector3};
use sim::body::attitude::rotation_between;
use std::ops::Range;

/// Minimum duration to estimate the bias about x and y, s.
const LEAST_LATERAL_S: f64 = 4.0;

/// The attitude over a trial.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Yaw (unwrapped), pitch and roll, degrees.
    pub angles_deg: Columns<3>,
    /// Temperature of the sensor, °C.
    temperature_c: Columns<1>,
    /// Whether the board's filter estimates the gyroscope's bias itself.
    pub(crate) learns_bias: bool,
    /// Integrals of the rates about the body's x and y, minus the attitude's rotation about these axes, degrees. They
    /// grow with the bias, which the board's filter cancels. Empty if the frames have no rates.
    gyro_minus_attitude_deg: Columns<2>,
    /// Integrals of the rates about the body's x and y, degrees.
    turned_lateral_deg: [f64; 2],
    unwrap: Unwrap,
    last: Option<UnitQuaternion<f64>>,
    turned: Vector3<f64>,
}

impl Series {
    /// Creates an empty series. `learns_bias` states whether the board's filter estimates the gyroscope's bias.
    pub fn new(learns_bias: bool) -> Self {
        Self { learns_bias, ..Self::default() }
    }

    /// Adds a reading.
    pub fn push(&mut self, time_s: f64, reading: &Reading) {
        let attitude = rotation(reading.attitude);
        let passed_s = self.angles_deg.time_s.last().map_or(0.0, |before| (time_s - before).max(0.0));
        self.angles_deg.push(time_s, self.unwrap.angles_deg(&attitude));
        self.temperature_c.push(time_s, [reading.temperature_c]);
        if let Some(last) = self.last.replace(attitude) {
            // The rotation is relative to the previous body axes.
            self.turned += rotation_between(&last, &attitude);
        }
        if let Some(rates) = reading.rates_dps {
            for (sum, rate) in self.turned_lateral_deg.iter_mut().zip(rates) {
                *sum += rate * passed_s;
            }
            let [x, y, _] = self.turned_deg();
            let lateral = self.turned_lateral_deg;
            self.gyro_minus_attitude_deg.push(time_s, [lateral[0] - x, lateral[1] - y]);
        }
    }

    /// Returns the yaw, degrees, unwrapped.
    pub fn yaw(&self) -> Track<'_> {
        self.angles_deg.track(0)
    }

    /// Returns the pitch, degrees.
    pub fn pitch(&self) -> Track<'_> {
        self.angles_deg.track(1)
    }

    /// Returns the roll, degrees.
    pub fn roll(&self) -> Track<'_> {
        self.angles_deg.track(2)
    }

    /// Returns the temperature of the sensor, °C.
    pub fn temperature(&self) -> Track<'_> {
        self.temperature_c.track(0)
    }

    /// Returns the bias about the body's x and y, °/s; `None` if the time is too short,
    /// or if the frames have no rates.
    pub(super) fn lateral_bias(&self, range: Range<f64>) -> Option<[f64; 2]> {
        if self.learns_bias || range.end - range.start < LEAST_LATERAL_S {
            return None;
        }
        self.held_back_dps(range)
    }

    /// Returns the rates about the body's x and y that the board's filter cancels: the gyroscope's rates minus the
    /// attitude's, °/s. They are constant once the filter has settled, however the robot moves. `None` if the frames
    /// have no rates.
    pub(crate) fn held_back_dps(&self, range: Range<f64>) -> Option<[f64; 2]> {
        let [x, y] = self.gyro_minus_attitude_deg.tracks().map(|track| track.slope(range.clone()));
        Some([x?, y?])
    }

    /// Returns the angle turned about each body axis so far, degrees: the integral of the angular velocity.
    pub fn turned_deg(&self) -> [f64; 3] {
        self.turned.map(f64::to_degrees).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turned_angle_is_unwrapped_and_in_body_axes() {
        let mut series = Series::default();
        for i in 0..=7200 {
            let half = (f64::from(i) * 0.1).to_radians() / 2.0;
            let attitude = [half.cos(), 0.0, 0.0, half.sin()];
            series.push(f64::from(i) * 0.005, &Reading { attitude, ..Reading::default() });
        }
        assert!((series.yaw().at(36.0).unwrap() - 720.0).abs() < 1e-9);
        let turned = series.turned_deg();
        assert!(turned[0].abs() < 1e-9 && turned[1].abs() < 1e-9 && (turned[2] - 720.0).abs() < 1e-9);
    }
}
