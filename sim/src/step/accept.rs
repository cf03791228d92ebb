//! What lets a step count: finite numbers, no passage, a resolved motion. Then the new state and its loads.

use super::body_solve::BodySolve;
use super::contact_sweep::update_lines;
use super::formula::POINTS;
use super::{Plan, Solver, StepFailure, StepReport};
use crate::contact::pairs;
use crate::robot::closure::{Closure, Load, flagella_moment};
use crate::state::{Past, Shape, State};

/// Share of a helix radius that the estimated error of a step may reach.
const RESOLVED: f64 = 0.05;
/// The corrected shape differs from the predicted one by about this many times the formula's own error.
const PREDICTION_FACTOR: f64 = 5.0;

impl Solver {
    /// The checks that let a step count, and the new state.
    pub(super) fn accept(
        &mut self,
        state: &mut State,
        plan: &Plan,
        body: BodySolve,
        mut report: StepReport,
        predicted: [Shape; 2],
    ) -> Result<StepReport, StepFailure> {
        let finite = self.flagella.iter().all(|f| f.shape.is_finite());
        if !finite || !body.is_finite() {
            return Err(StepFailure::Diverged);
        }
        update_lines(&self.flagella, &plan.shafts, &mut self.lines);
        if self.robot.contact.enabled {
            let before = self.lines(state);
            let radius = self.robot.flagellum.rod_radius_m;
            // Edges that went through each other within one step are still near; the turns of one helix are not.
            let close = self.broad.search(&self.lines, 3.0 * radius);
            if pairs::passed_through(&before, &self.lines, &close, radius)
                || pairs::passed_through(&before, &self.lines, &state.pairs, radius)
            {
                return Err(StepFailure::PassedThrough);
            }
        }
        if plan.predicted_from == POINTS {
            report.error = (0..2)
                .flat_map(|k| self.flagella[k].shape.nodes.iter().zip(&predicted[k].nodes))
                .map(|(x, p)| (x - p).norm_squared())
                .fold(0.0, f64::max)
                .sqrt()
                / PREDICTION_FACTOR;
            let helix = self.robot.flagellum.helix_radius_m.max(self.robot.flagellum.rod_radius_m);
            let allowed = RESOLVED * helix;
            if report.error > allowed {
                return Err(StepFailure::Unresolved { error: report.error, allowed });
            }
        }
        let fluid = [0, 1].map(|k| self.flagella[k].fluid_load(&self.rods[k], &plan.shafts[k]));
        let contact = self.contact_loads();
        let mut next = body.finish();
        if !self.closure.two_way() && self.closure != Closure::Held {
            let loads = [0, 1].map(|k| Load {
                force: fluid[k].force + contact[k].force,
                moment: fluid[k].moment + contact[k].moment,
                axial_torque: fluid[k].axial_torque + contact[k].axial_torque,
            });
            let moment = flagella_moment(self.closure, &loads, self.robot.base.motor_distance_m);
            let mut alone = BodySolve::new(state, &plan.body_weights, &plan.body_prediction, plan.step);
            if !alone.solve(&self.base, moment) {
                return Err(StepFailure::Diverged);
            }
            next = alone.finish();
            report.moment_error = alone.error();
        } else if self.closure.two_way() {
            report.moment_error = body.error();
        } else {
            next = state.body;
        }
        report.fluid = fluid;
        report.contact = contact;
        report.weight = [0, 1].map(|k| self.weight_load(plan, self.down(&next), k));
        report.touching = self.contacts.pairs.iter().filter(|p| p.force > 0.0).count() as u32;
        report.largest_force = self.contacts.pairs.iter().fold(0.0, |a, p| a.max(p.force));

        let past = Past {
            time: state.time,
            shapes: [0, 1].map(|k| state.rods[k].shape.clone()),
            attitude: state.body.attitude,
            rate: state.body.rate,
        };
        state.past.insert(0, past);
        state.past.truncate(POINTS - 1);
        for k in 0..2 {
            state.rods[k].shape.clone_from(&self.flagella[k].shape);
            self.flagella[k].frames.accept(&mut state.rods[k].frames);
        }
        state.time = plan.time;
        state.motors = plan.motors;
        state.body = next;
        state.pairs.clone_from(&self.contacts.pairs);
        state.steps_since_contact = if report.touching > 0 { 0 } else { state.steps_since_contact.saturating_add(1) };
        // No pair may penetrate by more than the tolerance: half of it is the law's, the rest the iteration's.
        if report.largest_force > 0.5 * self.robot.contact.tolerance_m * state.contact_stiffness {
            state.contact_stiffness *= 4.0;
        }
        Ok(report)
    }

    /// Loads of contact on the clamps, body axes, moment about the joint.
    fn contact_loads(&self) -> [Load; 2] {
        let mut loads = [Load::default(); 2];
        for pair in self.contacts.pairs.iter().filter(|p| p.force > 0.0) {
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                let rod = pair.rods[side];
                let force = (pair.normal * pair.force + pair.friction) * sign;
                let at = pair.point(&self.lines, side);
                loads[rod].force += force;
                loads[rod].moment += at.cross(&force);
                let arm = at - self.feet[rod];
                loads[rod].axial_torque += arm.x * force.y - arm.y * force.x;
            }
        }
        loads
    }
}
