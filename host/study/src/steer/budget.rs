//! The uncertainty of the held yaw, before the trial: only the gyroscope measures the yaw, and only rest shows its
//! drift.
//!
//! The terms are the relevant ones of a trial's budget ([`crate::trial::Budget`]), for a robot that leans by its mean
//! tilt from the start:
//!
//! | term | standard uncertainty after the time t |
//! | --- | --- |
//! | scale | u(scale) of the yaw |
//! | gravity | u(sensitivity to gravity) sin(tilt) t |
//! | bias | N t √(6/5) / √rest, the error of a slope of the yaw over the rest, and of the bias's walk b t √(t/3) |
//! | warming | u(bias per degree Celsius) r (rest + t)/2 t, for a base that warms at the rate r ([`WARMING_C_PER_S`]) |
//! | noise | N √t, the angle random walk |

use crate::attitude::{ANGLE_WALK, WARMING_DPS_PER_C};
use crate::sensor::Sensor;
use crate::statistics::student_95;
use crate::text::decimal;
use sim::functions::{hypot, sin};
use std::fmt;

/// Assumed rate at which the base warms in the first minutes of a run, °C/s: 2 °C in total with a time constant of 300
/// s. The resulting drift cannot be measured while the motors turn.
const WARMING_C_PER_S: f64 = 2.0 / 300.0;

/// Error of the yaw by its causes, 95 % uncertainties in degrees.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct YawError([(&'static str, f64); 5]);

/// Returns the error of a yaw held for `time_s` after a rest of `rest_s`, by a robot with this tilt.
pub fn yaw_error(sensor: &Sensor, [yaw_deg, tilt_deg]: [f64; 2], rest_s: f64, time_s: f64) -> YawError {
    let walk = sensor.angle_walk().map_or(ANGLE_WALK, |(walk, _)| walk);
    let gravity_dps = sensor.gyro_g_dps[2][0].u.max(sensor.gyro_g_dps[2][1].u) * sin(tilt_deg.to_radians());
    let slope = walk * (1.2 / rest_s).sqrt() * time_s;
    // The change of the mean bias since the rest.
    let change_dps = sensor.bias_noise[2].change_dps(&(0.0..rest_s), &(rest_s..rest_s + time_s));
    let u_deg = [
        ("scale", sensor.gyro_scale[2].u * yaw_deg.abs()),
        ("gravity", gravity_dps.abs() * time_s),
        ("bias", hypot(slope, change_dps * time_s)),
        ("warming", WARMING_DPS_PER_C * WARMING_C_PER_S * 0.5 * (rest_s + time_s) * time_s),
        ("noise", walk * time_s.sqrt()),
    ];
    YawError(u_deg.map(|(name, u_deg)| (name, student_95(f64::INFINITY) * u_deg)))
}

impl YawError {
    /// Returns the half width of the 95 % interval, degrees.
    pub fn uncertainty_deg(&self) -> f64 {
        self.0.into_iter().map(|(_, deg)| deg).fold(0.0, hypot)
    }
}

impl fmt::Display for YawError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let terms = self.0.map(|(name, deg)| format!("{name} {}°", decimal(deg, 1)));
        write!(f, "± {}° ({})", decimal(self.uncertainty_deg(), 1), terms.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_grows_with_time_and_with_the_yaw() {
        let sensor = Sensor::of_data_sheet();
        let error = |yaw_deg, time_s| yaw_error(&sensor, [yaw_deg, 6.0], 15.0, time_s);
        let after = |time_s| error(-67.0, time_s).uncertainty_deg();
        assert!(after(60.0) < after(120.0) && after(120.0) < after(600.0));
        assert!(error(0.0, 120.0).uncertainty_deg() < after(120.0));
        // 3 % / √3 of 67 degrees, twice.
        assert!((after(1.0) - 2.27).abs() < 0.05, "{}", after(1.0));
        assert_eq!(
            error(-67.0, 120.0).to_string(),
            "± 4.2° (scale 2.3°, gravity 1.4°, bias 0.8°, warming 3.2°, noise 0.1°)"
        );
    }
}
