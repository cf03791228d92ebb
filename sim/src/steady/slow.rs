//! The slow coordinates of a robot, which take seconds to decay.
//!
//! [yaw, pitch, roll, bend 1 about x_B and y_B, bend 2 about x_B and y_B], all in rad. The attitude settles against the
//! drag of the flagella, and each flagellum bends as a whole, as a cantilever in its first mode. All other modes of the
//! rods decay within a second.
//!
//! The bend of a flagellum is the rotation of its tip, from the mean displacement of its nodes across the shaft.

use crate::V3;
use crate::body::attitude::{euler_zyx, of_euler_zyx, of_vector};
use crate::body::shaft::{MotorState, Shaft};
use crate::rod::Rod;
use crate::step::Solver;
use crate::step::state::{Shape, State};
use crate::trial::profile::SpeedProfile;
use nalgebra::{SVector, UnitQuaternion};

/// Number of coordinates.
pub const COORDINATES: usize = 7;
/// Number of the attitude's coordinates, which come first.
pub const ANGLES: usize = 3;
/// A point in the slow coordinates.
pub type Slow = SVector<f64, COORDINATES>;

/// Returns the rotation of an edge relative to the tip's: the slope of a cantilever under an even load.
fn share(edge: usize, edges: usize) -> f64 {
    let s = (edge as f64 + 0.5) / edges as f64;
    s * (3.0 + s * (s - 3.0))
}

/// Returns the mean displacement of the nodes of a rod that hangs straight down, for a tip rotated by 1 rad, m.
fn lever(rod: &Rod) -> f64 {
    let (mut displacement, mut sum) = (0.0, 0.0);
    for (e, pair) in rod.shape.windows(2).enumerate().skip(1) {
        displacement += share(e, rod.edges()) * (pair[0].z - pair[1].z);
        sum += displacement;
    }
    sum / rod.nodes() as f64
}

/// Returns the mean of the nodes, m.
fn centre(nodes: &[V3]) -> V3 {
    nodes.iter().sum::<V3>() / nodes.len() as f64
}

/// Returns the slow coordinates of a state.
pub fn coordinates(solver: &Solver, state: &State) -> Slow {
    let [_, pitch, roll] = euler_zyx(&state.body.attitude);
    let bend = |k: usize| {
        let rod = &solver.model().rods[k];
        let moved = centre(&state.rods[k].shape.nodes) - centre(&rod.shape);
        let moved = Shaft::new(V3::zeros(), state.motors[k].angle).to_body(moved) / lever(rod);
        [moved.y, -moved.x]
    };
    let ([x1, y1], [x2, y2]) = (bend(0), bend(1));
    Slow::from([state.body.yaw, pitch, roll, x1, y1, x2, y2])
}

/// Returns a state whose slow coordinates, and those of its past, are changed by `change`. `profile`: speeds of the
/// motors.
pub fn moved(state: &State, change: &Slow, profile: &SpeedProfile) -> State {
    let mut out = state.clone();
    let turned = |attitude: &UnitQuaternion<f64>| {
        let [yaw, pitch, roll] = euler_zyx(attitude);
        of_euler_zyx([yaw + change[0], pitch + change[1], roll + change[2]])
    };
    out.body.attitude = turned(&state.body.attitude);
    out.body.yaw += change[0];
    let bend = |k: usize, motor: MotorState| {
        Shaft::new(V3::zeros(), motor.angle).to_shaft(V3::new(change[3 + 2 * k], change[4 + 2 * k], 0.0))
    };
    for k in 0..2 {
        let tip = bend(k, state.motors[k]);
        let rod = &mut out.rods[k];
        bend_shape(&mut rod.shape, tip);
        let edges = rod.frames.tangent.len();
        for (e, (tangent, director)) in rod.frames.tangent.iter_mut().zip(&mut rod.frames.director).enumerate().skip(1)
        {
            let rotation = of_vector(tip * share(e, edges));
            (*tangent, *director) = (rotation * *tangent, rotation * *director);
        }
    }
    for past in &mut out.past {
        past.attitude = turned(&past.attitude);
        let motors = profile.motors(past.time);
        for k in 0..2 {
            bend_shape(&mut past.shapes[k], bend(k, motors[k]));
        }
    }
    out
}

/// Rotates each edge by its share of a rotation of the tip (shaft frame, rad). Edges keep their lengths, and the bend is
/// smooth.
fn bend_shape(shape: &mut Shape, tip: V3) {
    let edges = shape.nodes.len() - 1;
    let mut before = shape.nodes[1];
    for e in 1..edges {
        let next = shape.nodes[e + 1];
        let rotation = of_vector(tip * share(e, edges));
        shape.nodes[e + 1] = shape.nodes[e] + rotation * (next - before);
        before = next;
    }
}
