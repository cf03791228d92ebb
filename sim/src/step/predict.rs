//! The trial shapes that an iteration starts from.

use super::{Plan, Solver};
use crate::V3;
use crate::rod::CLAMPED;
use crate::state::{Shape, State};

impl Solver {
    /// Trial shapes by extrapolation: directions and lengths of edges apart, and the formula's history.
    pub(super) fn predict(&mut self, state: &State, plan: &Plan) {
        for k in 0..2 {
            let flagellum = &mut self.flagella[k];
            let past =
                |j: usize| -> &Shape { if j == 0 { &state.rods[k].shape } else { &state.past[j - 1].shapes[k] } };
            for (i, slot) in flagellum.history.iter_mut().enumerate() {
                *slot =
                    (1..plan.points).map(|j| past(j - 1).nodes[i] * plan.weights[k][j]).fold(V3::zeros(), |a, b| a + b)
                        / plan.step;
            }
            for (e, slot) in flagellum.angle_history.iter_mut().enumerate() {
                let sum: f64 = (1..plan.points).map(|j| past(j - 1).angles[e] * plan.weights[k][j]).sum();
                *slot = sum / plan.step;
            }
            flagellum.kappa = plan.kappa[k];
            let shape = &mut flagellum.shape;
            shape.clone_from(past(0));
            let b = &plan.prediction[k][..plan.predicted_from];
            if b.len() < 2 {
                continue;
            }
            let n = shape.nodes.len();
            let combine = |at: &dyn Fn(&Shape) -> V3| {
                b.iter().enumerate().map(|(j, b)| at(past(j)) * *b).fold(V3::zeros(), |a, b| a + b)
            };
            let mut end = shape.nodes[CLAMPED - 1];
            for e in 1..n - 1 {
                let edge = combine(&|s| s.nodes[e + 1] - s.nodes[e]);
                let rest = self.rods[k].rest_length[e];
                let length: f64 =
                    (b.iter().enumerate()).map(|(j, b)| b * (past(j).nodes[e + 1] - past(j).nodes[e]).norm()).sum();
                end += edge * (length.clamp(0.5 * rest, 2.0 * rest) / edge.norm());
                shape.nodes[e + 1] = end;
                shape.angles[e] = b.iter().enumerate().map(|(j, b)| b * past(j).angles[e]).sum();
            }
            for i in 0..CLAMPED {
                shape.clamp_density[i] = combine(&|s| s.clamp_density[i]);
            }
        }
    }
}
