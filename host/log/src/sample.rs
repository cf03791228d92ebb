//! Converts samples of the model to messages of the log.

use super::convert::vector;
use super::schema::biflag::{Forces, Nodes, Quaternion, Truth, Vector, forces};
use sim::contact::bundling::Bundling;
use sim::trial::quantity::{AXIAL_TORQUE, CONTACT, FORCE, MAX_PENETRATION, MIN_GAP, SAMPLE_COLUMNS, WINDING};
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

impl Forces {
    /// Returns the columns of a sample, in the order of [`sim::trial::quantity::sample_columns`]; NaN for a vector that is missing.
    pub fn columns(&self) -> [f64; SAMPLE_COLUMNS] {
        let parts = |of: Option<Vector>| of.map_or([f64::NAN; 3], |Vector { x, y, z }| [x, y, z]);
        let both = |one, two| [parts(one), parts(two)].concat();
        let values = [
            (FORCE, both(self.force1_n, self.force2_n)),
            (CONTACT, both(self.contact1_n, self.contact2_n)),
            (AXIAL_TORQUE, vec![self.axial_torque1_nm, self.axial_torque2_nm]),
            (MIN_GAP, vec![self.min_gap_m]),
            (MAX_PENETRATION, vec![self.max_penetration_m]),
            (WINDING, vec![self.winding_turns]),
        ];
        let mut columns = [f64::NAN; SAMPLE_COLUMNS];
        values.into_iter().for_each(|(quantity, parts)| columns[quantity.in_sample()].copy_from_slice(&parts));
        columns
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use sim::trial::quantity::{FLAGELLA, sample_columns};

    /// A quantity that a message lacks, or that is in another place, would be wrong in every export.
    #[test]
    fn columns_of_a_message_are_those_of_its_sample() {
        let sample = Sample {
            time_s: 1.0,
            attitude: [1.0, 0.0, 0.0, 0.0],
            rate_rad_s: [0.0; 3],
            yaw_rad: 0.0,
            pitch_rad: 0.0,
            roll_rad: 0.0,
            motor_angle_rad: [0.0; 2],
            motor_speed_rad_s: [0.0; 2],
            force_n: [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
            contact_force_n: [[7.0, 8.0, 9.0], [10.0, 11.0, 12.0]],
            axial_torque_nm: [13.0, 14.0],
            min_gap_m: 15.0,
            max_penetration_m: 16.0,
            bundling: Bundling::Apart,
            winding_turns: 17.0,
            sweeps: 1,
            shapes_m: None,
        };
        let wanted: Vec<f64> = sample_columns(FLAGELLA).map(|column| column.of_sample(&sample)).collect();
        assert_eq!(forces(&sample).columns().as_slice(), wanted);
    }
}
