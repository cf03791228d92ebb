//! The built-in controller: a feed-forward from the robot's map, and an integral of the remaining error of the means.
//!
//! Let w₀ be the speeds at which the map has the target attitude y*. Near w₀, the robot's mean attitude y follows its
//! speeds w as τ y' = y* + J (w - w₀) - y, with the derivatives J of the map and the diagonal lags τ, [`LAGS_S`]. If
//! the map is exact, y follows the reference r given by τ r' = s y* - r, where s rises from 0 to 1 while the motors
//! start. The controller corrects only deviations from r. With the error of the means e = r̄ - ȳ, both over the same
//! turns,
//!
//! ```text
//! w = s w₀ + J⁻¹ (τ e + ∫ e dt) / T
//! ```
//!
//! The term τ e cancels the robot's lag. The open loop is then an integrator with the delay of the means, half of their
//! window, at most 3 s: G(s) = exp(-3 s) / (T s). With T = [`RESPONSE_S`] = 8 s an error falls by e in 8 s. The phase
//! margin is 90° - 3/8 rad = 69°. The loop is stable as long as the robot's response is less than π/2 · 8/3 = 4 times
//! the map's. This leaves room for a wrong map, such as the map for another viscosity.
//!
//! | limit | value | why |
//! | --- | --- | --- |
//! | speed | 90 rpm | the board refuses more |
//! | change of a speed | [`SLEW_RPM_S`] | the flagella wind up under a jump; the map holds for slow changes |
//! | change of speed for a degree | [`STEEPEST_RPM`] | where the map is flat, its inverse asks for any speed |
//!
//! While a limit is active, the integral is frozen, so that it does not wind up.

use super::{Means, Observation, SteerError, Wanted};
use crate::aim::{Nearest, Quantity, STEEPEST_RPM, Table, Target, nearest};
use nalgebra::{DMatrix, Matrix2, Vector2};
use protocol::units::CentiRpm;

/// Time in which an error falls by e, s.
const RESPONSE_S: f64 = 8.0;

/// Fastest change of a speed, rpm/s.
const SLEW_RPM_S: f64 = 30.0;

/// An attitude is within reach if the table's error is at most this, degrees.
const WITHIN_REACH_DEG: f64 = 3.0;

/// Lags τ of mean yaw and pitch behind the set-points, s, for the robot `physical` from rest to 48.8 and 10.46 rpm. The
/// base follows its motors faster than it returns to rest, when the resting flagella hold it back.
const LAGS_S: [f64; 2] = [1.6, 5.3];

/// The controller's knowledge of the robot: the speeds for an attitude, and the effect of changing them.
#[derive(Clone, PartialEq, Debug)]
pub struct Map {
    /// The target, whose yaw is shifted by whole turns to the table's.
    pub wanted: Wanted,
    /// The speeds, rpm.
    pub rpm: [f64; 2],
    /// Angle between the robot's axis and the vertical.
    pub tilt_deg: f64,
    /// Whether the flagella touch at the nearest speeds of the table.
    pub touches: bool,
    /// Changes of the speeds for one degree of yaw and of pitch, rpm.
    inverse: Matrix2<f64>,
}

impl Map {
    /// Returns the map near an attitude from a table. The yaw is taken modulo 360 degrees.
    ///
    /// # Errors
    /// [`SteerError::OutOfReach`], and [`SteerError::Aim`] for an impossible yaw or pitch.
    pub fn of_table(table: &Table, yaw_deg: f64, pitch_deg: f64) -> Result<Self, SteerError> {
        let target = Target::new([(Quantity::Yaw, Some(yaw_deg)), (Quantity::Pitch, Some(pitch_deg))])?;
        let Nearest { rpm, attitude, error_deg, contact_share, derivatives } = nearest(table, &target)?;
        if error_deg > WITHIN_REACH_DEG {
            return Err(SteerError::OutOfReach { yaw_deg, pitch_deg, error_deg, rpm });
        }
        let turns = ((attitude.yaw_deg - yaw_deg) / 360.0).round();
        Ok(Self {
            wanted: Wanted { yaw_deg: yaw_deg + 360.0 * turns, pitch_deg },
            rpm,
            tilt_deg: attitude.tilt_deg(),
            touches: contact_share > 0.0,
            inverse: inverse(&derivatives),
        })
    }
}

/// Returns the inverse of the derivatives, without the directions of the speeds that hardly change the attitude.
#[expect(clippy::disallowed_methods, reason = "a controller of a board, whose result is not repeated to the last bit")]
fn inverse(derivatives: &DMatrix<f64>) -> Matrix2<f64> {
    let derivatives = Matrix2::from_fn(|i, k| derivatives[(i, k)]);
    derivatives.pseudo_inverse(1.0 / STEEPEST_RPM).unwrap_or_default()
}

/// The built-in controller.
#[derive(Clone, Debug)]
pub struct Controller {
    map: Map,
    /// Share of the feed-forward.
    begun: f64,
    /// The reference r: present yaw and pitch, and both over time.
    expected_deg: Vector2<f64>,
    expectations: Means,
    /// ∫ e dt / T, degrees.
    integral_deg: Vector2<f64>,
    rpm: [f64; 2],
}

impl Controller {
    /// Creates the controller for a robot at rest.
    pub fn new(map: Map) -> Self {
        let (zero, expectations) = (Vector2::zeros(), Means::default());
        Self { map, begun: 0.0, expected_deg: zero, expectations, integral_deg: zero, rpm: [0.0; 2] }
    }

    /// Returns the speeds (rpm) until the next observation. `period_s`: time since the last one, 0 at the first.
    pub fn speeds(&mut self, observation: &Observation, period_s: f64) -> [f64; 2] {
        let wanted = Vector2::new(self.map.wanted.yaw_deg, self.map.wanted.pitch_deg);
        let lags_s = Vector2::from(LAGS_S);
        let lag = (wanted * self.begun - self.expected_deg).component_div(&lags_s);
        self.expected_deg += lag * period_s;
        self.expectations.push(observation.time_s, self.expected_deg.into());
        let expected = self.expectations.over_turns(self.rpm);
        let error = Vector2::from(expected) - Vector2::new(observation.mean_yaw_deg, observation.mean_pitch_deg);
        let fastest = self.map.rpm.iter().fold(f64::MIN_POSITIVE, |fastest, rpm| rpm.abs().max(fastest));
        self.begun = (self.begun + SLEW_RPM_S * period_s / fastest).min(1.0);
        let integral_deg = self.integral_deg + error * (period_s / RESPONSE_S);
        let correction = self.map.inverse * (lags_s.component_mul(&error) / RESPONSE_S + integral_deg);
        let asked = Vector2::from(self.map.rpm) * self.begun + correction;
        let given = [0, 1].map(|k| {
            let (limit, change) = (CentiRpm::LIMIT.rpm(), SLEW_RPM_S * period_s);
            asked[k].clamp(-limit, limit).clamp(self.rpm[k] - change, self.rpm[k] + change)
        });
        if asked == Vector2::from(given) {
            self.integral_deg = integral_deg;
        }
        self.rpm = given;
        given
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Measured, RATE_HZ};
    use super::*;

    const WANTED: Wanted = Wanted { yaw_deg: -60.0, pitch_deg: -4.0 };
    /// Lags of a robot, different from the controller's.
    const OWN_LAGS_S: [f64; 2] = [4.0, 4.0];

    fn map() -> Map {
        let derivatives = DMatrix::from_row_slice(2, 2, &[-1.0, -1.0, -0.1, 0.1]);
        let inverse = inverse(&derivatives);
        Map { wanted: WANTED, rpm: [50.0, 10.0], tilt_deg: 6.0, touches: false, inverse }
    }

    /// Steers a first-order robot whose response is `gain` times the expected one. Returns mean yaw and pitch over
    /// time.
    fn steered(gain: f64, lags_s: [f64; 2], seconds: f64, mut push_deg: impl FnMut(f64) -> f64) -> Vec<[f64; 2]> {
        let mut controller = Controller::new(map());
        let (mut attitude, mut means) = ([0.0; 2], Means::default());
        let mut rpm = [0.0; 2];
        let mut all = Vec::new();
        for i in 0..(seconds * RATE_HZ) as u32 {
            let time_s = f64::from(i) / RATE_HZ;
            means.push(time_s, attitude);
            let [mean_yaw_deg, mean_pitch_deg] = means.over_turns(rpm);
            let measured = Measured { yaw_deg: attitude[0], pitch_deg: attitude[1], ..Measured::default() };
            let observation = Observation { time_s, wanted: WANTED, measured, mean_yaw_deg, mean_pitch_deg };
            let period_s = if i == 0 { 0.0 } else { 1.0 / RATE_HZ };
            let next = controller.speeds(&observation, period_s);
            for k in 0..2 {
                assert!(next[k].abs() <= 90.0 && (next[k] - rpm[k]).abs() <= SLEW_RPM_S / RATE_HZ + 1e-9, "{next:?}");
            }
            rpm = next;
            let steady = [-gain * (rpm[0] + rpm[1]), -0.1 * gain * (rpm[0] - rpm[1])];
            for k in 0..2 {
                attitude[k] += (steady[k] - attitude[k]) / (lags_s[k] * RATE_HZ);
            }
            attitude[0] += push_deg(time_s);
            all.push([mean_yaw_deg, mean_pitch_deg]);
        }
        all
    }

    fn error(means: &[[f64; 2]]) -> f64 {
        let of = |[yaw, pitch]: &[f64; 2]| (yaw - WANTED.yaw_deg).abs().max((pitch - WANTED.pitch_deg).abs());
        means.iter().map(of).fold(0.0, f64::max)
    }

    #[test]
    fn robot_of_the_map_goes_the_expected_way() {
        let means = steered(1.0, LAGS_S, 120.0, |_| 0.0);
        assert!(means.iter().all(|[yaw, _]| *yaw > -60.5), "no overshoot");
        assert!(error(&means[90 * 20..]) < 0.1, "{}", error(&means[90 * 20..]));
    }

    #[test]
    fn robot_of_another_map_is_brought_to_the_same_attitude() {
        for gain in [0.6, 0.7, 1.4, 2.0] {
            let means = steered(gain, OWN_LAGS_S, 150.0, |_| 0.0);
            assert!(error(&means[120 * 20..]) < 0.2, "gain {gain}: {}", error(&means[120 * 20..]));
        }
    }

    #[test]
    fn push_of_twenty_degrees_is_forgotten() {
        let means = steered(0.8, OWN_LAGS_S, 180.0, |time_s| if (time_s - 90.0).abs() < 0.01 { 20.0 } else { 0.0 });
        let [pushed, later] = [90 * 20..95 * 20, 150 * 20..means.len()].map(|over| error(&means[over]));
        assert!(pushed > 5.0 && later < 0.5, "{pushed} {later}");
    }

    #[test]
    fn flat_map_asks_for_no_large_speeds() {
        let flat = inverse(&DMatrix::from_row_slice(2, 2, &[-1.0, -1.0, -0.001, 0.001]));
        assert!(flat.iter().all(|rpm| rpm.abs() < STEEPEST_RPM), "{flat}");
    }
}
