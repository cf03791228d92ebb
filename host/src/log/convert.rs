//! From what the board says to what the log holds.

use super::schema::biflag::{self, Counts, Motor, QuaternionQ15, Vector};
use super::schema::foxglove;
use super::writer::{CommandRecord, EventKind};
use crate::attitude::{Euler, Unwrap, rotation};
use protocol::frame::{MAX_FRAME, encode};
use protocol::units::{SensorCounts, TemperatureCounts};
use protocol::{Calibration, Fault, Request, Settings, State, Telemetry};

/// Gives telemetry its units.
#[derive(Debug)]
pub(crate) struct Converter {
    settings: Settings,
    yaw: Unwrap,
}

impl Converter {
    pub fn new(settings: Settings) -> Self {
        Self { settings, yaw: Unwrap::default() }
    }

    /// The bias of a calibration comes into force where the sensor lay still.
    pub fn calibrate(&mut self, calibration: &Calibration) {
        if calibration.still {
            self.settings.gyro_bias = calibration.bias;
        }
    }

    pub fn telemetry(&mut self, frame: &Telemetry, board_time_us: u64, time_s: f64) -> biflag::Telemetry {
        let Settings { gyro_axes, accel_axes, gyro_range, accel_range, gyro_bias, .. } = self.settings;
        let per_dps = f64::from(gyro_range.counts_per_dps());
        let rates = [0, 1, 2].map(|i| (f64::from(frame.gyro[i].0) - f64::from(gyro_bias[i])) / per_dps);
        let parts = frame.attitude.to_f64();
        let euler = Euler::of(&rotation(parts));
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
            acceleration_mps2: Some(vector(accel_axes.apply(frame.accel.map(|counts| accel_range.mps2(counts))))),
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
