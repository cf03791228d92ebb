//! Acceptance of a solved step: checks for finite numbers and for rods that passed through each other; then its loads
//! and the new state.

use super::body::BodySolve;
use super::formula::POINTS;
use super::model::Model;
use super::problem::StepProblem;
use super::report::{StepFailure, StepReport};
use super::state::{Past, State};
use super::sweep::{Converged, Sweeps};
use super::time_step::TimeStep;
use crate::V3;
use crate::body::Body;
use crate::body::closure::flagella_moment;
use crate::body::load::Load;
use crate::body::shaft::Shaft;
use crate::contact::pairs::Lines;
use crate::params::Closure;

/// Checks a solved step.
///
/// # Errors
/// [`StepFailure::Diverged`], [`StepFailure::PassedThrough`] and [`StepFailure::TouchesTank`].
pub fn check(sweeps: &mut Sweeps, problem: &StepProblem, body: &BodySolve) -> Result<(), StepFailure> {
    let (model, step) = (problem.model, problem.step);
    if !sweeps.flagella.iter().all(|f| f.shape.is_finite()) || !body.is_finite() {
        return Err(StepFailure::Diverged);
    }
    sweeps.contacts.update_lines(&sweeps.flagella, &step.shafts);
    if model.limits.enabled {
        let before = lines(model, problem.state);
        let radius = model.robot.flagellum.rod_radius_m;
        if sweeps.contacts.passed_through(&sweeps.flagella, &before, problem.state, radius) {
            return Err(StepFailure::PassedThrough);
        }
    }
    if sweeps.touch_tank(problem, &body.body) {
        return Err(StepFailure::TouchesTank);
    }
    Ok(())
}

/// Returns the report of a solved step, with its loads and without its error, and the base at its end.
///
/// # Errors
/// [`StepFailure::Diverged`] if a one-way closure has no solution for the base.
pub fn finish(
    sweeps: &Sweeps,
    problem: &StepProblem,
    body: &BodySolve,
    converged: Converged,
) -> Result<(StepReport, Body), StepFailure> {
    let (model, shafts) = (problem.model, &problem.step.shafts);
    let Sweeps { flagella, contacts, surroundings, .. } = sweeps;
    let motion = problem.kinematics(body.body.rate);
    let fluid = [0, 1].map(|k| flagella[k].fluid_load(&model.rods[k], &shafts[k], &motion[k]));
    let contact = contacts.loads(&model.feet);
    let (next, moment_error) = match model.closure {
        Closure::Full => (body.finish(), body.error),
        Closure::Held => (problem.state.body, 0.0),
        Closure::Lumped | Closure::Paper => {
            let loads = [0, 1].map(|k| Load {
                force: fluid[k].force + contact[k].force,
                moment: fluid[k].moment + contact[k].moment,
                axial_torque: fluid[k].axial_torque + contact[k].axial_torque,
            });
            let mut moment = flagella_moment(model.closure, &loads, model.robot.base.motor_distance_m);
            if model.closure == Closure::Lumped {
                moment += surroundings.induced_moment();
            }
            let mut alone = BodySolve::new(problem.state, problem.step);
            if !alone.solve(&model.base, moment) {
                return Err(StepFailure::Diverged);
            }
            (alone.finish(), alone.error)
        }
    };
    // The weight acts at the base's own attitude, even if the flagella are computed for a base held still.
    let down = next.attitude.inverse_transform_vector(&-V3::z());
    let pressing = || contacts.pairs.iter().filter(|p| p.force > 0.0);
    let report = StepReport {
        sweeps: converged.sweeps,
        residual: converged.residual,
        error: 0.0,
        touching: pressing().count() as u32,
        between: pressing().filter(|p| p.rods[0] != p.rods[1]).count() as u32,
        largest_force: contacts.pairs.iter().fold(0.0, |a, p| a.max(p.force)),
        fluid,
        head: surroundings.load(),
        contact,
        weight: [0, 1].map(|k| model.weight(k, &flagella[k].shape.nodes, &shafts[k], down)),
        moment_error,
    };
    Ok((report, next))
}

/// Makes a solved step the new state.
pub fn commit(sweeps: &Sweeps, model: &Model, step: &TimeStep, next: Body, report: &StepReport, state: &mut State) {
    let past = Past {
        time: state.time,
        shapes: [0, 1].map(|k| state.rods[k].shape.clone()),
        attitude: state.body.attitude,
        rate: state.body.rate,
    };
    state.past.insert(0, past);
    state.past.truncate(POINTS - 1);
    for (rod, flagellum) in state.rods.iter_mut().zip(&sweeps.flagella) {
        rod.shape.clone_from(&flagellum.shape);
        flagellum.frames.accept(&mut rod.frames);
    }
    state.time = step.time;
    state.motors = step.motors;
    state.body = next;
    state.pairs.clone_from(&sweeps.contacts.pairs);
    state.contact_stiffness = model.limits.stiffness_after(state.contact_stiffness, report.largest_force);
}

/// Returns the nodes of both flagella of a state in the body frame, m.
pub fn lines(model: &Model, state: &State) -> Lines {
    [0, 1].map(|k| {
        let shaft = Shaft::new(model.feet[k], state.motors[k].angle);
        state.rods[k].shape.nodes.iter().map(|x| shaft.point_to_body(*x)).collect()
    })
}
