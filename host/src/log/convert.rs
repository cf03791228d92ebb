//! From what the board says to what the log holds.

use super::meta::LevelMeta;
use super::schema::biflag::{self, Counts, Motor, QuaternionQ15, Vector};
use super::schema::foxglove;
use crate::attitude::{Euler, Unwrap, rotation};
use nalgebra::{UnitQuaternion, Vector3};
use protocol::frame::{MAX_FRAME, encode};
use protocol::units::{STANDARD_GRAVITY_MPS2, SensorCounts, TemperatureCounts};
use protocol::{Calibration, Command, Fault, Reply, Request, Settings, State, TICK_HZ, Telemetry};
use std::collections::VecDeque;
use std::time::SystemTime;

/// A command as it went.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CommandRecord {
    /// Its sequence number.
    pub seq: u8,
    /// The command.
    pub command: Command,
    /// How often it was sent.
    pub attempts: u32,
    /// What was answered; `None`: nothing in time.
    pub reply: Option<Reply>,
    /// When it was sent first.
    pub sent: SystemTime,
    /// When it was answered or given up.
    pub ended: SystemTime,
}

/// What an event is about.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum EventKind {
    /// A phase begins; the text is its name: `calibrate`, `preroll`, `run`, `decay`, `end`.
    Phase,
    /// The board's state changed.
    State,
    /// A fault was latched or cleared.
    Fault,
    /// A request was sent again.
    Retry,
    /// The gyroscope was calibrated.
    Calibration,
    /// The clocks were compared.
    Clock,
    /// Something that whoever reads the log should know.
    Warning,
    /// Anything else.
    Note,
}

/// Gives telemetry its units, and takes from the attitude the tilt that the accelerometer's bias makes.
///
/// An accelerometer that is off by 20 mg tilts the attitude by a degree. The robot hangs upright while it is still, so what
/// the accelerometer says of the vertical then is known to be wrong, and stays as wrong in body axes. The attitude is
/// corrected about a horizontal axis, as the board's filter is misled about one: yaw comes from the gyroscope alone.
///
/// The filter follows the accelerometer with a time constant of 1/kp, and the gyroscope meanwhile: while the robot turns, the
/// filter still leans to where the bias pointed in the world a second ago. So the bias goes through the same low-pass.
#[derive(Debug)]
pub(crate) struct Converter {
    settings: Settings,
    yaw: Unwrap,
    /// Specific force since the motors last turned, m/s², body axes; the last [`REST_FRAMES`].
    rest: VecDeque<Vector3<f64>>,
    level: Option<Level>,
}

/// A level in force.
#[derive(Debug)]
struct Level {
    /// Bias of the accelerometer, g, body axes.
    bias: Vector3<f64>,
    /// Where it has pointed as the filter knows it, world axes, and when that was; `None` before the first frame.
    followed: Option<(f64, Vector3<f64>)>,
}

impl Level {
    /// An attitude of this time, levelled. `gain`: of the board's filter, 1/s.
    fn levelled(&mut self, attitude: UnitQuaternion<f64>, time_s: f64, gain: f64) -> UnitQuaternion<f64> {
        let now = attitude * self.bias;
        let bias = match self.followed {
            Some((before_s, bias)) => bias + (now - bias) * (1.0 - (-gain * (time_s - before_s).max(0.0)).exp()),
            None => now,
        };
        self.followed = Some((time_s, bias));
        LevelMeta::without(attitude, attitude.inverse() * bias)
    }
}

/// Frames that tell how the robot hangs: five seconds at the board's full rate.
const REST_FRAMES: usize = 5 * TICK_HZ as usize;

/// Fewer tell nothing.
const LEAST_FRAMES: usize = REST_FRAMES / 5;

/// A larger tilt is no bias: the sensor is mounted otherwise than the settings say, or the robot does not hang upright.
const LARGEST_TILT_DEG: f64 = 10.0;

impl Converter {
    pub fn new(settings: Settings) -> Self {
        Self { settings, yaw: Unwrap::default(), rest: VecDeque::new(), level: None }
    }

    /// The bias of a calibration comes into force where the sensor lay still.
    pub fn calibrate(&mut self, calibration: &Calibration) {
        if calibration.still {
            self.settings.gyro_bias = calibration.bias;
        }
    }

    /// The robot has hung at rest until now: what the accelerometer said of the vertical comes into force. `None` where it
    /// said too little.
    pub fn level(&mut self) -> Option<LevelMeta> {
        if self.rest.len() < LEAST_FRAMES {
            return None;
        }
        let force = self.rest.iter().sum::<Vector3<f64>>() / self.rest.len() as f64;
        let up = force.try_normalize(0.0)?;
        let tilt_deg = up.xy().norm().atan2(up.z).to_degrees();
        let force_g = force.norm() / STANDARD_GRAVITY_MPS2;
        let level = LevelMeta { up: up.into(), force_g, tilt_deg, used: tilt_deg <= LARGEST_TILT_DEG };
        self.level = level.used.then(|| Level { bias: level.bias_g(), followed: None });
        Some(level)
    }

    pub fn telemetry(&mut self, frame: &Telemetry, board_time_us: u64, time_s: f64) -> biflag::Telemetry {
        let Settings { gyro_axes, accel_axes, gyro_range, accel_range, gyro_bias, attitude_kp, .. } = self.settings;
        let per_dps = f64::from(gyro_range.counts_per_dps());
        let rates = [0, 1, 2].map(|i| (f64::from(frame.gyro[i].0) - f64::from(gyro_bias[i])) / per_dps);
        let force = accel_axes.apply(frame.accel.map(|counts| accel_range.mps2(counts)));
        if frame.state == State::Running {
            self.rest.clear();
        } else if frame.imu_fresh {
            self.rest.truncate(REST_FRAMES - 1);
            self.rest.push_front(Vector3::from(force));
        }
        let attitude = rotation(frame.attitude.to_f64());
        let attitude = match &mut self.level {
            Some(level) => level.levelled(attitude, time_s, attitude_kp.into()),
            None => attitude,
        };
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
pub(crate) fn frame_transform(attitude: &biflag::Quaternion, log_ns: u64) -> foxglove::FrameTransform {
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

/// An event as the log holds it.
pub(crate) fn event(kind: EventKind, text: &str) -> biflag::Event {
    use biflag::event::Kind;
    let kind = match kind {
        EventKind::Phase => Kind::Phase,
        EventKind::State => Kind::State,
        EventKind::Fault => Kind::Fault,
        EventKind::Retry => Kind::Retry,
        EventKind::Calibration => Kind::Calibration,
        EventKind::Clock => Kind::Clock,
        EventKind::Warning => Kind::Warning,
        EventKind::Note => Kind::Note,
    };
    biflag::Event { kind: kind.into(), text: text.to_owned() }
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

    const DT: f64 = 0.005;

    /// What a board says whose filter integrates the turn, and follows an accelerometer that is off.
    struct Board {
        truth: UnitQuaternion<f64>,
        filter: UnitQuaternion<f64>,
        bias: Vector3<f64>,
    }

    impl Board {
        fn turn(&mut self, turn: Vector3<f64>, state: State) -> Telemetry {
            let turn = UnitQuaternion::from_scaled_axis(turn);
            (self.truth, self.filter) = (self.truth * turn, self.filter * turn);
            let force = self.truth.inverse() * Vector3::z() + self.bias;
            let correction = force.normalize().cross(&(self.filter.inverse() * Vector3::z())) * DT;
            self.filter *= UnitQuaternion::from_scaled_axis(correction);
            let per_g = f64::from(Settings::DEFAULT.accel_range.counts_per_g());
            let q = self.filter;
            Telemetry {
                attitude: Quaternion::from_f64([q.w, q.i, q.j, q.k]),
                accel: [force.x, force.y, force.z].map(|part| SensorCounts((part * per_g).round() as i16)),
                imu_fresh: true,
                state,
                ..Telemetry::default()
            }
        }
    }

    #[test]
    fn the_accelerometers_bias_leaves_the_attitude_of_a_robot_that_hung_at_rest() {
        let still = UnitQuaternion::identity();
        let mut board = Board { truth: still, filter: still, bias: Vector3::new(0.03, -0.02, 0.01) };
        let mut converter = Converter::new(Settings::DEFAULT);
        assert_eq!(converter.level(), None, "nothing was read yet");
        let mut last = biflag::Telemetry::default();
        let mut time_s = 0.0;
        let mut tell = |converter: &mut Converter, frame: &Telemetry| {
            time_s += DT;
            converter.telemetry(frame, 0, time_s)
        };
        for _ in 0..2000 {
            last = tell(&mut converter, &board.turn(Vector3::zeros(), State::Idle));
        }
        assert!((last.pitch_deg + 1.70).abs() < 0.02, "{last:?}");
        let level = converter.level().unwrap();
        assert!(level.used && (level.tilt_deg - 2.04).abs() < 0.02, "{level:?}");
        last = tell(&mut converter, &board.turn(Vector3::zeros(), State::Idle));
        assert!(last.pitch_deg.abs() < 0.01 && last.roll_deg.abs() < 0.01, "{last:?}");
        let mut worst = 0f64;
        // It pitches by 16° and turns by 120° about the vertical, and stays so until the filter has settled.
        for i in 0..6000 {
            let rate = |from, to| if (from..to).contains(&i) { 1.0 / f64::from(to - from) } else { 0.0 };
            let vertical = board.truth.inverse() * Vector3::z() * (120_f64.to_radians() * rate(1000, 3000));
            let turn = Vector3::y() * (16_f64.to_radians() * rate(0, 1000)) + vertical;
            last = tell(&mut converter, &board.turn(turn, State::Running));
            let truth = Euler::of(&board.truth);
            worst = worst.max((last.pitch_deg - truth.pitch_deg).abs()).max((last.roll_deg - truth.roll_deg).abs());
        }
        assert!(worst < 0.05, "on the way, too: {worst}");
        let euler = Euler::of(&board.truth);
        assert!((euler.pitch_deg - 16.0).abs() < 1e-6 && (euler.yaw_deg - 120.0).abs() < 1e-6);
        assert!((last.pitch_deg - 16.0).abs() < 0.01 && last.roll_deg.abs() < 0.01, "{last:?}");
        assert!((last.yaw_deg - 120.0).abs() < 0.1, "{last:?}");
        assert_eq!(converter.level(), None, "the motors turn");
    }

    #[test]
    fn a_sensor_on_its_side_levels_nothing() {
        for accel in [[16384, 0, 300], [0, 0, -16384]] {
            let mut converter = Converter::new(Settings::DEFAULT);
            let frame = Telemetry { accel: accel.map(SensorCounts), imu_fresh: true, ..Telemetry::default() };
            for _ in 0..REST_FRAMES {
                converter.telemetry(&frame, 0, 0.0);
            }
            assert!(converter.level().is_some_and(|level| !level.used && level.tilt_deg > 80.0));
            assert_eq!(converter.telemetry(&frame, 0, 0.0).attitude, Some(quaternion([1.0, 0.0, 0.0, 0.0])));
        }
    }
}
