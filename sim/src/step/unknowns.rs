//! All unknowns of a step in one vector, for the acceleration of the iteration.
//!
//! Edge lengths stand beside the nodes: a combination of iterates acts on directions and lengths apart.

use super::{Solver, body_solve::BodySolve};
use crate::V3;
use crate::rod::CLAMPED;

impl Solver {
    /// The unknowns: for each rod free nodes, edge lengths, angles, drag at the clamp; rate; contact forces.
    pub(super) fn pack(&self, body: &BodySolve) -> Vec<f64> {
        let mut out = Vec::with_capacity(16 * self.rods[0].nodes());
        for flagellum in &self.flagella {
            let shape = &flagellum.shape;
            out.extend(shape.nodes[CLAMPED..].iter().flat_map(|x| [x.x, x.y, x.z]));
            out.extend(shape.nodes[CLAMPED - 1..].windows(2).map(|p| (p[1] - p[0]).norm()));
            out.extend(&shape.angles[1..]);
            out.extend(shape.clamp_density.iter().flat_map(|f| [f.x, f.y, f.z]));
        }
        out.extend(body.body.rate.iter());
        out.extend(self.contacts.pairs.iter().map(|p| p.force));
        out
    }

    /// Weights that make the unknowns comparable, in m a unit.
    pub(super) fn weights(&self, step: f64) -> Vec<f64> {
        let mut out = Vec::new();
        let twist = 0.3 * self.robot.flagellum.helix_radius_m.max(self.robot.flagellum.rod_radius_m);
        let drag = 0.1 * step / self.robot.fluid.viscosity();
        for rod in &self.rods {
            let free = rod.nodes() - CLAMPED;
            out.extend(std::iter::repeat_n(1.0, 4 * free));
            out.extend(std::iter::repeat_n(twist, free));
            out.extend(std::iter::repeat_n(drag, 3 * CLAMPED));
        }
        out.extend(std::iter::repeat_n(0.2 * step, 3));
        out.extend(std::iter::repeat_n(0.0, self.contacts.pairs.len()));
        out
    }

    /// Sets the unknowns.
    pub(super) fn unpack(&mut self, values: &[f64], body: &mut BodySolve) {
        let mut values = values.iter().copied();
        let mut next = || values.next().unwrap_or(0.0);
        for flagellum in &mut self.flagella {
            let shape = &mut flagellum.shape;
            let nodes: Vec<V3> = shape.nodes[CLAMPED..].iter().map(|_| V3::new(next(), next(), next())).collect();
            let mut end = shape.nodes[CLAMPED - 1];
            let mut before = end;
            for (slot, node) in shape.nodes[CLAMPED..].iter_mut().zip(&nodes) {
                let edge = node - before;
                before = *node;
                end += edge * (next() / edge.norm());
                *slot = end;
            }
            shape.angles[1..].fill_with(&mut next);
            for density in &mut shape.clamp_density {
                *density = V3::new(next(), next(), next());
            }
        }
        let rate = V3::new(next(), next(), next());
        if self.closure.two_way() {
            body.set_rate(rate);
        }
        for pair in &mut self.contacts.pairs {
            pair.force = next().max(0.0);
        }
    }
}
