//! The sweeps of a step.

use super::body_solve::BodySolve;
use super::contact_sweep::{self, Context, update_lines};
use super::flagellum::Kinematics;
use super::preconditioner::Preconditioner;
use super::{Plan, Solver, StepFailure, StepReport};
use crate::V3;
use crate::contact::pairs::{self};
use crate::robot::body::Body;
use crate::state::{Shape, State};
use std::sync::Arc;

/// A twist error of one radian counts as this many times the largest speed of the helix.
const TWIST_LEVER: f64 = 5.0;
/// Sweeps after which closest points and normals are held.
const GEOMETRY_SWEEPS: u32 = 4;
/// Tolerance of steps of meshing flagella, over that of other steps.
const MESHING_TOLERANCE: f64 = 4.0;
/// How often held points may be renewed when the true distances disagree.
const RENEWALS: u32 = 6;

impl Solver {
    fn motion(&self, plan: &Plan, rate: V3) -> [Kinematics; 2] {
        let rate = if self.closure.two_way() { rate } else { V3::zeros() };
        [0, 1].map(|k| Kinematics {
            base_velocity: plan.shafts[k].to_shaft(rate.cross(&self.feet[k])),
            rotation: plan.shafts[k].to_shaft(rate) + V3::z() * plan.motors[k].speed,
            kappa: plan.kappa[k],
        })
    }

    /// Down in the body frame: on a base that is held for its flagella, along its axis.
    pub(super) fn down(&self, body: &Body) -> V3 {
        if self.closure.two_way() { body.attitude.inverse_transform_vector(&-V3::z()) } else { -V3::z() }
    }

    pub(super) fn update_forces(&mut self, state: &State, plan: &Plan, down: V3, k: usize) {
        let weight = plan.shafts[k].to_shaft(down) * self.robot.net_weight();
        self.flagella[k].update_forces(&self.rods[k], &state.rods[k], weight);
    }

    /// Sweeps until all agree. Returns the predicted shapes beside the report.
    pub(super) fn iterate(
        &mut self,
        state: &State,
        plan: &Plan,
        inverses: &[Arc<Preconditioner>; 2],
        body: &mut BodySolve,
    ) -> Result<(StepReport, [Shape; 2]), StepFailure> {
        let settings = self.robot.solver.clone();
        let predicted = [self.flagella[0].shape.clone(), self.flagella[1].shape.clone()];
        let helix = self.robot.flagellum.helix_radius_m.max(self.robot.flagellum.rod_radius_m);
        let fastest = plan.motors.iter().fold(0.1f64, |a, m| a.max(m.speed.abs()));
        let reference = fastest * helix;
        // Where sweeps converge slowly, more steps of fewer sweeps lower the error at the same cost.
        let meshing = !state.pairs.is_empty() && self.meshing(plan.motors.map(|m| m.speed));
        let wanted = settings.tolerance * reference * if meshing { MESHING_TOLERANCE } else { 1.0 };
        // Independent of the step: where the twist is about to snap, a small imbalance may stay.
        let lever = TWIST_LEVER * reference;
        let gap_wanted = 0.25 * self.robot.contact.tolerance_m;
        let reach = self.robot.flagellum.axial_length_m + self.robot.base.height_m;
        let two_way = self.closure.two_way();
        // The body and the other rod lag by one sweep: with one sweep a step, errors below the tolerance
        // would grow from step to step until they reach it.
        let least_sweeps = if two_way { 1 } else { 0 };
        for flagellum in &mut self.flagella {
            flagellum.assemble_near();
        }
        update_lines(&self.flagella, &plan.shafts, &mut self.lines);
        self.begin_contact(state);
        self.contacts.load(&mut self.flagella, &plan.shafts);
        for k in 0..2 {
            self.update_forces(state, plan, self.down(&body.body), k);
        }
        if two_way {
            body.set_response(&plan.shafts, [&inverses[0].response, &inverses[1].response]);
        }
        self.anderson.clear();
        let mut weights: Vec<f64> = Vec::new();
        let (mut best, mut best_at) = (f64::INFINITY, 0);
        let mut previous = f64::INFINITY;
        let mut renewed = 0;
        let mut last = (f64::INFINITY, 0.0);
        for sweep in 0..settings.sweeps {
            self.contacts.frozen = sweep >= GEOMETRY_SWEEPS;
            if sweep == 1 {
                self.extend_contact();
            }
            let contact = !self.contacts.pairs.is_empty();
            let before = (contact || sweep > 0).then(|| self.pack(body));
            let motion = self.motion(plan, body.body.rate);
            let mut residual = 0f64;
            for k in 0..2 {
                let other = 1 - k;
                self.sources.clear();
                self.flagella[other].push_sources(&plan.shafts[other], &plan.shafts[k], &mut self.sources);
                let size = self.flagella[k].update_residual(&self.rods[k], &motion[k], &self.sources, lever);
                residual = residual.max(size);
                self.flagella[k].precondition(&inverses[k]);
                self.flagella[k].apply_correction();
                if !contact {
                    self.update_forces(state, plan, self.down(&body.body), k);
                }
            }
            if residual >= 1e3 * reference {
                return Err(StepFailure::Diverged);
            }
            let mut outcome = contact_sweep::Outcome::default();
            if contact {
                update_lines(&self.flagella, &plan.shafts, &mut self.lines);
                let context = Context {
                    rods: &self.rods,
                    shafts: &plan.shafts,
                    motion: &motion,
                    inverses: [&*inverses[0], &*inverses[1]],
                };
                outcome = self.contacts.sweep(&mut self.flagella, &context, &mut self.lines, &self.limits);
                self.contacts.load(&mut self.flagella, &plan.shafts);
            }
            let moved = outcome.motion * plan.kappa[0].max(plan.kappa[1]);
            let settled =
                sweep >= least_sweeps && residual < wanted && moved < 6.0 * wanted && outcome.violation < gap_wanted;
            let mut combined = false;
            if let Some(before) = before.filter(|_| !settled) {
                let after = self.pack(body);
                if weights.len() != after.len() {
                    weights = self.weights(plan.step);
                }
                self.anderson.record(&before, after, &weights);
                if sweep >= 1
                    && residual > 0.3 * previous
                    && let Some(iterate) = self.anderson.combine()
                {
                    combined = true;
                    self.unpack(&iterate, body);
                    update_lines(&self.flagella, &plan.shafts, &mut self.lines);
                    self.contacts.refresh(&self.lines);
                    self.contacts.load(&mut self.flagella, &plan.shafts);
                }
            }
            if contact || combined {
                for k in 0..2 {
                    self.update_forces(state, plan, self.down(&body.body), k);
                }
            }
            let mut turned = 0.0;
            if two_way {
                let moment = self.flagella_moment(plan, &body.body);
                let change = body.update(&self.base, moment).ok_or(StepFailure::Diverged)?;
                turned = change.norm() * reach;
            }
            let converged = settled && turned < 3.0 * wanted;
            previous = residual;
            last = (residual, outcome.violation);
            if !outcome.motion.is_finite() {
                return Err(StepFailure::Diverged);
            }
            if converged {
                if self.contact_complete(&mut renewed, plan, state, body) {
                    let report = StepReport { sweeps: sweep + 1, residual, ..StepReport::default() };
                    return Ok((report, predicted));
                }
                (best, best_at) = (f64::INFINITY, sweep);
                continue;
            }
            let measure = residual.max(0.3 * moved);
            if measure < 0.8 * best {
                (best, best_at) = (measure, sweep);
            } else if sweep > best_at + 6 || (measure > 30.0 * best && sweep > 3) {
                break;
            }
        }
        Err(StepFailure::Stalled { residual: last.0, wanted, gap: last.1 })
    }

    /// Moment of both flagella on the base about the joint, body axes. Contact between them cancels.
    fn flagella_moment(&self, plan: &Plan, body: &Body) -> V3 {
        let mut moment = V3::zeros();
        for k in 0..2 {
            moment += self.flagella[k].fluid_load(&self.rods[k], &plan.shafts[k]).moment;
            if self.robot.base.flagella_weight_on_base {
                moment += self.weight_load(plan, self.down(body), k).moment;
            }
        }
        moment
    }

    /// Distance of centre lines below which edges are watched.
    fn watched(&self) -> f64 {
        self.limits.distance + 0.5 * self.robot.flagellum.rod_radius_m
    }

    fn begin_contact(&mut self, state: &State) {
        let found =
            if self.robot.contact.enabled { self.broad.search(&self.lines, self.watched()) } else { Vec::new() };
        let edge = self.rods[0].rest_length[0];
        let pairs = pairs::hand_over(&state.pairs, found, edge, self.limits.distance);
        self.contacts.begin(pairs, state.contact_stiffness);
    }

    /// Adds pairs that have come close within the step; returns how many of them overlap.
    fn extend_contact(&mut self) -> usize {
        if !self.robot.contact.enabled {
            return 0;
        }
        update_lines(&self.flagella, &self.shafts, &mut self.lines);
        let found = self.broad.search(&self.lines, self.watched());
        let overlap = 0.3 * self.robot.contact.tolerance_m;
        let added = pairs::extend(&mut self.contacts.pairs, found, self.limits.distance, overlap);
        self.contacts.grow();
        added
    }

    /// Whether the pairs that were solved are all that matter, and their held geometry is the true one.
    fn contact_complete(&mut self, renewed: &mut u32, plan: &Plan, state: &State, body: &BodySolve) -> bool {
        let mut complete = self.extend_contact() == 0;
        if self.contacts.frozen && *renewed < RENEWALS {
            let slack = 0.5 * self.robot.contact.tolerance_m;
            let wrong = self.contacts.pairs.iter().any(|p| {
                let allowed = self.limits.distance - p.force / self.contacts.stiffness - slack;
                p.true_distance(&self.lines) < allowed
            });
            if wrong {
                *renewed += 1;
                complete = false;
                self.contacts.frozen = false;
                self.contacts.refresh(&self.lines);
            }
        }
        if !complete {
            self.contacts.load(&mut self.flagella, &plan.shafts);
            for k in 0..2 {
                self.update_forces(state, plan, self.down(&body.body), k);
            }
        }
        complete
    }
}
