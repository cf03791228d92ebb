//! The board of a modelled robot: readings of an ideal sensor and ideal encoders, in the board's counts.
//!
//! Speeds are the shafts' speeds, duty cycles are zero because the model has no motor drive, and no reading is late or
//! lost. The sensor is on the robot's axis at the bottom of the base and measures gravity and its own acceleration.

use crate::plan::Setpoint;
use nalgebra::Vector3;
use protocol::units::{CentiRpm, Count, EncoderCounts, Micros, Quaternion, SensorCounts, TemperatureCounts};
use protocol::{GENUINE_IMU_ID, Info, Settings, Telemetry};
use sim::body::imu::specific_force;
use sim::params::Robot;
use sim::trial::sample::Sample;
use std::f64::consts::{PI, TAU};

/// Temperature of a fluid specified by its viscosity only, °C.
const ROOM_C: f64 = 20.0;

/// The sensor, the encoders and the clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct IdealBoard {
    settings: Settings,
    /// Position of the sensor, body axes, m.
    offset_m: Vector3<f64>,
    gravity: f64,
    temperature: TemperatureCounts,
}

impl IdealBoard {
    pub fn new(robot: &Robot, settings: Settings) -> Self {
        let celsius = robot.fluid.glycerol.map_or(ROOM_C, |mixture| mixture.temperature_c);
        Self {
            settings,
            offset_m: Vector3::new(0.0, 0.0, -robot.base.height_m),
            gravity: robot.base.gravity_m_s2,
            temperature: TemperatureCounts::from_celsius(celsius),
        }
    }

    /// Returns the reply to a greeting.
    pub fn info(&self) -> Info {
        Info {
            protocol: protocol::VERSION,
            board_id: self.settings.board_id,
            imu_id: GENUINE_IMU_ID,
            gyro_range: self.settings.gyro_range,
            accel_range: self.settings.accel_range,
            ..Info::default()
        }
    }

    /// Returns the board's clock at a time of the trial.
    pub fn clock_us(time_s: f64) -> u64 {
        (time_s * 1e6).round() as u64
    }

    /// Returns the frame for a sample. `angular_acceleration` is in body axes, rad/s².
    pub fn telemetry(
        &self,
        index: u64,
        sample: &Sample,
        angular_acceleration: Vector3<f64>,
        setpoint: Setpoint,
    ) -> Telemetry {
        let rate = Vector3::from(sample.rate_rad_s);
        let up = crate::attitude::rotation(sample.attitude).inverse() * Vector3::z();
        let per_dps = f64::from(self.settings.gyro_range.counts_per_dps());
        let per_mps2 = 1.0 / self.settings.accel_range.mps2(SensorCounts(1));
        let force: [f64; 3] = specific_force(self.offset_m, rate, angular_acceleration, -up * self.gravity).into();
        let per_turn = f64::from(self.settings.counts_per_turn);
        Telemetry {
            seq: Count(index as u16),
            time: Micros(Self::clock_us(sample.time_s) as u32),
            attitude: Quaternion::from_f64(sample.attitude),
            gyro: sample.rate_rad_s.map(|rate| counts(rate.to_degrees() * per_dps)),
            accel: force.map(|force| counts(force * per_mps2)),
            temperature: self.temperature,
            target: setpoint.target,
            speed: sample.motor_speed_rad_s.map(|speed| CentiRpm::from_rpm(speed * 30.0 / PI)),
            encoder: sample.motor_angle_rad.map(|angle| EncoderCounts((angle / TAU * per_turn).round() as i32)),
            state: setpoint.state,
            imu_fresh: true,
            ..Telemetry::default()
        }
    }
}

/// Rounds to the nearest count, saturating like the sensor.
fn counts(reading: f64) -> SensorCounts {
    SensorCounts(reading.round() as i16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::State;
    use protocol::units::{AccelRange, GyroRange};
    use sim::body::closure::Closure;
    use sim::trial::profile::SpeedProfile;
    use sim::trial::{Options, Trial};

    fn sample() -> Sample {
        let profile = SpeedProfile::constant([10.0, 0.0], 1.0).unwrap();
        let mut trial = Trial::new(&Robot::published(), Closure::Full, profile, Options::default()).unwrap();
        trial.next().unwrap().unwrap()
    }

    #[test]
    fn readings_of_an_upright_and_a_leaning_robot() {
        let settings = Settings { accel_range: AccelRange::G8, gyro_range: GyroRange::Dps500, ..Settings::DEFAULT };
        let board = IdealBoard::new(&Robot::published(), settings);
        let setpoint = Setpoint { state: State::Running, target: [CentiRpm(1000), CentiRpm(0)] };
        let upright = board.telemetry(7, &sample(), Vector3::zeros(), setpoint);
        assert_eq!(upright.accel, [0, 0, 4096].map(SensorCounts));
        assert_eq!((upright.seq, upright.state, upright.imu_fresh), (Count(7), State::Running, true));
        assert!((upright.temperature.celsius(GENUINE_IMU_ID) - 20.0).abs() < 0.01);

        let half = 0.5 * 30_f64.to_radians();
        let leaning = Sample {
            attitude: [half.cos(), 0.0, half.sin(), 0.0],
            rate_rad_s: [0.0, 0.0, 10_f64.to_radians()],
            motor_angle_rad: [-TAU, 0.5 * TAU],
            motor_speed_rad_s: [PI, -PI],
            time_s: 1.25,
            ..sample()
        };
        // Pitched by 30 degrees, body x points down by half, and the upward force of the joint lies along -x.
        let frame = board.telemetry(0, &leaning, Vector3::new(0.0, 100.0, 0.0), setpoint);
        let tangential = -100.0 * 0.0375 / AccelRange::G8.mps2(SensorCounts(1));
        assert!((f64::from(frame.accel[0].0) - (-2048.0 + tangential)).abs() < 1.0, "{:?}", frame.accel);
        assert_eq!(frame.gyro, [0, 0, 655].map(SensorCounts));
        assert_eq!(frame.encoder, [-602, 301].map(EncoderCounts));
        assert_eq!(frame.speed, [3000, -3000].map(CentiRpm));
        assert_eq!(frame.time, Micros(1_250_000));
    }
}
