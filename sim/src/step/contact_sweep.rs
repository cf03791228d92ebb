//! The contact half of a sweep: forces of all close pairs together, and both rods' answer to them.
//!
//! Each active pair has columns: the answer of both rods within the step to a unit force in it, through
//! the flow on its own rod and on the other, by the frozen inverse. They give a small complementarity
//! problem whose solution closes the gaps to second order whatever the quality of the inverse.

use super::flagellum::{Flagellum, Kinematics};
use super::preconditioner::Preconditioner;
use crate::V3;
use crate::contact::{
    complementarity, friction,
    pairs::{Lines, Pair},
};
use crate::fluid::far::Sources;
use crate::robot::clamp::Shaft;
use crate::rod::{CLAMPED, Rod};

/// Lengths and limits of contact, SI.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Distance of centre lines at which rods touch: two radii.
    pub distance: f64,
    /// Pairs below this gap get columns.
    pub active_gap: f64,
    /// A force above this in one pair means that the iteration is lost.
    pub largest_force: f64,
    /// Coefficient of friction.
    pub friction: f64,
    /// Speed of sticking.
    pub slip: f64,
}

/// What the sweep needs of the step.
pub struct Context<'a> {
    /// The rods.
    pub rods: &'a [Rod; 2],
    /// Their shafts at the end of the step.
    pub shafts: &'a [Shaft; 2],
    /// Their frames' motion.
    pub motion: &'a [Kinematics; 2],
    /// Their frozen inverses.
    pub inverses: [&'a Preconditioner; 2],
}

/// Pairs of a step and their columns.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// The pairs.
    pub pairs: Vec<Pair>,
    /// Contact stiffness k, N/m.
    pub stiffness: f64,
    /// Closest points and normals are held.
    pub frozen: bool,
    columns: Vec<Option<Column>>,
}

#[derive(Clone, Debug)]
struct Column {
    answers: [Vec<f64>; 2],
    normal: V3,
    at: [f64; 2],
}

/// Outcome of a sweep.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    /// Largest error of the gap law, m.
    pub violation: f64,
    /// Largest motion of a node, m.
    pub motion: f64,
}

impl Contacts {
    /// Starts a step with a new set of pairs.
    pub fn begin(&mut self, pairs: Vec<Pair>, stiffness: f64) {
        self.columns.clear();
        self.columns.resize(pairs.len(), None);
        self.pairs = pairs;
        self.stiffness = stiffness;
        self.frozen = false;
    }

    /// Makes room for columns of pairs that were added.
    pub fn grow(&mut self) {
        self.columns.resize(self.pairs.len(), None);
    }

    /// Distances, and unless frozen closest points and normals, at the present shapes.
    pub fn refresh(&mut self, lines: &Lines) {
        for (pair, column) in self.pairs.iter_mut().zip(&mut self.columns) {
            if self.frozen {
                pair.refresh_frozen(lines);
                continue;
            }
            pair.refresh(lines);
            let stale = column.as_ref().is_some_and(|c| {
                c.normal.dot(&pair.normal) < 0.98 || (c.at[0] - pair.at[0]).abs() + (c.at[1] - pair.at[1]).abs() > 0.4
            });
            if stale {
                *column = None;
            }
        }
    }

    /// Contact forces on the nodes of both rods, shaft frames.
    pub fn load(&self, flagella: &mut [Flagellum; 2], shafts: &[Shaft; 2]) {
        for flagellum in flagella.iter_mut() {
            flagellum.contact.fill(V3::zeros());
        }
        for pair in self.pairs.iter().filter(|p| p.force > 0.0) {
            let force = pair.normal * pair.force + pair.friction;
            for (rod, node, weight) in pair.weights() {
                flagella[rod].contact[node] += shafts[rod].to_shaft(force) * weight;
            }
        }
    }

    /// Largest error of the gap law at the present distances, m.
    pub fn violation(&self, limits: &Limits) -> f64 {
        (self.pairs.iter())
            .map(|p| {
                let gap = p.distance - limits.distance + p.force / self.stiffness;
                if p.force > 0.0 { gap.abs() } else { -gap }
            })
            .fold(0.0, f64::max)
    }

    /// Solves all pairs together and moves both rods; forces become infinite in the outcome when lost.
    pub fn sweep(
        &mut self,
        flagella: &mut [Flagellum; 2],
        context: &Context,
        lines: &mut Lines,
        limits: &Limits,
    ) -> Outcome {
        self.refresh(lines);
        let set: Vec<usize> = (0..self.pairs.len())
            .filter(|&q| {
                let p = &self.pairs[q];
                p.force > 0.0 || p.distance - limits.distance < limits.active_gap
            })
            .collect();
        let touching = |p: &Pair| p.force > 0.0 || p.distance < limits.distance;
        if !set.iter().any(|&q| touching(&self.pairs[q])) {
            return Outcome::default();
        }
        self.fill_columns(&set, flagella, context);
        let size = set.len();
        let mut matrix = vec![0.0; size * size];
        let mut right = vec![0.0; size];
        for (row, &q) in set.iter().enumerate() {
            let pair = &self.pairs[q];
            right[row] = pair.distance - limits.distance;
            for (rod, node, weight) in pair.weights() {
                if node < CLAMPED {
                    continue;
                }
                let direction = context.shafts[rod].to_shaft(pair.normal) * weight;
                let at = 3 * (node - CLAMPED);
                for (c, &other) in set.iter().enumerate() {
                    if let Some(column) = &self.columns[other] {
                        let answer = &column.answers[rod][at..at + 3];
                        matrix[row * size + c] +=
                            direction.x * answer[0] + direction.y * answer[1] + direction.z * answer[2];
                    }
                }
            }
        }
        let before: Vec<f64> = set.iter().map(|&q| self.pairs[q].force).collect();
        for row in 0..size {
            right[row] -= (0..size).map(|c| matrix[row * size + c] * before[c]).sum::<f64>();
            matrix[row * size + row] += 1.0 / self.stiffness;
        }
        let mut force = before.clone();
        complementarity::solve(&matrix, &right, &mut force, 1e-8);
        if force.iter().any(|l| l.is_nan() || *l >= limits.largest_force) {
            return Outcome { violation: f64::INFINITY, motion: f64::INFINITY };
        }
        let mut motion = 0f64;
        for k in 0..2 {
            let mut sum = vec![0.0; flagella[k].correction.len()];
            for (i, &q) in set.iter().enumerate() {
                let change = force[i] - before[i];
                if let (true, Some(column)) = (change != 0.0, &self.columns[q]) {
                    for (s, a) in sum.iter_mut().zip(&column.answers[k]) {
                        *s += change * a;
                    }
                }
            }
            let free = 3 * (context.rods[k].nodes() - CLAMPED);
            let largest = sum[..free].iter().fold(0f64, |a, v| a.max(v.abs()));
            if largest > 0.0 {
                flagella[k].apply(&sum);
                motion = motion.max(largest);
            }
        }
        for (i, &q) in set.iter().enumerate() {
            self.pairs[q].force = force[i];
        }
        update_lines(flagella, context.shafts, lines);
        self.refresh(lines);
        if limits.friction > 0.0 {
            for (row, &q) in set.iter().enumerate() {
                // Neighbouring pairs rub together: the answer to all of them keeps the iteration stable.
                let answer = (0..size).filter(|&c| force[c] > 0.0).map(|c| matrix[row * size + c].abs()).sum();
                rub(&mut self.pairs[q], flagella, context, answer, limits);
            }
        }
        Outcome { violation: self.violation(limits), motion }
    }

    /// Columns of the pairs in `set` that have none.
    fn fill_columns(&mut self, set: &[usize], flagella: &mut [Flagellum; 2], context: &Context) {
        let missing: Vec<usize> = set.iter().copied().filter(|&q| self.columns[q].is_none()).collect();
        let mut flows = [Vec::new(), Vec::new()];
        for &q in &missing {
            for (flows, flow) in flows.iter_mut().zip(flow_of_pair(&self.pairs[q], flagella, context)) {
                flows.push(flow);
            }
        }
        let [first, second] =
            [0, 1].map(|k| flagella[k].respond(context.inverses[k], &flows[k], context.motion[k].kappa));
        for ((q, a), b) in missing.into_iter().zip(first).zip(second) {
            let pair = &self.pairs[q];
            self.columns[q] = Some(Column { answers: [a, b], normal: pair.normal, at: pair.at });
        }
    }
}

/// Nodes of both rods in the body frame.
pub fn update_lines(flagella: &[Flagellum; 2], shafts: &[Shaft; 2], lines: &mut Lines) {
    for k in 0..2 {
        for (slot, x) in lines[k].iter_mut().zip(&flagella[k].shape.nodes) {
            *slot = shafts[k].point_to_body(*x);
        }
    }
}

/// Flow (m/s, shaft frames) at the nodes of both rods for a unit normal force in a pair.
fn flow_of_pair(pair: &Pair, flagella: &mut [Flagellum; 2], context: &Context) -> [Vec<V3>; 2] {
    let mut density: [Vec<V3>; 2] = [0, 1].map(|k| vec![V3::zeros(); context.rods[k].nodes()]);
    for (rod, node, weight) in pair.weights() {
        if node >= CLAMPED {
            density[rod][node] +=
                context.shafts[rod].to_shaft(pair.normal) * (weight / context.rods[rod].nodal_length[node]);
        }
    }
    // Gauss points of the edges that carry the density, in both shaft frames.
    let mut seen = [Sources::default(), Sources::default()];
    for (k, density) in density.iter().enumerate() {
        let nodes = &flagella[k].shape.nodes;
        let loaded = |e: usize| density[e] != V3::zeros() || density[e + 1] != V3::zeros();
        for e in (0..nodes.len() - 1).filter(|&e| loaded(e)) {
            let (x, dx) = (nodes[e], nodes[e + 1] - nodes[e]);
            let (f, df) = (density[e], density[e + 1] - density[e]);
            let length = dx.norm();
            for (point, weight) in flagella[k].rule() {
                let (at, force) = (x + dx * *point, (f + df * *point) * (weight * length));
                let body = (context.shafts[k].point_to_body(at), context.shafts[k].to_body(force));
                for (shaft, sources) in context.shafts.iter().zip(&mut seen) {
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

/// Friction of a pair from its present sliding velocity; `answer`: displacement for a unit force, m/N.
fn rub(pair: &mut Pair, flagella: &[Flagellum; 2], context: &Context, answer: f64, limits: &Limits) {
    if pair.force <= 0.0 {
        pair.friction = V3::zeros();
        return;
    }
    let mut velocity = V3::zeros();
    for (rod, node, weight) in pair.weights() {
        let v = flagella[rod].velocity(&context.motion[rod], node);
        velocity += context.shafts[rod].to_body(v) * weight;
    }
    velocity -= pair.normal * velocity.dot(&pair.normal);
    let kappa = context.motion[pair.rods[0]].kappa.max(context.motion[pair.rods[1]].kappa);
    let per_newton = answer.max(0.0) * kappa;
    let free = velocity - pair.friction * per_newton;
    let wanted = friction::implicit_force(free, per_newton, limits.friction * pair.force, limits.slip);
    pair.friction = wanted - pair.normal * wanted.dot(&pair.normal);
}
