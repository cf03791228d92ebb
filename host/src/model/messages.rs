//! What only a model can say of a state, as messages of the log.

use crate::log::schema::biflag::{Forces, Quaternion, Truth, Vector, forces};
use sim::contact::bundling::Bundling;
use sim::sample::Sample;
use std::f64::consts::{PI, TAU};

/// `/truth`.
pub(crate) fn truth(sample: &Sample) -> Truth {
    let [w, x, y, z] = sample.attitude;
    let [motor1_turns, motor2_turns] = sample.motor_angle_rad.map(|angle| angle / TAU);
    let [motor1_rpm, motor2_rpm] = sample.motor_speed_rad_s.map(|speed| speed * 30.0 / PI);
    Truth {
        time_s: sample.time_s,
        attitude: Some(Quaternion { w, x, y, z }),
        yaw_deg: sample.yaw_rad.to_degrees(),
        pitch_deg: sample.pitch_rad.to_degrees(),
        roll_deg: sample.roll_rad.to_degrees(),
        angular_velocity_dps: Some(vector(sample.rate_rad_s.map(f64::to_degrees))),
        motor1_turns,
        motor2_turns,
        motor1_rpm,
        motor2_rpm,
    }
}

/// `/forces`.
pub(crate) fn forces(sample: &Sample) -> Forces {
    let [force1_n, force2_n] = sample.force_n.map(|force| Some(vector(force)));
    let [contact1_n, contact2_n] = sample.contact_force_n.map(|force| Some(vector(force)));
    let [axial_torque1_nm, axial_torque2_nm] = sample.axial_torque_nm;
    let bundling = match sample.bundling {
        Bundling::Apart => forces::Bundling::Apart,
        Bundling::Touching => forces::Bundling::Touching,
        Bundling::Bundled => forces::Bundling::Bundled,
    };
    Forces {
        time_s: sample.time_s,
        force1_n,
        force2_n,
        contact1_n,
        contact2_n,
        axial_torque1_nm,
        axial_torque2_nm,
        min_gap_m: sample.min_gap_m,
        max_penetration_m: sample.max_penetration_m,
        bundling: bundling.into(),
        winding_turns: sample.winding_turns,
        newton_iterations: sample.newton_iterations,
    }
}

fn vector([x, y, z]: [f64; 3]) -> Vector {
    Vector { x, y, z }
}
