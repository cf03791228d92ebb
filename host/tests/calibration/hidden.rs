//! A robot and a sensor whose parameters a fit does not know, and the trials that a board measures of them.

use biflag_log::schema::biflag::{self, event::Kind};
use biflag_log::{End, FORMAT, ModelMeta, Summary, TrialMeta};
use host::plan::FittedParameter;
use host::trial::{Collector, Data, Records, Want};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::trial::profile::{Phases, SpeedProfile};
use sim::trial::sample::Sample;
use sim::trial::{Options, Trial};
use std::f64::consts::TAU;

/// During the calibration phase the flagella sag to their equilibrium.
const PHASES: Phases = Phases { calibrate: 40.0, preroll: 20.0, run: 40.0, decay: 15.0, ramp: 0.25, reverse: None };
const RATE_HZ: f64 = 100.0;

/// A linear congruential generator (Knuth's MMIX): the same draws on every machine.
pub(super) struct Draw(pub u64);

impl Draw {
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a normal deviate of mean 0 and variance 1: a sum of twelve uniform ones.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.within(-0.5, 0.5)).sum()
    }
}

/// Systematic errors of a sensor.
pub(super) struct Part {
    gyro: Matrix3<f64>,
    /// Rate per standard gravity, °/s.
    gyro_g_dps: Matrix3<f64>,
    accel: Matrix3<f64>,
}

impl Part {
    fn ideal() -> Self {
        Self { gyro: Matrix3::identity(), gyro_g_dps: Matrix3::zeros(), accel: Matrix3::identity() }
    }

    /// Returns a part within the limits of PS-MPU-6000A revision 3.4, sections 6.1 and 6.2.
    pub fn typical(draw: &mut Draw) -> Self {
        let mut matrix = |diagonal: f64, others: f64| {
            Matrix3::from_fn(
                |i, j| if i == j { draw.within(-diagonal, diagonal) } else { draw.within(-others, others) },
            )
        };
        let (gyro, accel) = (Matrix3::identity() + matrix(0.03, 0.02), Matrix3::identity() + matrix(0.03, 0.02));
        Self { gyro, gyro_g_dps: matrix(0.1, 0.1), accel }
    }

    /// Returns the attitude by the board's filter from the readings of the part, whose calibration at rest has removed what
    /// gravity adds to the rates there.
    fn attitudes(&self, truth: &[UnitQuaternion<f64>], step_s: f64) -> Vec<UnitQuaternion<f64>> {
        const KP: f64 = 1.0;
        let up = |attitude: &UnitQuaternion<f64>| attitude.inverse() * Vector3::z();
        let rest = up(&truth[0]);
        let mut seen = UnitQuaternion::rotation_between(&(self.accel * rest), &Vector3::z()).unwrap() * truth[0];
        let mut all = vec![seen];
        for pair in truth.windows(2) {
            let rate = (pair[0].inverse() * pair[1]).scaled_axis() / step_s;
            let of_gravity = (self.gyro_g_dps * (up(&pair[1]) - rest)).map(f64::to_radians);
            let correction = (self.accel * up(&pair[1])).normalize().cross(&up(&seen)) * KP;
            seen *= UnitQuaternion::from_scaled_axis((self.gyro * rate + of_gravity + correction) * step_s);
            all.push(seen);
        }
        all
    }
}

/// The parameters that a fit must recover, and the sensor.
pub(super) struct Hidden {
    pub robot: Robot,
    pub mount_yaw_deg: f64,
    pub mount_tilt_deg: [f64; 2],
    pub part: Part,
    pub temperature_c: f64,
}

impl Default for Hidden {
    fn default() -> Self {
        Self {
            robot: Robot::published(),
            mount_yaw_deg: 0.0,
            mount_tilt_deg: [0.0; 2],
            part: Part::ideal(),
            temperature_c: 20.0,
        }
    }
}

impl Hidden {
    /// Draws each parameter up to 20 % from the published one.
    pub fn draw(draw: &mut Draw) -> Self {
        let mut robot = Robot::published();
        robot.joint.tether_full_nm_per_rad *= draw.within(0.8, 1.2);
        robot.base.mass_centre_below_joint_m *= draw.within(0.8, 1.2);
        robot.base.rotational_drag *= draw.within(0.8, 1.2);
        robot.fluid.viscosity_pa_s *= draw.within(0.8, 1.2);
        let mount_tilt_deg = [draw.within(-2.0, 2.0), draw.within(-2.0, 2.0)];
        Self { robot, mount_yaw_deg: draw.within(-5.0, 5.0), mount_tilt_deg, ..Self::default() }
    }

    pub fn value(&self, estimate: &FittedParameter) -> f64 {
        match estimate.name.as_str() {
            "tether" => self.robot.joint.tether_full_nm_per_rad,
            "righting" => self.robot.base.mass_centre_below_joint_m,
            "drag" => self.robot.base.rotational_drag,
            "viscosity" => self.robot.fluid.viscosity_pa_s,
            "mount-yaw" => self.mount_yaw_deg,
            other => panic!("{other} is not hidden"),
        }
    }

    /// Simulates a trial as measured by a board at 100 Hz.
    pub fn trial(&self, speeds: [f64; 2], draw: &mut Draw) -> Data {
        self.measured(speeds, &self.motion(speeds), draw)
    }

    /// Returns the motion of the robot from the pre-roll on, at 100 Hz.
    pub fn motion(&self, speeds: [f64; 2]) -> Vec<Sample> {
        let profile = SpeedProfile::phases(&PHASES, speeds).unwrap();
        let options = Options { rate_hz: RATE_HZ, shapes: false };
        let samples = Trial::new(&self.robot, Closure::Full, profile, options).unwrap().map(Result::unwrap);
        samples.filter(|sample| sample.time_s >= PHASES.calibrate).collect()
    }

    /// Returns the trial that a board measures of a motion. The gyroscope's bias after calibration, its walk and the
    /// random walk of the angle are those of an MPU6050; the noise of the tilts has a correlation time of a second,
    /// like the filter's.
    pub fn measured(&self, speeds: [f64; 2], motion: &[Sample], draw: &mut Draw) -> Data {
        let step = 1.0 / RATE_HZ;
        let deg = |deg: f64| deg.to_radians();
        let mount = UnitQuaternion::from_euler_angles(0.0, 0.0, deg(self.mount_yaw_deg));
        let (mut yaw, mut bias, mut tilt) = (draw.within(-180.0, 180.0), draw.within(-0.05, 0.05), [0.0; 2]);
        let noise = draw.within(0.03, 0.1);
        let mut collector = Collector::new(Want::default(), FORMAT);
        for (time_s, phase) in [(0.0, "preroll"), (20.0, "run"), (60.0, "decay"), (75.0, "end")] {
            collector.event(time_s, Kind::Phase, phase);
        }
        let truth = motion.iter().map(|sample| {
            let [w, x, y, z] = sample.attitude;
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z)) * mount
        });
        let attitudes = self.part.attitudes(&truth.collect::<Vec<_>>(), step);
        for (sample, attitude) in motion.iter().zip(attitudes) {
            bias += 2e-4 * step.sqrt() * draw.normal();
            yaw += bias * step + 0.005 * step.sqrt() * draw.normal();
            for tilt in &mut tilt {
                *tilt += -*tilt * step + noise * (2.0 * step).sqrt() * draw.normal();
            }
            let [pitch, roll] = [0, 1].map(|k| deg(tilt[k] + self.mount_tilt_deg[k]));
            let seen = UnitQuaternion::from_euler_angles(0.0, 0.0, deg(yaw))
                * attitude
                * UnitQuaternion::from_euler_angles(roll, pitch, 0.0);
            let q15 = |part: f64| (part * 32768.0).round() / 32768.0;
            let [w, x, y, z] = [seen.w, seen.i, seen.j, seen.k].map(q15);
            let [motor1, motor2] = sample.motor_angle_rad.map(|angle| {
                Some(biflag::Motor { turns: (angle / TAU * 1204.44).round() / 1204.44, ..biflag::Motor::default() })
            });
            collector.telemetry(&biflag::Telemetry {
                time_s: sample.time_s - PHASES.calibrate,
                attitude: Some(biflag::Quaternion { w, x, y, z }),
                temperature_c: self.temperature_c,
                imu_fresh: true,
                motor1,
                motor2,
                ..biflag::Telemetry::default()
            });
        }
        let [w1_rpm, w2_rpm] = speeds;
        let trial = TrialMeta {
            name: format!("{w1_rpm}, {w2_rpm} rpm"),
            w1_rpm,
            w2_rpm,
            calibrate_s: PHASES.calibrate,
            ..TrialMeta::default()
        };
        let summary = Some(Summary { end: End::Complete, ..Summary::default() });
        // A simulated robot, against which the model has no error.
        let model = Some(ModelMeta::default());
        let records = Records { trial: Some(trial), summary, model, ..Records::default() };
        collector.finish(format!("{speeds:?}").as_ref(), records)
    }
}
