//! A recording of a motion by a sensor, through the filter of the firmware.

use super::TICK_S;
use super::motion::Motion;
use super::part::{Part, Powered, Reading};
use super::random::Random;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::schema::biflag::{Quaternion, Telemetry, Vector};
use biflag_log::{CalibrationMeta, ClockMeta, End, Identity, LevelMeta, MeasuredSensorMeta, Origin, RestMeta, Summary};
use firmware::attitude::{Attitude, Gains};
use host::attitude::Still;
use host::plan::Phases;
use host::trial::{Collector, Data, Records, Want};
use nalgebra::{UnitQuaternion, Vector3};
use std::ops::Range;

/// Number of readings after which `record` judges again whether the robot is still: half a second.
const CHECK: usize = 100;

/// Relative standard uncertainty of the board's clock rate from pings.
pub(super) const CLOCK_U: f64 = 1e-5;

/// A rig with its sensor.
#[derive(Clone, Debug)]
pub struct Rig {
    /// The sensor.
    pub part: Part,
    /// Its measured errors.
    pub measured: Option<MeasuredSensorMeta>,
    /// The phases of its trials.
    pub phases: Phases,
    /// How its trials begin.
    pub start: Start,
}

/// How a trial begins.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Start {
    /// The robot is at rest.
    AtRest,
    /// An earlier run like this one ended shortly before.
    Late {
        /// Time since that end, s.
        late_s: f64,
        /// Whether the trial begins with a wait until the robot is still.
        waits: bool,
    },
}

/// A recorded trial.
#[derive(Debug)]
pub struct Recording {
    /// The log.
    pub data: Data,
    /// Time of the log, and true yaw, pitch and roll in degrees, over the run.
    truth: Vec<(f64, [f64; 3])>,
}

impl Recording {
    /// Returns the mean of the true yaw, pitch and roll over a time of the log, degrees.
    pub fn truth_deg(&self, over: &Range<f64>) -> [f64; 3] {
        let inside: Vec<_> = self.truth.iter().filter(|(time, _)| over.contains(time)).collect();
        [0, 1, 2].map(|k| inside.iter().map(|(_, angles)| angles[k]).sum::<f64>() / inside.len() as f64)
    }
}

/// Returns the attitude at yaw, pitch and roll, radians.
fn body([yaw, pitch, roll]: [f64; 3]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(roll, pitch, yaw)
}

impl Rig {
    /// Records a motion.
    pub fn record(&self, motion: &Motion, random: &mut Random) -> Recording {
        let Phases { calibrate_s, preroll_s, run_s, decay_s, .. } = self.phases;
        let clock = self.part.clock + CLOCK_U * random.normal();
        let mut powered = Powered::new(&self.part, random);
        let (mut attitude, mut collector) = (Attitude::default(), Collector::new(Want::default(), 2));
        let gains = Gains { kp: 1.0, ki: 0.0 };
        let start_s = -calibrate_s - preroll_s;
        let ticks = ((run_s + decay_s - start_s) / TICK_S) as usize;
        let calibration = (calibrate_s / TICK_S) as usize;
        let rest = self.wait(motion, &mut powered);
        let late_s = match self.start {
            Start::AtRest => f64::INFINITY,
            Start::Late { late_s, .. } => late_s + powered.time_s(),
        };
        // The rest of the earlier motion is added.
        let body = |time_s: f64| {
            let (own, left) = (motion.at(time_s), motion.left(late_s + time_s - start_s));
            body([0, 1, 2].map(|k| own[k] + left[k]))
        };
        let begun_s = powered.time_s();
        let mut before_s = start_s;
        let (mut before, mut sums, mut forces) = (body(start_s), Vector3::zeros(), Vec::new());
        let (mut calibrated, mut truth) = (Vector3::zeros(), Vec::new());
        collector.event(0.0, Kind::Phase, "calibrate");
        for tick in 0..ticks {
            // The motion is in true time, the log in the board's.
            let time_s = start_s + (powered.time_s() + powered.tick_s() - begun_s);
            let clock_s = (tick + 1) as f64 * TICK_S;
            let now = body(time_s);
            let Reading { rate_dps, force_g, temperature_c } = powered.read(before, now);
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
            attitude.update(turn.map(|half| half as f32).into(), force_g.map(|g| g as f32).into(), 1, gains);
            if (-5.0..0.0).contains(&time_s) {
                forces.push(force_g);
            }
            let ended_s = std::mem::replace(&mut before_s, time_s);
            for (name, from) in [("run", 0.0), ("decay", run_s)] {
                if ended_s < from && from <= time_s {
                    collector.event(clock_s, Kind::Phase, name);
                }
            }
            if (0.0..run_s).contains(&time_s) {
                truth.push((clock_s / (1.0 + clock), motion.at(time_s).map(f64::to_degrees)));
            }
            let [w, x, y, z] = attitude.quaternion().0.map(|part| f64::from(part.0) / 32768.0);
            let rate = rate_dps - calibrated;
            let [motor1, motor2] = [0, 1].map(|motor| Some(motion.motor(motor, time_s)));
            collector.telemetry(&Telemetry {
                time_s: clock_s,
                imu_fresh: true,
                attitude: Some(Quaternion { w, x, y, z }),
                angular_velocity_dps: Some(Vector { x: rate.x, y: rate.y, z: rate.z }),
                temperature_c,
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
            trial: Some(motion.trial(&self.phases)),
            rest,
            level: Some(LevelMeta { up: up.into(), force_g: force.norm(), tilt_deg, used: true }),
            clock: Some(ClockMeta { pings: 300, drift_ppm: clock * 1e6, residual_us: 300.0, ..ClockMeta::default() }),
            summary: Some(Summary { end: End::Complete, ..Summary::default() }),
            calibration: Some(CalibrationMeta { still: true, ..CalibrationMeta::default() }),
            measured_sensor: self.measured.clone(),
            ..Records::default()
        };
        Recording { data: collector.finish("recording".as_ref(), records), truth }
    }

    /// Waits until the robot is still. Returns what `record` writes into the log; `None` without a wait, or if the robot was
    /// not still.
    fn wait(&self, motion: &Motion, powered: &mut Powered) -> Option<RestMeta> {
        let Start::Late { late_s, waits: true } = self.start else { return None };
        let (mut still, mut before) = (Still::default(), body(motion.left(late_s)));
        for tick in 1.. {
            let passed_s = powered.time_s() + powered.tick_s();
            if passed_s > self.phases.rest_at_most_s {
                break;
            }
            let now = body(motion.left(late_s + passed_s));
            let Reading { rate_dps, force_g, .. } = powered.read(before, now);
            before = now;
            still.push(tick as f64 * TICK_S, rate_dps.z, force_g.into());
            let motion = if tick % CHECK == 0 { still.motion() } else { None };
            if let Some(motion) = motion.filter(|motion| motion.is_still()) {
                let (yaw_dps, tilt_dps) = (Some(motion.yaw_dps), Some(motion.tilt_dps));
                return Some(RestMeta { still: true, yaw_dps, tilt_dps, ..RestMeta::default() });
            }
        }
        None
    }
}
