//! Converts the board's messages to the log's.

use super::schema::biflag::event::Kind;
use super::schema::biflag::{self, Counts, Motor, QuaternionQ15, Vector};
use nalgebra::{Quaternion, UnitQuaternion};
use protocol::frame::{MAX_FRAME, encode};
use protocol::units::SensorCounts;
use protocol::{Calibration, Command, Fault, Reply, Request, Settings, State, Telemetry};
use sim::body::attitude::euler_zyx;
use std::time::SystemTime;

/// A command that was sent, and its reply.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CommandRecord {
    /// Sequence number.
    pub seq: u8,
    /// The command.
    pub command: Command,
    /// Number of times it was sent.
    pub attempts: u32,
    /// The reply; `None` if none came in time.
    pub reply: Option<Reply>,
    /// Time of the first transmission.
    pub sent: SystemTime,
    /// Time of the reply, or of giving up.
    pub ended: SystemTime,
}

/// Converts the board's telemetry from counts to physical units.
#[derive(Clone, Copy, Debug)]
pub struct Converter {
    settings: Settings,
    /// The sensor's WHO_AM_I.
    imu_id: u8,
    /// The last yaw, for unwrapping the next one.
    yaw_deg: f64,
}

impl Converter {
    /// Creates a converter for a board with these settings and the sensor with this WHO_AM_I.
    pub fn new(settings: Settings, imu_id: u8) -> Self {
        Self { settings, imu_id, yaw_deg: 0.0 }
    }

    /// Adopts the bias of a calibration if the sensor lay still, as the board does.
    pub fn calibrate(&mut self, calibration: &Calibration) {
        if calibration.still {
            self.settings.gyro_bias = calibration.bias;
        }
    }

    /// Converts a frame to the log's message. `time_s` is the trial's clock.
    pub fn telemetry(&mut self, frame: &Telemetry, board_time_us: u64, time_s: f64) -> biflag::Telemetry {
        let Settings { gyro_axes, accel_axes, gyro_range, accel_range, gyro_bias, .. } = self.settings;
        let per_dps = f64::from(gyro_range.counts_per_dps());
        let rates = [0, 1, 2].map(|i| (f64::from(frame.gyro[i].0) - f64::from(gyro_bias[i])) / per_dps);
        let force = accel_axes.apply(frame.accel.map(|counts| accel_range.mps2(counts)));
        let [w, x, y, z] = frame.attitude.to_f64();
        let attitude = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let [yaw, pitch, roll] = euler_zyx(&attitude);
        let yaw_deg = yaw.to_degrees();
        self.yaw_deg = yaw_deg + 360.0 * ((self.yaw_deg - yaw_deg) / 360.0).round();
        let [motor1, motor2] = [0, 1].map(|i| self.motor(frame, i));
        let [w, x, y, z] = frame.attitude.0.map(|part| i32::from(part.0));
        biflag::Telemetry {
            seq: frame.seq.0.into(),
            board_time_us,
            time_s,
            attitude: Some(biflag::Quaternion { w: attitude.w, x: attitude.i, y: attitude.j, z: attitude.k }),
            attitude_q15: Some(QuaternionQ15 { w, x, y, z }),
            yaw_deg: self.yaw_deg,
            pitch_deg: pitch.to_degrees(),
            roll_deg: roll.to_degrees(),
            angular_velocity_dps: Some(vector(gyro_axes.apply(rates))),
            acceleration_mps2: Some(vector(force)),
            gyro_counts: Some(counts(frame.gyro)),
            accel_counts: Some(counts(frame.accel)),
            temperature_c: frame.temperature.celsius(self.imu_id),
            temperature_counts: frame.temperature.0.into(),
            motor1: Some(motor1),
            motor2: Some(motor2),
            state: state(frame.state).into(),
            fault: fault(frame.fault).into(),
            imu_fresh: frame.imu_fresh,
            unsent: frame.unsent.0.into(),
            imu_errors: frame.imu_errors.0.into(),
            bad_frames: frame.bad_frames.0.into(),
            missed_ticks: frame.missed_ticks.0.into(),
            clipped: frame.clipped.0.into(),
            glitches: frame.glitches.0.into(),
            supply_v: frame.supply.volts(),
            phase: frame.phase.into(),
        }
    }

    fn motor(&self, frame: &Telemetry, i: usize) -> Motor {
        let speed_rpm = frame.speed[i].rpm();
        let turns = f64::from(frame.encoder[i].0) / f64::from(self.settings.counts_per_turn);
        Motor {
            target_rpm: frame.target[i].rpm(),
            speed_rpm,
            duty: frame.duty[i].0.into(),
            encoder_counts: frame.encoder[i].0,
            turns: if speed_rpm.is_nan() { f64::NAN } else { turns },
        }
    }
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

/// Converts an event to the log's message.
pub fn event(kind: Kind, text: &str) -> biflag::Event {
    biflag::Event { kind: kind.into(), text: text.to_owned() }
}

/// Returns the log's value of the same name.
macro_rules! by_name {
    ($value:expr, $kind:ident: $($name:ident),* $(,)?) => {
        match $value { $($kind::$name => biflag::$kind::$name),* }
    };
}

fn state(state: State) -> biflag::State {
    by_name!(state, State: Idle, Calibrating, Running, Driving, Faulted)
}

fn fault(fault: Fault) -> biflag::Fault {
    by_name!(fault, Fault:
        None, LinkLost, Hang, Panic, ImuSilent, ImuBusStuck, ImuFrozen, ImuLostConfig, SupplyLow, Motor1Stalled, Motor2Stalled,
        Motor1Runaway, Motor2Runaway, Motor1Overloaded, Motor2Overloaded, Encoder1Failed, Encoder2Failed, Encoder1Noisy,
        Encoder2Noisy)
}

pub(super) fn vector([x, y, z]: [f64; 3]) -> Vector {
    Vector { x, y, z }
}

fn counts(counts: [SensorCounts; 3]) -> Counts {
    let [x, y, z] = counts.map(|axis| i32::from(axis.0));
    Counts { x, y, z }
}
