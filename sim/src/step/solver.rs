//! The solver: one step from a state to the next.

use super::body::BodySolve;
use super::inverses::{Cache, Linearisation};
use super::model::Model;
use super::predict::predict;
use super::problem::StepProblem;
use super::report::{StepFailure, StepReport};
use super::rest::InversesAtRest;
use super::state::{RodState, State};
use super::sweep::Sweeps;
use super::time_step::{Attempt, TimeStep};
use super::{accept, truncation};
use crate::contact::pairs::Lines;
use crate::params::{Closure, ParamError, Robot, SolverSettings};
use crate::rod::Rod;

/// Solves steps of one robot with one closure. All data that affect results are in [`State`], not in the solver.
#[derive(Clone, Debug)]
pub struct Solver {
    model: Model,
    cache: Cache,
    sweeps: Sweeps,
}

impl Solver {
    /// Checks the parameters and prepares the robot.
    ///
    /// # Errors
    /// A parameter that is impossible.
    pub fn new(robot: &Robot, closure: Closure) -> Result<Self, ParamError> {
        Self::sharing(robot, closure, &InversesAtRest::default())
    }

    /// Checks and prepares a robot with inverses at rest that other solvers use, too.
    ///
    /// # Errors
    /// A parameter that is impossible.
    pub fn sharing(robot: &Robot, closure: Closure, at_rest: &InversesAtRest) -> Result<Self, ParamError> {
        robot.validate()?;
        let edges = robot.flagellum.edges();
        let stiffness = robot.flagellum.stiffness();
        let helix = |k: usize| robot.flagellum.helix(k).nodes(edges);
        let rods = [0, 1].map(|k| Rod::stress_free(helix(k), stiffness).clamped_at_foot());
        Ok(Self::from_model(Model::new(robot, closure, rods)?, at_rest.clone()))
    }

    /// Checks and prepares a robot with flagella of other shapes than the parameters' helices, in their shaft frames;
    /// rods of one handedness must be equal.
    ///
    /// # Errors
    /// A parameter that is impossible.
    pub fn with_rods(robot: &Robot, closure: Closure, rods: [Rod; 2]) -> Result<Self, ParamError> {
        Ok(Self::from_model(Model::new(robot, closure, rods)?, InversesAtRest::default()))
    }

    fn from_model(model: Model, at_rest: InversesAtRest) -> Self {
        Self { sweeps: Sweeps::new(&model), cache: Cache::new(at_rest), model }
    }

    /// Returns the state at rest.
    pub fn at_rest(&self) -> State {
        State::at_rest(&self.model.rods, self.model.limits.stiffness())
    }

    /// Returns the prepared robot.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Sets the lengths and the tolerance of the steps to come; all other settings stay.
    pub(crate) fn set_accuracy(&mut self, settings: &SolverSettings) {
        let SolverSettings { step_error, step_rad, longest_step_s, tolerance, .. } = *settings;
        let own = &mut self.model.robot.solver;
        *own = SolverSettings { step_error, step_rad, longest_step_s, tolerance, ..own.clone() };
    }

    /// Returns the number of frozen inverses used so far.
    pub fn inverses_used(&self) -> usize {
        self.cache.used
    }

    /// Returns the nodes of both flagella in the body frame, m.
    pub fn lines(&self, state: &State) -> Lines {
        accept::lines(&self.model, state)
    }

    /// Returns the least distance of the two centre lines, m.
    pub fn least_distance(&mut self, state: &State) -> f64 {
        let lines = self.lines(state);
        self.sweeps.contacts.least_distance(&lines)
    }

    /// Tries a step. On failure the state is unchanged.
    ///
    /// # Errors
    /// Any [`StepFailure`]; a shorter step may succeed.
    pub fn step(&mut self, state: &mut State, attempt: &Attempt) -> Result<StepReport, StepFailure> {
        let Self { model, sweeps, cache } = self;
        let step = TimeStep::new(state, &model.feet, attempt);
        for (k, flagellum) in sweeps.flagella.iter_mut().enumerate() {
            predict(flagellum, &model.rods[k], k, state, &step);
        }
        let own = attempt.own_inverses.then(|| {
            let trial =
                |k: usize| RodState { shape: sweeps.flagella[k].shape.clone(), frames: state.rods[k].frames.clone() };
            Linearisation::new([0, 1].map(trial))
        });
        let about = own.as_ref().unwrap_or(&state.linearisation);
        let inverses = cache.find(about, model, &step).ok_or(StepFailure::Singular)?;
        let problem = StepProblem { model, state, step: &step, inverses: [&*inverses[0], &*inverses[1]] };
        let mut body = BodySolve::new(state, &step);
        let converged = sweeps.solve(&problem, &mut body, attempt.hopeless_error)?;
        accept::check(sweeps, &problem, &body)?;
        let (mut report, next) = accept::finish(sweeps, &problem, &body, converged)?;
        report.error = truncation::error(&sweeps.flagella, &problem, &next);
        if report.error > attempt.allowed_error {
            return Err(StepFailure::Unresolved { error: report.error, allowed: attempt.allowed_error });
        }
        accept::commit(sweeps, model, &step, next, &report, state);
        if let Some(own) = own {
            state.linearisation = own;
        }
        state.linearisation.record(report.sweeps, report.touching == 0, &state.rods);
        Ok(report)
    }
}
