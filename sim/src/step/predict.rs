//! The trial shapes that an iteration starts from.

use super::flagellum::Flagellum;
use super::state::{Shape, State};
use super::time_step::TimeStep;
use crate::V3;
use crate::rod::{CLAMPED, Rod};

/// A predicted edge is between half and twice its length at rest: extrapolation must not collapse or tear it.
const LENGTH_RANGE: [f64; 2] = [0.5, 2.0];

/// Sets the trial shape of flagellum `k` by extrapolation, and the past's part of its time formula.
///
/// Directions and lengths of edges are extrapolated separately: the stretch is the stiff part.
pub fn predict(flagellum: &mut Flagellum, rod: &Rod, k: usize, state: &State, step: &TimeStep) {
    let past = |j: usize| -> &Shape { if j == 0 { &state.rods[k].shape } else { &state.past[j - 1].shapes[k] } };
    let a = &step.rods[k].derivative;
    for (i, slot) in flagellum.history.iter_mut().enumerate() {
        *slot = (1..step.points).map(|j| past(j - 1).nodes[i] * a[j]).fold(V3::zeros(), |a, b| a + b) / step.length;
    }
    for (e, slot) in flagellum.angle_history.iter_mut().enumerate() {
        let sum: f64 = (1..step.points).map(|j| past(j - 1).angles[e] * a[j]).sum();
        *slot = sum / step.length;
    }
    let shape = &mut flagellum.shape;
    shape.clone_from(past(0));
    let b = &step.rods[k].prediction[..step.prediction_points];
    if b.len() < 2 {
        return;
    }
    let combine =
        |at: &dyn Fn(&Shape) -> V3| b.iter().enumerate().map(|(j, b)| at(past(j)) * *b).fold(V3::zeros(), |a, b| a + b);
    let mut end = shape.nodes[CLAMPED - 1];
    for e in 1..shape.nodes.len() - 1 {
        let edge = combine(&|s| s.nodes[e + 1] - s.nodes[e]);
        let length: f64 =
            (b.iter().enumerate()).map(|(j, b)| b * (past(j).nodes[e + 1] - past(j).nodes[e]).norm()).sum();
        let [shortest, longest] = LENGTH_RANGE.map(|share| share * rod.rest_length[e]);
        end += edge * (length.clamp(shortest, longest) / edge.norm());
        shape.nodes[e + 1] = end;
        shape.angles[e] = b.iter().enumerate().map(|(j, b)| b * past(j).angles[e]).sum();
    }
    for i in 0..CLAMPED {
        shape.clamp_density[i] = combine(&|s| s.clamp_density[i]);
    }
}
