//! A recording of a motion by a sensor, through the filter of the firmware.

use super::TICK_S;
use super::motion::Motion;
use super::part::Part;
use super::random::Random;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Quaternion, Telemetry, Vector};
use biflag_log::{CalibrationMeta, ClockMeta, End, Identity, LevelMeta, MeasuredSensorMeta, Origin, Summary};
use firmware::attitude::{Attitude, Gains};
use host::plan::Phases;
use host::trial::{Collector, Data, Records, Want};
use nalgebra::{UnitQuaternion, Vector3};
use std::ops::Range;

/// Noise of the gyroscope and of the accelerometer in a reading: 0.005 °/s/√Hz and 400 µg/√Hz, one-sided, up to 100 Hz.
const GYRO_DPS: f64 = 0.05;
const ACCEL_G: f64 = 0.004;

/// A rig with its sensor.
#[derive(Clone, Debug)]
pub struct Rig {
    /// The sensor.
    pub part: Part,
    /// What was measured of it.
    pub measured: Option<MeasuredSensorMeta>,
    /// Time since the end of an earlier run at which the calibration begins, s; infinite for a robot at rest.
    pub late_s: f64,
}

/// A recorded trial.
#[derive(Debug)]
pub struct Recording {
    /// The log.
    pub data: Data,
    /// Time on the board's clock, and true yaw, pitch and roll in degrees, over the run.
    truth: Vec<(f64, [f64; 3])>,
}

impl Recording {
    /// Returns the mean of the true yaw, pitch and roll over a time of the log, degrees.
    pub fn truth_deg(&self, over: &Range<f64>) -> [f64; 3] {
        let inside: Vec<_> = self.truth.iter().filter(|(time, _)| over.contains(time)).collect();
        [0, 1, 2].map(|k| inside.iter().map(|(_, angles)| angles[k]).sum::<f64>() / inside.len() as f64)
    }
}

impl Rig {
    /// Records a motion.
    pub fn record(&self, motion: &Motion, random: &mut Random) -> Recording {
        let part = &self.part;
        let Phases { calibrate_s, run_s, decay_s, .. } = motion.phases;
        let mut noise = |sd: f64| Vector3::from_fn(|_, _| sd * random.normal());
        let (mut attitude, mut collector) = (Attitude::default(), Collector::new(Want::default(), 2));
        let gains = Gains { kp: 1.0, ki: 0.0 };
        let (mut bias, mut calibrated) = (noise(2.0), Vector3::zeros());
        let start_s = motion.start_s();
        let ticks = ((run_s + decay_s - start_s) / TICK_S) as usize;
        let calibration = (calibrate_s / TICK_S) as usize;
        let body = |time: f64| {
            let [yaw, pitch, roll] = motion.at(time, self.late_s);
            UnitQuaternion::from_euler_angles(roll, pitch, yaw)
        };
        let (mut before, mut sums, mut forces) = (body(start_s), Vector3::zeros(), Vec::new());
        let mut flicker = [0.0; 4];
        let mut truth = Vec::new();
        collector.event(0.0, Kind::Phase, "calibrate");
        for tick in 0..ticks {
            // The motors follow the board's clock, and so does the motion; the sensor sees it in true time.
            let clock_s = (tick + 1) as f64 * TICK_S;
            let time_s = start_s + clock_s;
            let now = body(time_s);
            let warm = |t: f64| part.warming_c * (1.0 - (-(t - start_s) / 150.0).exp());
            bias += noise(1e-4 * TICK_S.sqrt());
            // Flicker: walks of several correlation times about one axis.
            for (k, walk) in flicker.iter_mut().enumerate() {
                let share = TICK_S / 4f64.powi(k as i32 + 1);
                *walk += -share * *walk + part.flicker_dps * (2.0 * share).sqrt() * noise(1.0).x;
            }
            let up = now.inverse() * Vector3::z();
            let rate = (before.inverse() * now).scaled_axis() / (TICK_S / (1.0 + part.clock));
            let to_sensor = part.mounting.inverse();
            let drift = part.bias_dps_per_c * warm(time_s) + part.flicker * flicker.iter().sum::<f64>();
            let seen_up = to_sensor * up;
            let rate_dps =
                part.gyro * (to_sensor * rate).map(f64::to_degrees) + part.gyro_g_dps * seen_up + bias + drift;
            let rate_dps = (rate_dps + noise(GYRO_DPS)).map(|rate| (rate * 131.0).round() / 131.0);
            let force_g = part.accel * seen_up + part.accel_offset_g + noise(ACCEL_G);
            before = now;
            if tick < calibration {
                sums += rate_dps;
                if tick + 1 == calibration {
                    calibrated = sums / calibration as f64;
                    collector.event(clock_s, Kind::Calibration, "");
                    collector.event(clock_s, Kind::Phase, "preroll");
                }
            }
            let turn = (rate_dps - calibrated) * (0.5 * TICK_S).to_radians();
            attitude.update(
                turn.map(|half| half as f32).into(),
                force_g.map(|g| g as f32).into(),
                TICK_S as f32,
                gains,
            );
            if (-5.0..0.0).contains(&time_s) {
                forces.push(force_g);
            }
            for (name, from) in [("run", 0.0), ("decay", run_s)] {
                if time_s >= from && time_s - TICK_S < from {
                    collector.event(clock_s, Kind::Phase, name);
                }
            }
            if (0.0..run_s).contains(&time_s) {
                truth.push((clock_s, motion.at(time_s, f64::INFINITY).map(f64::to_degrees)));
            }
            let [w, x, y, z] = attitude.quaternion().0.map(|part| f64::from(part.0) / 32768.0);
            let rate = rate_dps - calibrated;
            let [motor1, motor2] = [0, 1].map(|motor| Some(motion.motor(motor, time_s)));
            collector.telemetry(&Telemetry {
                time_s: clock_s,
                imu_fresh: true,
                attitude: Some(Quaternion { w, x, y, z }),
                angular_velocity_dps: Some(Vector { x: rate.x, y: rate.y, z: rate.z }),
                temperature_c: 25.0 + warm(time_s - 3.0) + 0.08 * noise(1.0).x,
                motor1,
                motor2,
                ..Telemetry::default()
            });
        }
        collector.event(ticks as f64 * TICK_S, Kind::Phase, "end");
        let force = forces.iter().sum::<Vector3<f64>>() / forces.len() as f64;
        let up = force.normalize();
        let tilt_deg = up.xy().norm().atan2(up.z).to_degrees();
        let records = Records {
            identity: Some(Identity { format: 2, origin: Origin::Rig, ..Identity::default() }),
            trial: Some(motion.trial()),
            level: Some(LevelMeta { up: up.into(), force_g: force.norm(), tilt_deg, used: true }),
            clock: Some(ClockMeta {
                pings: 300,
                drift_ppm: part.clock * 1e6,
                residual_us: 300.0,
                ..ClockMeta::default()
            }),
            summary: Some(Summary { end: End::Complete, ..Summary::default() }),
            calibration: Some(CalibrationMeta { still: true, ..CalibrationMeta::default() }),
            measured_sensor: self.measured.clone(),
            ..Records::default()
        };
        Recording { data: collector.finish("recording".as_ref(), records), truth }
    }
}
