//! The latest figures of a running trial, for the terminal.

use nalgebra::UnitQuaternion;
use protocol::Telemetry;
use protocol::units::CentiRpm;
use std::fmt;
use study::attitude::Unwrap;
use study::text::decimal;

/// The latest figures of a running trial. They differ from the trial's final angles, because the drift of the yaw is
/// not known before the end.
#[derive(Debug, Default)]
pub(super) struct Readout {
    /// The sensor's WHO_AM_I.
    imu_id: u8,
    /// Yaw, pitch and roll, degrees, and their frame.
    latest: Option<([f64; 3], Telemetry)>,
    unwrap: Unwrap,
    zero_deg: f64,
    lost: u64,
}

impl Readout {
    pub(super) fn new(imu_id: u8) -> Self {
        Self { imu_id, ..Self::default() }
    }

    /// Adds a frame: its attitude, levelled if the vertical is known, and the number of frames lost so far.
    pub(super) fn frame(&mut self, attitude: &UnitQuaternion<f64>, telemetry: &Telemetry, lost: u64) {
        self.latest = Some((self.unwrap.angles_deg(attitude), *telemetry));
        self.lost = lost;
    }

    /// Returns the latest yaw since its zero, pitch and roll, degrees.
    pub(super) fn angles_deg(&self) -> [f64; 3] {
        let [yaw_deg, pitch_deg, roll_deg] = self.latest.map_or([0.0; 3], |(angles_deg, _)| angles_deg);
        [yaw_deg - self.zero_deg, pitch_deg, roll_deg]
    }

    /// Makes the latest yaw the zero of later ones.
    pub(super) fn zero_yaw(&mut self) {
        self.zero_deg = self.latest.map_or(0.0, |(angles_deg, _)| angles_deg[0]);
    }
}

/// Formats the figures; empty without a frame.
impl fmt::Display for Readout {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Some((_, telemetry)) = &self.latest else { return Ok(()) };
        for (name, angle) in ["yaw", "pitch", "roll"].into_iter().zip(self.angles_deg()) {
            write!(f, "{name} {:>6}°  ", decimal(angle, 1))?;
        }
        for (measured, target) in telemetry.speed.iter().zip(telemetry.target) {
            if *measured != CentiRpm::UNKNOWN {
                write!(f, "{:>5} of ", decimal(measured.rpm(), 1))?;
            }
            write!(f, "{} rpm  ", decimal(target.rpm(), 0))?;
        }
        let celsius = telemetry.temperature.celsius(self.imu_id);
        if celsius.is_finite() {
            write!(f, "{celsius:.1} °C  ")?;
        }
        write!(f, "{} lost", self.lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::GENUINE_IMU_ID;
    use protocol::units::{CentiRpm, TemperatureCounts};

    #[test]
    fn the_yaw_is_relative_to_the_zero_and_unwrapped() {
        let mut readout = Readout::new(GENUINE_IMU_ID);
        assert_eq!(readout.to_string(), "");
        let telemetry = Telemetry {
            speed: [CentiRpm(5010), CentiRpm(-990)],
            target: [CentiRpm(5000), CentiRpm(-1000)],
            // 36.53 °C is zero counts (MPU-6000A register map, section 4.18).
            temperature: TemperatureCounts(0),
            ..Telemetry::default()
        };
        let turned = |yaw_deg: f64| UnitQuaternion::from_euler_angles(0.0, 0.1_f64.to_radians(), yaw_deg.to_radians());
        readout.frame(&turned(170.0), &telemetry, 0);
        readout.zero_yaw();
        readout.frame(&turned(-170.0), &telemetry, 3);
        assert_eq!(
            readout.to_string(),
            "yaw   20.0°  pitch    0.1°  roll    0.0°   50.1 of 50 rpm   -9.9 of -10 rpm  36.5 °C  3 lost"
        );
    }
}
