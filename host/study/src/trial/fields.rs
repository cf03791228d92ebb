//! The table of message fields that are columns of a trial.

use biflag_log::schema::biflag::{Counts, Motor, Telemetry, Truth, Vector};

/// A field of a message.
pub struct Field<M> {
    /// Name, with the unit.
    pub name: &'static str,
    /// Description.
    pub about: &'static str,
    pub(super) of: fn(&M) -> f64,
}

const fn field<M>(name: &'static str, about: &'static str, of: fn(&M) -> f64) -> Field<M> {
    Field { name, about, of }
}

/// The fields of a board's frame besides attitude, speeds and turns.
pub const FRAME: [Field<Telemetry>; 18] = [
    field("rate_x_dps", "angular velocity about the body's x axis, calibrated bias removed", |f| rates(f).x),
    field("rate_y_dps", "angular velocity about the body's y axis", |f| rates(f).y),
    field("rate_z_dps", "angular velocity about the body's z axis", |f| rates(f).z),
    field("acceleration_x_mps2", "specific force along the body's x axis, +1 g where it points up", |f| force(f).x),
    field("acceleration_y_mps2", "specific force along the body's y axis", |f| force(f).y),
    field("acceleration_z_mps2", "specific force along the body's z axis", |f| force(f).z),
    field("gyro_x_counts", "raw reading of the gyroscope, sensor's x axis", |f| counts(f.gyro_counts).x),
    field("gyro_y_counts", "raw reading of the gyroscope, sensor's y axis", |f| counts(f.gyro_counts).y),
    field("gyro_z_counts", "raw reading of the gyroscope, sensor's z axis", |f| counts(f.gyro_counts).z),
    field("accel_x_counts", "raw reading of the accelerometer, sensor's x axis", |f| counts(f.accel_counts).x),
    field("accel_y_counts", "raw reading of the accelerometer, sensor's y axis", |f| counts(f.accel_counts).y),
    field("accel_z_counts", "raw reading of the accelerometer, sensor's z axis", |f| counts(f.accel_counts).z),
    field("temperature_counts", "raw reading of the thermometer", |f| f.temperature_counts.into()),
    field("duty1", "duty cycle of motor 1, -255 to 255", |f| motor(f.motor1, |motor| motor.duty)),
    field("duty2", "duty cycle of motor 2", |f| motor(f.motor2, |motor| motor.duty)),
    field("encoder1_counts", "count of encoder 1; 0 without one", |f| motor(f.motor1, |motor| motor.encoder_counts)),
    field("encoder2_counts", "count of encoder 2; 0 without one", |f| motor(f.motor2, |motor| motor.encoder_counts)),
    field("supply_v", "supply of the board; 0 before its first measurement", |f| f.supply_v),
];

/// The exact state of a modelled robot, also of one behind an emulated board.
pub const TRUTH: [Field<Truth>; 10] = [
    field("truth_yaw_deg", "true yaw of the robot in the world, unwrapped, no offset removed", |t| t.yaw_deg),
    field("truth_pitch_deg", "true pitch, no offset removed", |t| t.pitch_deg),
    field("truth_roll_deg", "true roll, no offset removed", |t| t.roll_deg),
    field("truth_rate_x_dps", "true angular velocity about the body's x axis", |t| vector(t.angular_velocity_dps).x),
    field("truth_rate_y_dps", "true angular velocity about the body's y axis", |t| vector(t.angular_velocity_dps).y),
    field("truth_rate_z_dps", "true angular velocity about the body's z axis", |t| vector(t.angular_velocity_dps).z),
    field("truth_speed1_rpm", "true speed of flagellum 1", |t| t.motor1_rpm),
    field("truth_speed2_rpm", "true speed of flagellum 2", |t| t.motor2_rpm),
    field("truth_turns1", "true turns of flagellum 1 since the robot's start", |t| t.motor1_turns),
    field("truth_turns2", "true turns of flagellum 2 since the robot's start", |t| t.motor2_turns),
];

/// Returns the values of a message in the order of its fields.
pub(super) fn row<M, const N: usize>(fields: &[Field<M>; N], message: &M) -> [f64; N] {
    fields.each_ref().map(|field| (field.of)(message))
}

fn rates(frame: &Telemetry) -> Vector {
    vector(frame.angular_velocity_dps)
}

fn force(frame: &Telemetry) -> Vector {
    vector(frame.acceleration_mps2)
}

/// Returns NaN for a vector that a message lacks.
fn vector(of: Option<Vector>) -> Vector {
    of.unwrap_or(Vector { x: f64::NAN, y: f64::NAN, z: f64::NAN })
}

fn counts(of: Option<Counts>) -> Vector {
    vector(of.map(|Counts { x, y, z }| Vector { x: x.into(), y: y.into(), z: z.into() }))
}

fn motor(of: Option<Motor>, value: fn(Motor) -> i32) -> f64 {
    of.map_or(f64::NAN, |motor| value(motor).into())
}
