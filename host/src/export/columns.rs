//! The table that the telemetry makes.

use crate::log::Message;
use crate::log::schema::biflag::{Counts, Fault, Motor, Quaternion, State, Telemetry, Vector};
use std::fmt;

/// A column.
pub(super) struct Column {
    /// Its name, with the unit.
    pub name: &'static str,
    /// Its value in a row.
    pub cell: fn(&Message, &Telemetry) -> Cell,
}

/// A value.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Cell {
    Real(f64),
    Int(i64),
    Text(&'static str),
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // Nine decimals are finer than every sensor, and free of the noise of binary fractions.
            Self::Real(value) => write!(f, "{}", (value * 1e9).round() / 1e9),
            Self::Int(value) => write!(f, "{value}"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

macro_rules! columns {
    ($($name:literal: $kind:ident $value:expr;)*) => {
        /// Every column, in order.
        pub(super) const COLUMNS: &[Column] =
            &[$(Column { name: $name, cell: |message, telemetry| Cell::$kind(($value)(message, telemetry)) }),*];
    };
}

columns! {
    "time_s": Real |_, t: &Telemetry| t.time_s;
    "log_time_ns": Int |m: &Message, _| m.log_time_ns.cast_signed();
    "board_time_us": Int |_, t: &Telemetry| t.board_time_us.cast_signed();
    "seq": Int |_, t: &Telemetry| t.seq.into();
    "yaw_deg": Real |_, t: &Telemetry| t.yaw_deg;
    "pitch_deg": Real |_, t: &Telemetry| t.pitch_deg;
    "roll_deg": Real |_, t: &Telemetry| t.roll_deg;
    "q_w": Real |_, t| attitude(t).w;
    "q_x": Real |_, t| attitude(t).x;
    "q_y": Real |_, t| attitude(t).y;
    "q_z": Real |_, t| attitude(t).z;
    "rate_x_dps": Real |_, t| rate(t).x;
    "rate_y_dps": Real |_, t| rate(t).y;
    "rate_z_dps": Real |_, t| rate(t).z;
    "accel_x_mps2": Real |_, t| acceleration(t).x;
    "accel_y_mps2": Real |_, t| acceleration(t).y;
    "accel_z_mps2": Real |_, t| acceleration(t).z;
    "gyro_x_counts": Int |_, t| gyro(t).x.into();
    "gyro_y_counts": Int |_, t| gyro(t).y.into();
    "gyro_z_counts": Int |_, t| gyro(t).z.into();
    "accel_x_counts": Int |_, t| accel(t).x.into();
    "accel_y_counts": Int |_, t| accel(t).y.into();
    "accel_z_counts": Int |_, t| accel(t).z.into();
    "temperature_c": Real |_, t: &Telemetry| t.temperature_c;
    "target1_rpm": Real |_, t| motor1(t).target_rpm;
    "speed1_rpm": Real |_, t| motor1(t).speed_rpm;
    "duty1_of_255": Int |_, t| motor1(t).duty.into();
    "encoder1_counts": Int |_, t| motor1(t).encoder_counts.into();
    "turns1": Real |_, t| motor1(t).turns;
    "target2_rpm": Real |_, t| motor2(t).target_rpm;
    "speed2_rpm": Real |_, t| motor2(t).speed_rpm;
    "duty2_of_255": Int |_, t| motor2(t).duty.into();
    "encoder2_counts": Int |_, t| motor2(t).encoder_counts.into();
    "turns2": Real |_, t| motor2(t).turns;
    "state": Text |_, t: &Telemetry| short(State::as_str_name(&t.state()), "STATE_");
    "fault": Text |_, t: &Telemetry| short(Fault::as_str_name(&t.fault()), "FAULT_");
    "imu_fresh": Int |_, t: &Telemetry| t.imu_fresh.into();
    "unsent": Int |_, t: &Telemetry| t.unsent.into();
    "imu_errors": Int |_, t: &Telemetry| t.imu_errors.into();
    "bad_frames": Int |_, t: &Telemetry| t.bad_frames.into();
    "missed_ticks": Int |_, t: &Telemetry| t.missed_ticks.into();
}

fn attitude(telemetry: &Telemetry) -> Quaternion {
    telemetry.attitude.unwrap_or_default()
}

fn rate(telemetry: &Telemetry) -> Vector {
    telemetry.angular_velocity_dps.unwrap_or_default()
}

fn acceleration(telemetry: &Telemetry) -> Vector {
    telemetry.acceleration_mps2.unwrap_or_default()
}

fn gyro(telemetry: &Telemetry) -> Counts {
    telemetry.gyro_counts.unwrap_or_default()
}

fn accel(telemetry: &Telemetry) -> Counts {
    telemetry.accel_counts.unwrap_or_default()
}

fn motor1(telemetry: &Telemetry) -> Motor {
    telemetry.motor1.unwrap_or_default()
}

fn motor2(telemetry: &Telemetry) -> Motor {
    telemetry.motor2.unwrap_or_default()
}

fn short(name: &'static str, prefix: &str) -> &'static str {
    name.strip_prefix(prefix).unwrap_or(name)
}
