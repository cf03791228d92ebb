//! Compliance of both rods to forces between them: one column for each active pair.
//!
//! A column is the displacement of both rods within the step for a unit force in the pair: the force moves the fluid at its
//! own rod and at the other, and the frozen inverses give how the rods follow that flow. Even with rough inverses, a sweep
//! closes the gaps that it solves for to second order.

use super::flagellum::Flagellum;
use super::problem::StepProblem;
use crate::V3;
use crate::contact::pairs::Pair;
use crate::fluid::far::Sources;
use crate::rod::CLAMPED;

/// A column serves until the pair's normal has turned by more than 11 degrees (its cosine) ...
const SAME_NORMAL: f64 = 0.98;
/// ... or its closest points have moved along the edges by more than this share of an edge in total.
const SAME_POINT: f64 = 0.4;

/// Displacements of both rods for a unit force in a pair.
#[derive(Clone, Debug)]
pub struct Column {
    /// Corrections of each rod's unknowns for 1 N, see [`super::preconditioner`].
    pub compliance: [Vec<f64>; 2],
    normal: V3,
    at: [f64; 2],
}

impl Column {
    /// Returns whether the pair has moved too far for its column.
    pub fn is_stale(&self, pair: &Pair) -> bool {
        self.normal.dot(&pair.normal) < SAME_NORMAL
            || (self.at[0] - pair.at[0]).abs() + (self.at[1] - pair.at[1]).abs() > SAME_POINT
    }
}

/// Returns the columns of some pairs.
pub fn columns(pairs: &[&Pair], flagella: &mut [Flagellum; 2], problem: &StepProblem) -> Vec<Column> {
    let mut flows = [Vec::new(), Vec::new()];
    let mut seen = [Sources::default(), Sources::default()];
    for pair in pairs {
        for (flows, flow) in flows.iter_mut().zip(flow_of_pair(pair, flagella, problem, &mut seen)) {
            flows.push(flow);
        }
    }
    let [first, second] =
        [0, 1].map(|k| flagella[k].compliance_columns(problem.inverses[k], &flows[k], problem.step.kappa(k)));
    let column = |((pair, a), b): ((&&Pair, _), _)| Column { compliance: [a, b], normal: pair.normal, at: pair.at };
    pairs.iter().zip(first).zip(second).map(column).collect()
}

/// Returns the flow (m/s, shaft frames) at the nodes of both rods for a unit normal force in a pair. `seen`: scratch.
fn flow_of_pair(
    pair: &Pair,
    flagella: &mut [Flagellum; 2],
    problem: &StepProblem,
    seen: &mut [Sources; 2],
) -> [Vec<V3>; 2] {
    let (rods, shafts) = (&problem.model.rods, &problem.step.shafts);
    let mut density: [Vec<V3>; 2] = [0, 1].map(|k| vec![V3::zeros(); rods[k].nodes()]);
    for (rod, node, weight) in pair.weights() {
        if node >= CLAMPED {
            density[rod][node] += shafts[rod].to_shaft(pair.normal) * (weight / rods[rod].nodal_length[node]);
        }
    }
    // Gauss points of the edges that carry the density, in both shaft frames.
    seen.iter_mut().for_each(Sources::clear);
    for (k, density) in density.iter().enumerate() {
        let nodes = &flagella[k].shape.nodes;
        let loaded = |e: usize| density[e] != V3::zeros() || density[e + 1] != V3::zeros();
        for e in (0..nodes.len() - 1).filter(|&e| loaded(e)) {
            let (x, dx) = (nodes[e], nodes[e + 1] - nodes[e]);
            let (f, df) = (density[e], density[e + 1] - density[e]);
            let length = dx.norm();
            for (point, weight) in flagella[k].rule {
                let (at, force) = (x + dx * *point, (f + df * *point) * (weight * length));
                let body = (shafts[k].point_to_body(at), shafts[k].to_body(force));
                for (shaft, sources) in shafts.iter().zip(seen.iter_mut()) {
                    sources.push(shaft.point_to_shaft(body.0), shaft.to_shaft(body.1));
                }
            }
        }
    }
    [0, 1].map(|k| {
        let own = pair.rods.contains(&k).then_some(density[k].as_slice());
        flagella[k].flow_of(own, &seen[k])
    })
}
