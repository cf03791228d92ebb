//! The contact half of a sweep: the forces of all close pairs together, and both rods' displacement by them.
//!
//! The columns of [`super::compliance`] turn the gap law into a small linear complementarity problem in the forces.

use super::compliance::{Column, columns};
use super::flagellum::{Flagellum, Kinematics};
use super::model::Model;
use super::problem::StepProblem;
use super::report::StepFailure;
use super::state::State;
use crate::V3;
use crate::body::load::Load;
use crate::body::shaft::Shaft;
use crate::contact::broad_phase::BroadPhase;
use crate::contact::pairs::{self, Lines, Pair};
use crate::contact::{complementarity, friction};
use crate::functions::{exp, powi};
use crate::rod::CLAMPED;

/// Sweeps after which closest points and normals are held, because they may alternate.
const GEOMETRY_SWEEPS: u32 = 4;
/// Largest number of times that held points are renewed because the true distances disagree.
const RENEWALS: u32 = 6;
/// Gaps that the complementarity problem need not resolve, m: a thousandth of the default tolerance.
const LAW_ERROR: f64 = 1e-8;
/// Edges that went through each other within one step are still within this many radii; the coils of one helix are not.
const PASSAGE_RADII: f64 = 3.0;

/// The pairs of a step.
#[derive(Clone, Debug)]
pub struct Contacts {
    /// The pairs, with their forces.
    pub pairs: Vec<Pair>,
    /// Centre lines of both rods at the trial shapes, body frame, m.
    lines: Lines,
    /// Contact stiffness k, N/m.
    stiffness: f64,
    /// Whether closest points and normals are held.
    held: bool,
    renewals: u32,
    /// One for each pair, once it has been active.
    columns: Vec<Option<Column>>,
    broad_phase: BroadPhase,
}

/// The effect of contact in a sweep.
#[derive(Clone, Copy, Debug, Default)]
pub struct ContactChange {
    /// Largest error of the gap law after the sweep, m.
    pub gap_error: f64,
    /// Largest displacement of a node, m.
    pub motion: f64,
    /// Largest change of a friction force, as the velocity that it causes at its edges, m/s.
    pub friction: f64,
}

impl Contacts {
    /// Returns contacts without pairs.
    pub fn new(model: &Model) -> Self {
        let rods = &model.rods;
        Self {
            pairs: Vec::new(),
            lines: [rods[0].shape.clone(), rods[1].shape.clone()],
            stiffness: 0.0,
            held: false,
            renewals: 0,
            columns: Vec::new(),
            broad_phase: BroadPhase::new(rods, model.robot.flagellum.rod_radius_m),
        }
    }

    /// Returns the least distance of two centre lines (body frame, m).
    pub fn least_distance(&mut self, lines: &Lines) -> f64 {
        self.broad_phase.least_distance(lines)
    }

    /// Finds the pairs of a step at the predicted shapes; their forces start from those of the step before.
    pub fn begin(&mut self, problem: &StepProblem, flagella: &mut [Flagellum; 2]) {
        let (limits, edge) = (&problem.model.limits, problem.model.rods[0].rest_length[0]);
        self.update_lines(flagella, &problem.step.shafts);
        let found = if limits.enabled {
            self.broad_phase.search(&self.lines, shapes(flagella), limits.watched)
        } else {
            Vec::new()
        };
        self.pairs = pairs::warm_start(&problem.state.pairs, found, edge, limits.distance);
        self.columns.clear();
        self.columns.resize(self.pairs.len(), None);
        self.stiffness = problem.state.contact_stiffness;
        self.renewals = 0;
        self.load(flagella, &problem.step.shafts);
    }

    /// Adds pairs that have come close within the step. Returns how many of them overlap too far to be left out.
    pub fn extend(&mut self, problem: &StepProblem, flagella: &[Flagellum; 2]) -> usize {
        let limits = &problem.model.limits;
        if !limits.enabled {
            return 0;
        }
        self.update_lines(flagella, &problem.step.shafts);
        let found = self.broad_phase.search(&self.lines, shapes(flagella), limits.watched);
        let overlapping = pairs::extend(&mut self.pairs, found, limits.distance, limits.overlap);
        self.columns.resize(self.pairs.len(), None);
        overlapping
    }

    /// Holds closest points and normals from sweep `GEOMETRY_SWEEPS` on.
    pub fn hold_geometry(&mut self, sweep: u32) {
        self.held = sweep >= GEOMETRY_SWEEPS;
    }

    /// Solves for the forces of all pairs and moves both rods.
    ///
    /// # Errors
    /// Forces or displacements that no contact can have.
    pub fn sweep(
        &mut self,
        problem: &StepProblem,
        motion: &[Kinematics; 2],
        flagella: &mut [Flagellum; 2],
    ) -> Result<ContactChange, StepFailure> {
        let (limits, shafts) = (&problem.model.limits, &problem.step.shafts);
        self.update_lines(flagella, shafts);
        self.refresh();
        let active: Vec<usize> = (0..self.pairs.len())
            .filter(|&q| {
                let p = &self.pairs[q];
                p.force > 0.0 || p.distance - limits.distance < limits.active_gap
            })
            .collect();
        let touches = |p: &Pair| p.force > 0.0 || p.distance < limits.distance;
        if !active.iter().any(|&q| touches(&self.pairs[q])) {
            self.load(flagella, shafts);
            return Ok(ContactChange::default());
        }
        self.fill_columns(&active, problem, flagella);
        let (matrix, gaps) = self.gap_law(&active, problem);
        let before: Vec<f64> = active.iter().map(|&q| self.pairs[q].force).collect();
        let mut forces = before.clone();
        complementarity::solve(&matrix, &gaps, &mut forces, LAW_ERROR);
        if forces.iter().any(|f| f.is_nan() || *f >= limits.largest_force) {
            return Err(StepFailure::Diverged);
        }
        let changes: Vec<f64> = forces.iter().zip(&before).map(|(after, before)| after - before).collect();
        let displacement = self.displace(&active, &changes, flagella);
        for (&q, force) in active.iter().zip(&forces) {
            self.pairs[q].force = *force;
        }
        self.update_lines(flagella, shafts);
        self.refresh();
        let mut friction = 0f64;
        if limits.friction > 0.0 {
            let size = active.len();
            for (row, &q) in active.iter().enumerate() {
                // Neighbouring pairs slide together: the compliance to all of them keeps the iteration stable.
                let pressing = (0..size).filter(|&c| forces[c] > 0.0);
                let twist = twist_compliance(&self.pairs[q], pressing.clone().map(|c| &self.pairs[active[c]]), problem);
                let compliance = pressing.map(|c| matrix[row * size + c].abs()).sum::<f64>() + twist;
                let pair = &mut self.pairs[q];
                let kappa = motion[pair.rods[0]].kappa.max(motion[pair.rods[1]].kappa);
                let change = update_friction(pair, compliance * kappa, problem, motion, flagella);
                friction = friction.max(change * matrix[row * size + row] * kappa);
            }
        }
        self.load(flagella, shafts);
        if !displacement.is_finite() {
            return Err(StepFailure::Diverged);
        }
        Ok(ContactChange { gap_error: self.gap_error(limits.distance), motion: displacement, friction })
    }

    /// Updates the pairs after a change of shapes and forces from outside.
    pub fn update(&mut self, flagella: &mut [Flagellum; 2], shafts: &[Shaft; 2]) {
        self.update_lines(flagella, shafts);
        self.refresh();
        self.load(flagella, shafts);
    }

    /// Returns whether the solved pairs are all that matter and their held geometry is correct; if not, more sweeps are
    /// needed.
    pub fn complete(&mut self, problem: &StepProblem, flagella: &mut [Flagellum; 2]) -> bool {
        let limits = &problem.model.limits;
        let mut complete = self.extend(problem, flagella) == 0;
        if self.held && self.renewals < RENEWALS {
            let wrong = self.pairs.iter().any(|p| {
                let allowed = limits.distance - p.force / self.stiffness - limits.held_error;
                p.true_distance(&self.lines) < allowed
            });
            if wrong {
                self.renewals += 1;
                complete = false;
                self.held = false;
                self.refresh();
            }
        }
        if !complete {
            self.load(flagella, &problem.step.shafts);
        }
        complete
    }

    /// Returns whether rods went through each other since the shapes `before` (body frame, m).
    pub fn passed_through(&mut self, flagella: &[Flagellum; 2], before: &Lines, state: &State, radius: f64) -> bool {
        let close = self.broad_phase.search(&self.lines, shapes(flagella), PASSAGE_RADII * radius);
        pairs::passed_through(before, &self.lines, &close, radius)
            || pairs::passed_through(before, &self.lines, &state.pairs, radius)
    }

    /// Returns the loads of contact on the clamps, body axes, moment about the joint. `feet`: body frame, m.
    pub fn loads(&self, feet: &[V3; 2]) -> [Load; 2] {
        let mut loads = [Load::default(); 2];
        for pair in self.pairs.iter().filter(|p| p.force > 0.0) {
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                let rod = pair.rods[side];
                let force = (pair.normal * pair.force + pair.friction) * sign;
                let at = pair.point(&self.lines, side);
                let couple = pair.couple();
                loads[rod].force += force;
                loads[rod].moment += at.cross(&force) + couple;
                let arm = at - feet[rod];
                loads[rod].axial_torque += arm.x * force.y - arm.y * force.x + couple.z;
            }
        }
        loads
    }

    /// Updates the centre lines from the trial shapes.
    pub fn update_lines(&mut self, flagella: &[Flagellum; 2], shafts: &[Shaft; 2]) {
        for k in 0..2 {
            for (slot, x) in self.lines[k].iter_mut().zip(&flagella[k].shape.nodes) {
                *slot = shafts[k].point_to_body(*x);
            }
        }
    }

    /// Updates distances, and closest points and normals unless these are held.
    fn refresh(&mut self) {
        for (pair, column) in self.pairs.iter_mut().zip(&mut self.columns) {
            if self.held {
                pair.refresh_held(&self.lines);
                continue;
            }
            pair.refresh(&self.lines);
            if column.as_ref().is_some_and(|c| c.is_stale(pair)) {
                *column = None;
            }
        }
    }

    /// Puts the forces on the nodes of both rods, shaft frames.
    fn load(&self, flagella: &mut [Flagellum; 2], shafts: &[Shaft; 2]) {
        for flagellum in flagella.iter_mut() {
            flagellum.clear_contact();
        }
        for pair in self.pairs.iter().filter(|p| p.force > 0.0) {
            let force = pair.normal * pair.force + pair.friction;
            for (rod, node, weight) in pair.weights() {
                flagella[rod].contact[node] += shafts[rod].to_shaft(force) * weight;
            }
            if pair.friction != V3::zeros() {
                for (rod, edge) in pair.rods.into_iter().zip(pair.edges) {
                    flagella[rod].add_contact_couple(edge, shafts[rod].to_shaft(pair.couple()));
                }
            }
        }
    }

    /// Computes the missing columns of active pairs.
    fn fill_columns(&mut self, active: &[usize], problem: &StepProblem, flagella: &mut [Flagellum; 2]) {
        let missing: Vec<usize> = active.iter().copied().filter(|&q| self.columns[q].is_none()).collect();
        let pairs: Vec<&Pair> = missing.iter().map(|&q| &self.pairs[q]).collect();
        for (q, column) in missing.iter().zip(columns(&pairs, flagella, problem)) {
            self.columns[*q] = Some(column);
        }
    }

    /// Returns the gap law of the active pairs, gap + lambda/k = C lambda + b: C in m/N row by row, and b in m.
    fn gap_law(&self, active: &[usize], problem: &StepProblem) -> (Vec<f64>, Vec<f64>) {
        let size = active.len();
        let (mut matrix, mut gaps) = (vec![0.0; size * size], vec![0.0; size]);
        for (row, &q) in active.iter().enumerate() {
            let pair = &self.pairs[q];
            gaps[row] = pair.distance - problem.model.limits.distance;
            for (rod, node, weight) in pair.weights() {
                if node < CLAMPED {
                    continue;
                }
                let direction = problem.step.shafts[rod].to_shaft(pair.normal) * weight;
                let at = 3 * (node - CLAMPED);
                for (c, &other) in active.iter().enumerate() {
                    if let Some(column) = &self.columns[other] {
                        let moved = &column.compliance[rod][at..at + 3];
                        matrix[row * size + c] +=
                            direction.x * moved[0] + direction.y * moved[1] + direction.z * moved[2];
                    }
                }
            }
        }
        for row in 0..size {
            gaps[row] -= (0..size).map(|c| matrix[row * size + c] * self.pairs[active[c]].force).sum::<f64>();
            matrix[row * size + row] += 1.0 / self.stiffness;
        }
        (matrix, gaps)
    }

    /// Moves both rods by changes of the forces (N). Returns the largest displacement of a node, m.
    fn displace(&self, active: &[usize], changes: &[f64], flagella: &mut [Flagellum; 2]) -> f64 {
        let mut largest = 0f64;
        for (k, flagellum) in flagella.iter_mut().enumerate() {
            let mut sum = vec![0.0; 4 * flagellum.shape.nodes.len() - 2];
            for (&q, change) in active.iter().zip(changes) {
                if let (true, Some(column)) = (*change != 0.0, &self.columns[q]) {
                    for (s, a) in sum.iter_mut().zip(&column.compliance[k]) {
                        *s += change * a;
                    }
                }
            }
            let free = 3 * (flagellum.shape.nodes.len() - CLAMPED);
            let moved = sum[..free].iter().fold(0f64, |a, v| a.max(v.abs()));
            if moved > 0.0 {
                flagellum.apply(&sum);
                largest = largest.max(moved);
            }
        }
        largest
    }

    /// Returns the largest error of the gap law at the present distances, m.
    fn gap_error(&self, contact_distance: f64) -> f64 {
        (self.pairs.iter())
            .map(|p| {
                let gap = p.distance - contact_distance + p.force / self.stiffness;
                if p.force > 0.0 { gap.abs() } else { -gap }
            })
            .fold(0.0, f64::max)
    }
}

/// Returns the nodes of both rods, shaft frames, m.
fn shapes(flagella: &[Flagellum; 2]) -> [&[V3]; 2] {
    [&flagella[0].shape.nodes, &flagella[1].shape.nodes]
}

/// Returns the displacement of a pair's surfaces per friction force, m/N, from the twist that the pair and its neighbours
/// cause.
fn twist_compliance<'a>(pair: &Pair, pressing: impl Iterator<Item = &'a Pair> + Clone, problem: &StepProblem) -> f64 {
    let model = problem.model;
    let drag = model.robot.spin_drag();
    let twist = |side: usize| {
        let (rod, kappa) = (&model.rods[pair.rods[side]], problem.step.kappa(pair.rods[side]));
        let edge = pair.edges[side];
        let [above, below] = [0..edge, edge..rod.edges()].map(|part| rod.rest_length[part].iter().sum());
        let twist = rod.stiffness.twist_nm2;
        let apart = |other: &Pair| edge.abs_diff(other.edges[side]) as f64 * rod.rest_length[0];
        let neighbours: f64 = pressing.clone().map(|p| exp(-apart(p) / drag.twist_reach(twist, kappa))).sum();
        neighbours * drag.twist_compliance(twist, above, below, kappa)
    };
    powi(0.5 * pair.distance, 2) * (twist(0) + twist(1))
}

/// Updates the friction of a pair by the present sliding velocity of its surfaces. `per_newton`: change of that velocity for
/// a unit force, m/s per N. Returns the size of the change, N.
fn update_friction(
    pair: &mut Pair,
    per_newton: f64,
    problem: &StepProblem,
    motion: &[Kinematics; 2],
    flagella: &[Flagellum; 2],
) -> f64 {
    if pair.force <= 0.0 {
        pair.friction = V3::zeros();
        return 0.0;
    }
    let limits = &problem.model.limits;
    let mut velocity = V3::zeros();
    for (rod, node, weight) in pair.weights() {
        let v = flagella[rod].velocity(&motion[rod], node);
        velocity += problem.step.shafts[rod].to_body(v) * weight;
    }
    // The surfaces are half the distance away from the centre lines, on either side.
    let arm = pair.normal * (0.5 * pair.distance);
    for (rod, edge) in pair.rods.into_iter().zip(pair.edges) {
        let rotation = flagella[rod].edge_rotation(&motion[rod], edge);
        velocity -= problem.step.shafts[rod].to_body(rotation).cross(&arm);
    }
    velocity -= pair.normal * velocity.dot(&pair.normal);
    let free = velocity - pair.friction * per_newton;
    let wanted = friction::implicit_force(free, per_newton, limits.friction * pair.force, limits.slip);
    let before = pair.friction;
    pair.friction = wanted - pair.normal * wanted.dot(&pair.normal);
    (pair.friction - before).norm()
}
