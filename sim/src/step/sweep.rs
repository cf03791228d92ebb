//! The sweeps of a step: flagellum 1, flagellum 2, contact, base, until all of them agree.
//!
//! Where a correction of the base is large for a sweep, or for the last one, both flagella move with it at once.

use super::body::BodySolve;
use super::contact::{ContactChange, Contacts};
use super::converge::{Changes, Convergence, SweepErrors, Verdict};
use super::flagellum::{Flagellum, Kinematics};
use super::model::Model;
use super::problem::StepProblem;
use super::report::StepFailure;
use super::surroundings::Surroundings;
use super::{truncation, unknowns};
use crate::V3;
use crate::anderson::Anderson;
use crate::body::Body;
use crate::fluid::Line;
use crate::fluid::far::Sources;

/// Index of the sweep that looks for new pairs: after the first one the shapes are nearly right.
const SEARCH_SWEEP: u32 = 1;
/// Index of the sweep after which the step's error shows.
const ESTIMATE_SWEEP: u32 = 1;

/// Trial shapes and contacts of a step, and the memory of their iteration.
#[derive(Clone, Debug)]
pub struct Sweeps {
    /// Both flagella at their trial shapes.
    pub flagella: [Flagellum; 2],
    /// The pairs and their forces.
    pub contacts: Contacts,
    /// Head and walls, and their flow.
    pub surroundings: Surroundings,
    /// Both flagella in the body frame, for the surroundings.
    lines: Vec<Line>,
    /// Far field of both flagella.
    sources: Sources,
    anderson: Anderson,
    /// Weights of the unknowns, computed on demand.
    weights: Vec<f64>,
}

/// How an iteration converged.
#[derive(Clone, Copy, Debug)]
pub struct Converged {
    /// Sweeps taken.
    pub sweeps: u32,
    /// Velocity residual before the last correction, m/s.
    pub residual: f64,
}

impl Sweeps {
    /// Returns flagella at rest without contact.
    pub fn new(model: &Model) -> Self {
        Self {
            flagella: [0, 1].map(|k| Flagellum::new(&model.robot, &model.rods[k])),
            contacts: Contacts::new(model),
            surroundings: model.surroundings(),
            lines: vec![Line::default(); model.rods.len()],
            sources: Sources::default(),
            anderson: Anderson::default(),
            weights: Vec::new(),
        }
    }

    /// Solves a step from its predicted shapes and the predicted motion of the base.
    ///
    /// # Errors
    /// [`StepFailure::Stalled`] and [`StepFailure::Diverged`].
    pub fn solve(
        &mut self,
        problem: &StepProblem,
        body: &mut BodySolve,
        hopeless_error: f64,
    ) -> Result<Converged, StepFailure> {
        let mut convergence = Convergence::new(problem);
        self.begin(problem, body);
        for sweep in 0..problem.model.robot.solver.sweeps {
            self.contacts.hold_geometry(sweep);
            if sweep == SEARCH_SWEEP {
                self.contacts.extend(problem, &self.flagella);
            }
            let contact = !self.contacts.pairs.is_empty();
            let before = (contact || sweep > 0).then(|| self.unknowns(body));
            // The residual of this sweep includes the change.
            let flow_change = if sweep > 0 { self.update_surroundings(problem, &body.body) } else { 0.0 };
            let motion = problem.kinematics(body.body.rate);

            let residual = self.sweep_rods(problem, &motion, body, convergence.twist_lever());
            if convergence.diverges(residual) {
                return Err(StepFailure::Diverged);
            }
            let change = match contact {
                true => self.contacts.sweep(problem, &motion, &mut self.flagella)?,
                false => ContactChange::default(),
            };
            let contact_motion = change.motion * motion[0].kappa.max(motion[1].kappa);
            let errors = SweepErrors { residual, contact_motion, friction: change.friction, gap: change.gap_error };

            let converged = convergence.rods_converged(sweep, &errors);
            let accelerated = match before {
                Some(before) if !converged => self.accelerate(problem, &before, body, convergence.is_slow(residual)),
                _ => false,
            };
            if contact || accelerated {
                self.update_forces(problem, body);
            }
            let change = if problem.model.two_way() { self.sweep_base(problem, body)? } else { V3::zeros() };
            if sweep == ESTIMATE_SWEEP {
                let error = truncation::error(&self.flagella, problem, &body.body);
                if error > hopeless_error {
                    return Err(StepFailure::Unresolved { error, allowed: hopeless_error });
                }
            }

            let verdict = convergence.judge(sweep, errors, Changes { rate: change.norm(), flow: flow_change });
            if convergence.is_to_be_followed(change.norm(), verdict) {
                self.follow_base(problem, body, change);
            }
            match verdict {
                Verdict::Continue => {}
                Verdict::Stalled => break,
                Verdict::Converged if self.contacts.complete(problem, &mut self.flagella) => {
                    return Ok(Converged { sweeps: sweep + 1, residual });
                }
                Verdict::Converged => {
                    self.update_forces(problem, body);
                    convergence.restart(sweep);
                }
            }
        }
        Err(convergence.failure())
    }

    /// Prepares the first sweep at the predicted shapes.
    fn begin(&mut self, problem: &StepProblem, body: &mut BodySolve) {
        for (flagellum, start) in self.flagella.iter_mut().zip(&problem.state.rods) {
            flagellum.begin(start);
        }
        self.contacts.begin(problem, &mut self.flagella);
        self.update_forces(problem, body);
        if !self.surroundings.is_empty() {
            self.write_lines(problem);
            self.surroundings.begin(&self.lines, &problem.model.flagella_base(&body.body));
            self.read_flow(problem);
        }
        if problem.model.two_way() {
            body.set_response(&problem.step.shafts, problem.inverses.map(|inverse| &inverse.response.load));
        }
        self.anderson.clear();
        self.weights.clear();
    }

    fn update_forces(&mut self, problem: &StepProblem, body: &BodySolve) {
        for (k, flagellum) in self.flagella.iter_mut().enumerate() {
            problem.update_forces(flagellum, k, &body.body);
        }
    }

    /// Corrects one rod after the other, each in the flow of the other's latest shape. Returns the larger residual
    /// before the corrections, m/s. `lever`: velocity equivalent to a twist error of one radian, m/s.
    fn sweep_rods(&mut self, problem: &StepProblem, motion: &[Kinematics; 2], body: &BodySolve, lever: f64) -> f64 {
        let shafts = &problem.step.shafts;
        let contact = !self.contacts.pairs.is_empty();
        let mut residual = 0f64;
        for k in 0..2 {
            let other = 1 - k;
            self.sources.clear();
            self.flagella[k].push_own_sources(&mut self.sources);
            self.flagella[other].push_sources(&shafts[other], &shafts[k], &mut self.sources);
            let flagellum = &mut self.flagella[k];
            let size = flagellum.update_residual(&problem.model.rods[k], &motion[k], &self.sources, lever);
            residual = residual.max(size);
            flagellum.correct(problem.inverses[k]);
            // With contact, forces are updated after the contact's half of the sweep.
            if !contact {
                problem.update_forces(flagellum, k, &body.body);
            }
        }
        residual
    }

    /// Updates the surroundings with the flagella's latest forces, and their flow at the flagella. Returns the flow's
    /// largest change, m/s.
    fn update_surroundings(&mut self, problem: &StepProblem, body: &Body) -> f64 {
        if self.surroundings.is_empty() {
            return 0.0;
        }
        self.write_lines(problem);
        let change = self.surroundings.update(&self.lines, &problem.model.flagella_base(body));
        self.read_flow(problem);
        change
    }

    /// Returns whether the solved robot touches the tank.
    pub fn touch_tank(&mut self, problem: &StepProblem, body: &Body) -> bool {
        if problem.model.robot.tank.is_none() {
            return false;
        }
        self.write_lines(problem);
        self.surroundings.touch_tank(&self.lines, &problem.model.flagella_base(body))
    }

    /// Writes the flagella's trial shapes and forces in the body frame.
    fn write_lines(&mut self, problem: &StepProblem) {
        for ((flagellum, shaft), line) in self.flagella.iter().zip(&problem.step.shafts).zip(&mut self.lines) {
            flagellum.write_line(shaft, line);
        }
    }

    /// Copies the surroundings' flow at the nodes to the flagella.
    fn read_flow(&mut self, problem: &StepProblem) {
        let mut flow = self.surroundings.flow.iter();
        for (flagellum, shaft) in self.flagella.iter_mut().zip(&problem.step.shafts) {
            for (slot, u) in flagellum.surrounding_flow.iter_mut().zip(flow.by_ref()) {
                *slot = shaft.to_shaft(*u);
            }
        }
    }

    /// Corrects the base's rate. Returns its change, rad/s.
    fn sweep_base(&mut self, problem: &StepProblem, body: &mut BodySolve) -> Result<V3, StepFailure> {
        let moment = problem.flagella_moment(&self.flagella, &body.body) + self.surroundings.induced_moment();
        body.update(&problem.model.base, moment).ok_or(StepFailure::Diverged)
    }

    /// Corrects both flagella by their response to a change of the base's rate, rad/s.
    fn follow_base(&mut self, problem: &StepProblem, body: &BodySolve, change: V3) {
        for (k, flagellum) in self.flagella.iter_mut().enumerate() {
            let (velocity, rotation) = problem.base_motion(k, change);
            flagellum.follow_base(problem.inverses[k], velocity, rotation);
        }
        self.update_forces(problem, body);
    }

    fn unknowns(&self, body: &BodySolve) -> Vec<f64> {
        unknowns::pack(&self.flagella, body, &self.contacts.pairs)
    }

    /// Records a sweep and, if the iteration is slow, replaces its result by a combination of the last iterates.
    /// Returns whether it did.
    fn accelerate(&mut self, problem: &StepProblem, before: &[f64], body: &mut BodySolve, slow: bool) -> bool {
        let (model, step) = (problem.model, problem.step);
        let after = self.unknowns(body);
        if self.weights.len() != after.len() {
            self.weights = unknowns::weights(model, step.length, self.contacts.pairs.len());
        }
        self.anderson.record(before, after, &self.weights);
        let Some(combined) = slow.then(|| self.anderson.combine()).flatten() else {
            return false;
        };
        unknowns::unpack(&combined, model.two_way(), &mut self.flagella, body, &mut self.contacts.pairs);
        self.contacts.update(&mut self.flagella, &step.shafts);
        true
    }
}
