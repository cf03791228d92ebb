//! From what the board says to what the log holds.

use super::schema::biflag::{self, Counts, Motor, QuaternionQ15, Vector};
use super::schema::foxglove;
use super::writer::{CommandRecord, EventKind};
use crate::attitude::{Euler, Unwrap, rotation};
use nalgebra::{UnitQuaternion, Vector3};
use protocol::frame::{MAX_FRAME, encode};
use protocol::units::{SensorCounts, TemperatureCounts};
use protocol::{Calibration, Fault, Request, Settings, State, Telemetry};

/// Gives telemetry its units, and takes from the attitude the tilt that the accelerometer's bias makes.
///
/// An accelerometer that is off by 20 mg tilts the attitude by a degree. The robot hangs upright while it is calibrated, so
/// what the accelerometer says of the vertical then is known to be wrong, and stays as wrong in body axes.
#[derive(Debug)]
pub(super) struct Converter {
    settings: Settings,
    yaw: Unwrap,
    /// Sum of the specific force during the calibration, m/s², body axes.
    rest: Vector3<f64>,
    /// From body axes by the accelerometer at rest to those of the upright robot.
    level: UnitQuaternion<f64>,
}

/// What the accelerometer said of the vertical while the robot hung at rest.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Level {
    /// The direction of up, body axes; zero where nothing was read.
    pub up: [f64; 3],
    /// How far it is off.
    pub tilt_deg: f64,
    /// Whether the attitude is corrected by it from here on.
    pub used: bool,
}

/// A larger tilt is no bias: the sensor is mounted otherwise than the settings say, or the robot does not hang upright.
const LARGEST_TILT_DEG: f64 = 10.0;

impl Converter {
    pub fn new(settings: Settings) -> Self {
        Self { settings, yaw: Unwrap::default(), rest: Vector3::zeros(), level: UnitQuaternion::identity() }
    }

    /// The bias of a calibration comes into force where the sensor lay still, and so does the level.
    pub fn calibrate(&mut self, calibration: &Calibration) -> Level {
        let up = std::mem::take(&mut self.rest).try_normalize(0.0).unwrap_or_default();
        let tilt_deg = up.xy().norm().atan2(up.z).to_degrees();
        let used = calibration.still && up != Vector3::zeros() && tilt_deg <= LARGEST_TILT_DEG;
        if calibration.still {
            self.settings.gyro_bias = calibration.bias;
        }
        if used {
            self.level = UnitQuaternion::rotation_between(&up, &Vector3::z()).unwrap_or_default();
        }
        Level { up: up.into(), tilt_deg, used }
    }

    pub fn telemetry(&mut self, frame: &Telemetry, board_time_us: u64, time_s: f64) -> biflag::Telemetry {
        let Settings { gyro_axes, accel_axes, gyro_range, accel_range, gyro_bias, .. } = self.settings;
        let per_dps = f64::from(gyro_range.counts_per_dps());
        let rates = [0, 1, 2].map(|i| (f64::from(frame.gyro[i].0) - f64::from(gyro_bias[i])) / per_dps);
        let force = accel_axes.apply(frame.accel.map(|counts| accel_range.mps2(counts)));
        if frame.state == State::Calibrating && frame.imu_fresh {
            self.rest += Vector3::from(force);
        }
        let attitude = rotation(frame.attitude.to_f64()) * self.level.inverse();
        let parts = [attitude.w, attitude.i, attitude.j, attitude.k];
        let euler = Euler::of(&attitude);
        let [motor1, motor2] = [0, 1].map(|i| self.motor(frame, i));
        let [w, x, y, z] = frame.attitude.0.map(|part| i32::from(part.0));
        biflag::Telemetry {
            seq: frame.seq.0.into(),
            board_time_us,
            time_s,
            attitude: Some(quaternion(parts)),
            attitude_q15: Some(QuaternionQ15 { w, x, y, z }),
            yaw_deg: self.yaw.next(euler.yaw_deg),
            pitch_deg: euler.pitch_deg,
            roll_deg: euler.roll_deg,
            angular_velocity_dps: Some(vector(gyro_axes.apply(rates))),
            acceleration_mps2: Some(vector(force)),
            gyro_counts: Some(counts(frame.gyro)),
            accel_counts: Some(counts(frame.accel)),
            temperature_c: frame.temperature.celsius(),
            temperature_counts: {
                let TemperatureCounts(counts) = frame.temperature;
                counts.into()
            },
            motor1: Some(motor1),
            motor2: Some(motor2),
            state: state(frame.state).into(),
            fault: fault(frame.fault).into(),
            imu_fresh: frame.imu_fresh,
            unsent: frame.unsent.0.into(),
            imu_errors: frame.imu_errors.0.into(),
            bad_frames: frame.bad_frames.0.into(),
            missed_ticks: frame.missed_ticks.0.into(),
        }
    }

    fn motor(&self, frame: &Telemetry, i: usize) -> Motor {
        Motor {
            target_rpm: frame.target[i].rpm(),
            speed_rpm: frame.speed[i].rpm(),
            duty: frame.duty[i].0.into(),
            encoder_counts: frame.encoder[i].0,
            turns: f64::from(frame.encoder[i].0) / f64::from(self.settings.counts_per_turn),
        }
    }
}

/// The attitude as viewers know it.
pub(super) fn frame_transform(attitude: &biflag::Quaternion, log_ns: u64) -> foxglove::FrameTransform {
    foxglove::FrameTransform {
        timestamp: Some(timestamp(log_ns)),
        parent_frame_id: "world".to_owned(),
        child_frame_id: "body".to_owned(),
        translation: Some(foxglove::Vector3::default()),
        rotation: Some(foxglove::Quaternion { x: attitude.x, y: attitude.y, z: attitude.z, w: attitude.w }),
    }
}

/// A time in ns since 1970 as viewers know it.
pub(crate) fn timestamp(ns: u64) -> prost_types::Timestamp {
    prost_types::Timestamp { seconds: (ns / 1_000_000_000).cast_signed(), nanos: (ns % 1_000_000_000) as i32 }
}

pub(super) fn command(record: &CommandRecord) -> biflag::Command {
    let request = Request { seq: record.seq, command: record.command };
    // Every message fits into the longest frame.
    let frame = encode(&request, &mut [0; MAX_FRAME]).map(|frame| frame.to_vec()).unwrap_or_default();
    biflag::Command {
        seq: record.seq.into(),
        command: format!("{:?}", record.command),
        frame,
        attempts: record.attempts,
        reply: record.reply.map(|reply| format!("{reply:?}")).unwrap_or_default(),
        round_trip_s: record.ended.duration_since(record.sent).unwrap_or_default().as_secs_f64(),
    }
}

pub(super) fn event_kind(kind: EventKind) -> biflag::event::Kind {
    use biflag::event::Kind;
    match kind {
        EventKind::Phase => Kind::Phase,
        EventKind::State => Kind::State,
        EventKind::Fault => Kind::Fault,
        EventKind::Retry => Kind::Retry,
        EventKind::Calibration => Kind::Calibration,
        EventKind::Clock => Kind::Clock,
        EventKind::Warning => Kind::Warning,
        EventKind::Note => Kind::Note,
    }
}

fn state(state: State) -> biflag::State {
    match state {
        State::Idle => biflag::State::Idle,
        State::Calibrating => biflag::State::Calibrating,
        State::Running => biflag::State::Running,
        State::Faulted => biflag::State::Faulted,
    }
}

fn fault(fault: Fault) -> biflag::Fault {
    match fault {
        Fault::None => biflag::Fault::None,
        Fault::LinkLost => biflag::Fault::LinkLost,
        Fault::Hang => biflag::Fault::Hang,
        Fault::Panic => biflag::Fault::Panic,
        Fault::ImuSilent => biflag::Fault::ImuSilent,
        Fault::ImuBusStuck => biflag::Fault::ImuBusStuck,
        Fault::ImuFrozen => biflag::Fault::ImuFrozen,
        Fault::Motor1Stalled => biflag::Fault::Motor1Stalled,
        Fault::Motor2Stalled => biflag::Fault::Motor2Stalled,
    }
}

fn quaternion([w, x, y, z]: [f64; 4]) -> biflag::Quaternion {
    biflag::Quaternion { w, x, y, z }
}

fn vector([x, y, z]: [f64; 3]) -> Vector {
    Vector { x, y, z }
}

fn counts(counts: [SensorCounts; 3]) -> Counts {
    let [x, y, z] = counts.map(|axis| i32::from(axis.0));
    Counts { x, y, z }
}

#[cfg(test)]
mod tests {
    use super::*;
    use protocol::units::Quaternion;

    /// A robot that hangs upright, pitches by 16° and turns, with an accelerometer that is off.
    #[test]
    fn the_accelerometers_bias_leaves_the_attitude_with_the_calibration() {
        let bias = Vector3::new(0.03, -0.02, 0.0);
        let g = f64::from(Settings::DEFAULT.accel_range.counts_per_g());
        // The filter follows the accelerometer.
        let frame = |truth: UnitQuaternion<f64>, state| {
            let force = truth.inverse() * Vector3::z() + bias;
            let level = UnitQuaternion::rotation_between(&force, &(truth.inverse() * Vector3::z())).unwrap();
            let q = truth * level;
            Telemetry {
                attitude: Quaternion::from_f64([q.w, q.i, q.j, q.k]),
                accel: [force.x, force.y, force.z].map(|part| SensorCounts((part * g).round() as i16)),
                imu_fresh: true,
                state,
                ..Telemetry::default()
            }
        };
        let mut converter = Converter::new(Settings::DEFAULT);
        let hanging = frame(UnitQuaternion::identity(), State::Calibrating);
        assert!((converter.telemetry(&hanging, 0, 0.0).pitch_deg + 1.72).abs() < 0.01);
        let level = converter.calibrate(&Calibration { still: true, ..Calibration::default() });
        assert!(level.used && (level.tilt_deg - 2.06).abs() < 0.02, "{level:?}");
        let still = converter.telemetry(&frame(UnitQuaternion::identity(), State::Idle), 0, 0.0);
        assert!(still.pitch_deg.abs() < 0.01 && still.roll_deg.abs() < 0.01, "{still:?}");
        let (yaw, pitch) = (40.0_f64, 16.0_f64);
        let truth = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw.to_radians())
            * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch.to_radians());
        let turned = converter.telemetry(&frame(truth, State::Running), 0, 0.0);
        assert!((turned.pitch_deg - 16.0).abs() < 0.1 && turned.roll_deg.abs() < 0.1, "{turned:?}");
        assert!((turned.yaw_deg - 40.0).abs() < 0.6, "{turned:?}");
    }

    #[test]
    fn a_sensor_that_moved_or_lies_on_its_side_levels_nothing() {
        for (still, accel) in [(false, [300, 0, 16384]), (true, [16384, 0, 300]), (true, [0, 0, -16384])] {
            let mut converter = Converter::new(Settings::DEFAULT);
            let accel = accel.map(SensorCounts);
            let frame = Telemetry { accel, imu_fresh: true, state: State::Calibrating, ..Telemetry::default() };
            converter.telemetry(&frame, 0, 0.0);
            assert!(!converter.calibrate(&Calibration { still, ..Calibration::default() }).used);
            assert_eq!(converter.telemetry(&frame, 0, 0.0).attitude, Some(quaternion([1.0, 0.0, 0.0, 0.0])));
        }
        let mut unread = Converter::new(Settings::DEFAULT);
        let level = unread.calibrate(&Calibration { still: true, ..Calibration::default() });
        assert_eq!(level, Level::default());
    }
}
