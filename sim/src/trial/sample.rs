//! Samples of a trial, and dense output: values between steps, as accurate as those at the steps.
//!
//! Steps are longer than the intervals of samples. Values in between are interpolated from the last five steps in the time
//! formulas' own basis, exact for {1, t, t^2, cos wt, sin wt} with the speed w of the motor that drives them.

use crate::V3;
use crate::body::attitude::{euler_zyx, of_vector, rotated, rotation_between, unwrap};
use crate::body::shaft::{MotorState, Shaft};
use crate::contact::bundling::Bundling;
use crate::step::formula::{POINTS, value_at};
use crate::step::state::State;
use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// State of the robot at one time. SI; body axes [x_B, y_B, z_B] unless said otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Time in s.
    pub time_s: f64,
    /// Attitude, body to world, [w, x, y, z].
    pub attitude: [f64; 4],
    /// Angular velocity in rad/s.
    pub rate_rad_s: [f64; 3],
    /// Yaw in rad, unwrapped.
    pub yaw_rad: f64,
    /// Pitch in rad.
    pub pitch_rad: f64,
    /// Roll in rad.
    pub roll_rad: f64,
    /// Angles of the motors about +z_B in rad, unwrapped.
    pub motor_angle_rad: [f64; 2],
    /// Speeds of the motors in rad/s.
    pub motor_speed_rad_s: [f64; 2],
    /// Force of flagellum 1 and 2 on the base in N, contact included; their net weight only if it is
    /// set to act on the base.
    pub force_n: [[f64; 3]; 2],
    /// The part of `force_n` from contact.
    pub contact_force_n: [[f64; 3]; 2],
    /// Reaction torques on the base about the shafts in N m.
    pub axial_torque_nm: [f64; 2],
    /// Smallest gap between the flagella's surfaces since the last sample in m, negative if they overlap.
    pub min_gap_m: f64,
    /// Largest overlap since the last sample in m.
    pub max_penetration_m: f64,
    /// Apart, touching or bundled.
    pub bundling: Bundling,
    /// Number of times that the helix axes wind round each other, right-handed positive.
    pub winding_turns: f64,
    /// Sweeps of the iteration since the last sample.
    pub sweeps: u32,
    /// Centre lines of both flagella in the body frame in m, when asked for.
    pub shapes_m: Option<[Vec<[f64; 3]>; 2]>,
}

/// Forces of a flagellum on the base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ForceRecord {
    /// Fluid, and net weight if it acts on the base, N.
    pub smooth: V3,
    /// Contact, N.
    pub contact: V3,
    /// Reaction torque of the fluid about the shaft, N m.
    pub smooth_torque: f64,
    /// Reaction torque of contact about the shaft, N m.
    pub contact_torque: f64,
}

/// A step in the dense output.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepRecord {
    /// Time in s.
    pub time: f64,
    /// Attitude.
    pub attitude: UnitQuaternion<f64>,
    /// Unwrapped yaw, rad.
    pub yaw: f64,
    /// Angular velocity, rad/s.
    pub rate: V3,
    /// Motors.
    pub motors: [MotorState; 2],
    /// Forces of both flagella.
    pub forces: [ForceRecord; 2],
    /// Whether any pair of edges was in contact, of both flagella or of one with itself.
    pub contact: bool,
    /// Whether the flagella touched each other.
    #[serde(default)]
    pub touching: bool,
}

/// The last steps, newest first, and values between them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DenseOutput {
    records: VecDeque<StepRecord>,
    /// Time before the newest step for which values are available, s; at least the last five steps are kept.
    #[serde(default)]
    reach: f64,
}

/// Attitude, rate and forces at one time, interpolated.
#[derive(Clone, Copy, Debug)]
pub struct Interpolated {
    /// Attitude, body to world.
    pub attitude: UnitQuaternion<f64>,
    /// Unwrapped yaw, pitch, roll in rad.
    pub euler: [f64; 3],
    /// Angular velocity, rad/s.
    pub rate: V3,
    /// Forces.
    pub forces: [ForceRecord; 2],
    /// Whether the flagella touched each other at the step's end.
    pub touching: bool,
}

impl DenseOutput {
    /// Creates dense output with values up to `reach` seconds before the newest step.
    pub fn reaching(reach: f64) -> Self {
        Self { reach, ..Self::default() }
    }

    /// Adds a step.
    pub fn push(&mut self, record: StepRecord) {
        let oldest = record.time - self.reach;
        self.records.push_front(record);
        // Values at the oldest time are interpolated from the steps around it.
        let within = self.records.partition_point(|r| r.time > oldest);
        self.records.truncate(within.max(1) + POINTS - 1);
    }

    /// Returns the newest step.
    pub fn newest(&self) -> Option<&StepRecord> {
        self.records.front()
    }

    /// Turns the robot in all steps by a rotation vector in world axes, rad.
    pub fn turn(&mut self, rotation: V3) {
        let turn = of_vector(rotation);
        for record in &mut self.records {
            record.attitude = turn * record.attitude;
            record.yaw = unwrap(euler_zyx(&record.attitude)[0], record.yaw + rotation.z);
        }
    }

    /// Removes earlier steps: the motion has a kink here.
    pub fn restart(&mut self) {
        self.records.truncate(1);
    }

    /// Returns the values at a time (s) within the last step or within reach behind it, `None` before the first step.
    pub fn at(&self, time: f64) -> Option<Interpolated> {
        // Steps from the end of the one that contains the time, backwards.
        let end = self.records.partition_point(|r| r.time >= time).saturating_sub(1);
        let steps: Vec<&StepRecord> = self.records.range(end..).take(POINTS).collect();
        let newest = **steps.first()?;
        // Contact makes and breaks: no smooth curve goes through its forces.
        let smooth = if steps.iter().any(|r| r.contact) { 2 } else { POINTS };
        let fastest = newest.motors[0].speed.abs().max(newest.motors[1].speed.abs());
        let body = weights(&steps, fastest, time, POINTS);
        let linear = weights(&steps, 0.0, time, 2);
        let mut rotation = V3::zeros();
        let mut rate = V3::zeros();
        for (record, w) in steps.iter().zip(body) {
            rotation += rotation_between(&newest.attitude, &record.attitude) * w;
            rate += record.rate * w;
        }
        let attitude = rotated(&newest.attitude, rotation);
        let [yaw, pitch, roll] = euler_zyx(&attitude);
        let forces = [0, 1].map(|k| {
            let weights = weights(&steps, newest.motors[k].speed, time, smooth);
            let mut sum = ForceRecord::default();
            for (record, w) in steps.iter().zip(weights) {
                sum.smooth += record.forces[k].smooth * w;
                sum.smooth_torque += record.forces[k].smooth_torque * w;
            }
            for (record, w) in steps.iter().zip(linear) {
                sum.contact += record.forces[k].contact * w;
                sum.contact_torque += record.forces[k].contact_torque * w;
            }
            sum
        });
        let euler = [unwrap(yaw, newest.yaw), pitch, roll];
        Some(Interpolated { attitude, euler, rate, forces, touching: newest.touching })
    }
}

/// Returns the weights of steps, newest first, for the value at `time` (s). `speed`: speed of the motor, rad/s.
fn weights(steps: &[&StepRecord], speed: f64, time: f64, points: usize) -> [f64; POINTS] {
    let newest = steps[0].time;
    let Some(scale) = steps.get(1).map(|r| newest - r.time) else {
        return std::array::from_fn(|j| if j == 0 { 1.0 } else { 0.0 });
    };
    let times: Vec<f64> = steps.iter().take(points).map(|r| (r.time - newest) / scale).collect();
    value_at(speed.abs() * scale, &times, (time - newest) / scale)
}

/// Returns the centre lines of both flagella in the body frame (m) at a time (s) within the last step of a state.
///
/// `motors`: angles at that time; `feet`: feet of the shafts, body frame, m.
pub fn shapes_at(state: &State, time: f64, motors: &[MotorState; 2], feet: &[V3; 2]) -> [Vec<V3>; 2] {
    let scale = state.past.first().map_or(1.0, |p| state.time - p.time);
    let mut times = vec![0.0];
    times.extend(state.past.iter().map(|p| (p.time - state.time) / scale));
    times.truncate(POINTS);
    [0, 1].map(|k| {
        let angle = state.motors[k].speed.abs() * scale;
        let weights = value_at(angle, &times, (time - state.time) / scale);
        let shaft = Shaft::new(feet[k], motors[k].angle);
        let mut nodes: Vec<V3> = state.rods[k].shape.nodes.iter().map(|x| x * weights[0]).collect();
        for (past, w) in state.past.iter().zip(&weights[1..times.len()]) {
            for (node, x) in nodes.iter_mut().zip(&past.shapes[k].nodes) {
                *node += x * *w;
            }
        }
        nodes.iter().map(|x| shaft.point_to_body(*x)).collect()
    })
}
