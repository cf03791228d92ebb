//! Converts samples of the model to messages of the log.

use super::schema::biflag::{Forces, Nodes, Quaternion, Truth, Vector, forces};
use sim::contact::bundling::Bundling;
use sim::trial::sample::Sample;
use std::f64::consts::{PI, TAU};

/// Returns the message for `/truth`.
pub fn truth(sample: &Sample) -> Truth {
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

/// Returns the message for `/forces`.
pub fn forces(sample: &Sample) -> Forces {
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
        newton_iterations: sample.sweeps,
    }
}

/// Returns the message for `/nodes`; `None` if the sample has no shapes.
pub fn nodes(sample: &Sample) -> Option<Nodes> {
    let [flagellum1_m, flagellum2_m] = sample.shapes_m.as_ref()?.each_ref().map(|line| line.as_flattened().to_vec());
    Some(Nodes { time_s: sample.time_s, flagellum1_m, flagellum2_m })
}

impl Nodes {
    /// Returns the centre lines of flagella 1 and 2, body axes, m; `None` if the coordinates do not form complete
    /// points.
    pub fn lines(&self) -> Option<[Vec<[f64; 3]>; 2]> {
        let line = |flat: &[f64]| {
            let (points, rest) = flat.as_chunks();
            (points.len() >= 2 && rest.is_empty()).then(|| points.to_vec())
        };
        Some([line(&self.flagellum1_m)?, line(&self.flagellum2_m)?])
    }
}

fn vector([x, y, z]: [f64; 3]) -> Vector {
    Vector { x, y, z }
}
