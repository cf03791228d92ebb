//! Checks whether the sweeps of a step have converged, or never will.
//!
//! All parts are judged as velocities, against one bound: the solver's tolerance times the speed of the helix, or times
//! the speed of a certain displacement within the step if that is larger. Rods have converged when their velocity
//! residual is below it; contacts, when the gap law holds and their forces and frictions no longer move the rods; the
//! base, when its rate no longer changes. An iteration has stalled when it has not improved for some sweeps.

use super::limits::Limits;
use super::model::Model;
use super::problem::StepProblem;
use super::report::StepFailure;

/// Smallest speed of the motors in this bound, rad/s: at rest there is no speed to compare with.
const LEAST_SPEED: f64 = 0.1;
/// A twist error of one radian counts as this many times the speed of the helix. The factor does not depend on the
/// step: where the twist is about to snap, a small imbalance may remain.
const TWIST_LEVER: f64 = 5.0;
/// Residuals are compared with at least the velocity kappa times this displacement, in helix radii. It matters in steps below
/// 0.13 rad: their residuals move the rods less, which saves some of the slowly converging sweeps while flagella snap past
/// each other.
const LEAST_MOTION: f64 = 0.07;
/// Least number of sweeps after the first for a moving base. The first rod lags the second by one sweep: with one sweep a
/// step, errors below the tolerance would grow from step to step until they reach it.
const TWO_WAY_SWEEPS: u32 = 1;
/// Bound of the velocity by which contact moves the rods in a sweep, in tolerances. The sweep's residual is computed
/// before that motion, and the next residual contains only a small part of it.
const CONTACT_MOTION: f64 = 6.0;
/// Bound of the tips' velocity from a change of the base's rate, in tolerances: only a part of it becomes a residual.
const BASE_MOTION: f64 = 3.0;
/// The same, of a change that the flagella may leave for the next step. With [`BASE_MOTION`], the attitude would wander by some
/// thousandths of a degree.
const BASE_LAG: f64 = 0.03;
/// Share of the contact's motion that counts as a residual when progress is judged.
const MOTION_SHARE: f64 = 0.3;
/// An iteration is slow, and worth accelerating, when a sweep leaves more than this share of the residual.
const SLOW: f64 = 0.3;
/// An error below this share of the best one so far is progress.
const PROGRESS: f64 = 0.8;
/// Sweeps without progress after which an iteration has stalled.
const PATIENCE: u32 = 6;
/// An iteration whose error is this many times the best one so far has stalled at once ...
const GROWTH: f64 = 30.0;
/// ... after this sweep; the first sweeps may grow while contacts are found.
const GROWTH_SWEEP: u32 = 3;
/// An iteration whose residual is this many times the speed of the helix diverges.
const DIVERGED: f64 = 1e3;

/// Errors and changes of one sweep.
#[derive(Clone, Copy, Debug)]
pub struct SweepErrors {
    /// Velocity residual of the rods before their correction, m/s.
    pub residual: f64,
    /// Velocity by which contact moved the rods, m/s.
    pub contact_motion: f64,
    /// Velocity by which changes of the friction will move the rods, m/s.
    pub friction: f64,
    /// Error of the gap law, m.
    pub gap: f64,
}

/// Changes of one sweep besides those of the rods.
#[derive(Clone, Copy, Debug, Default)]
pub struct Changes {
    /// Of the base's rate, rad/s.
    pub rate: f64,
    /// Of the surroundings' flow at the flagella since the sweep before, m/s.
    pub flow: f64,
}

/// The verdict on a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// All parts agree.
    Converged,
    /// Another sweep may help.
    Continue,
    /// More sweeps will not help.
    Stalled,
}

/// Judges the sweeps of one step.
#[derive(Clone, Debug)]
pub struct Convergence {
    /// Bound of velocities, m/s.
    tolerance: f64,
    /// Bound of the gap law's error, m.
    gap_tolerance: f64,
    /// Speed of the helix, m/s.
    speed: f64,
    /// Distance of the tips from the joint, m: converts the base's rate to a velocity.
    reach: f64,
    least_sweeps: u32,
    last: SweepErrors,
    /// Least error so far, m/s, and its sweep.
    best: (f64, u32),
}

impl Convergence {
    /// Returns the judge of one step.
    pub fn new(problem: &StepProblem) -> Self {
        let StepProblem { model, step, .. } = problem;
        let Model { robot, limits: Limits { gap_error, .. }, .. } = model;
        let fastest = step.motors.iter().fold(LEAST_SPEED, |a, m| a.max(m.speed.abs()));
        let speed = fastest * model.radius();
        let least = LEAST_MOTION * model.radius() * step.kappa(0).max(step.kappa(1));
        Self {
            tolerance: robot.solver.tolerance * speed.max(least),
            gap_tolerance: *gap_error,
            speed,
            reach: robot.flagellum.axial_length_m + robot.base.height_m,
            least_sweeps: if model.two_way() { TWO_WAY_SWEEPS } else { 0 },
            last: SweepErrors { residual: f64::INFINITY, contact_motion: 0.0, friction: 0.0, gap: 0.0 },
            best: (f64::INFINITY, 0),
        }
    }

    /// Returns the velocity that a twist error of one radian counts for, m/s.
    pub fn twist_lever(&self) -> f64 {
        TWIST_LEVER * self.speed
    }

    /// Returns whether a residual (m/s) shows that the iteration diverges.
    pub fn diverges(&self, residual: f64) -> bool {
        residual >= DIVERGED * self.speed
    }

    /// Returns whether rods and contacts have converged in a sweep; the base is judged after it.
    pub fn rods_converged(&self, sweep: u32, errors: &SweepErrors) -> bool {
        sweep >= self.least_sweeps
            && errors.residual < self.tolerance
            && errors.contact_motion < CONTACT_MOTION * self.tolerance
            && errors.friction < self.tolerance
            && errors.gap < self.gap_tolerance
    }

    /// Returns whether a residual (m/s) fell so little since the last sweep that acceleration is worth its cost.
    pub fn is_slow(&self, residual: f64) -> bool {
        residual > SLOW * self.last.residual
    }

    /// Returns the tips' velocity from a change of the base's rate (rad/s), in tolerances.
    fn tips_motion(&self, change: f64) -> f64 {
        change * self.reach / self.tolerance
    }

    /// Returns whether the flagella are to follow a change of the base's rate (rad/s) at once. Before another sweep they do if the
    /// change would be most of its residual; after the last one, if they would lag behind the base.
    pub fn is_to_be_followed(&self, change: f64, verdict: Verdict) -> bool {
        self.tips_motion(change) > if verdict == Verdict::Continue { BASE_MOTION } else { BASE_LAG }
    }

    /// Judges a sweep.
    pub fn judge(&mut self, sweep: u32, errors: SweepErrors, changes: Changes) -> Verdict {
        self.last = errors;
        let settled = self.tips_motion(changes.rate) < BASE_MOTION && changes.flow < self.tolerance;
        if self.rods_converged(sweep, &errors) && settled {
            return Verdict::Converged;
        }
        let error = errors.residual.max(MOTION_SHARE * errors.contact_motion).max(errors.friction);
        let (best, best_sweep) = self.best;
        if error < PROGRESS * best {
            self.best = (error, sweep);
        } else if sweep > best_sweep + PATIENCE || (error > GROWTH * best && sweep > GROWTH_SWEEP) {
            return Verdict::Stalled;
        }
        Verdict::Continue
    }

    /// Forgets earlier progress after this sweep, because the problem has changed.
    pub fn restart(&mut self, sweep: u32) {
        self.best = (f64::INFINITY, sweep);
    }

    /// Returns the failure of an iteration that has not converged.
    pub fn failure(&self) -> StepFailure {
        StepFailure::Stalled { residual: self.last.residual, wanted: self.tolerance, gap: self.last.gap }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge(residuals: &[f64]) -> Vec<Verdict> {
        let mut convergence = Convergence {
            tolerance: 1e-3,
            gap_tolerance: 1e-6,
            speed: 0.1,
            reach: 0.2,
            least_sweeps: 1,
            last: SweepErrors { residual: f64::INFINITY, contact_motion: 0.0, friction: 0.0, gap: 0.0 },
            best: (f64::INFINITY, 0),
        };
        let errors = |residual| SweepErrors { residual, contact_motion: 0.0, friction: 0.0, gap: 0.0 };
        (0..).zip(residuals).map(|(sweep, r)| convergence.judge(sweep, errors(*r), Changes::default())).collect()
    }

    #[test]
    fn a_falling_residual_converges_but_not_in_the_first_sweep() {
        use Verdict::{Continue, Converged};
        assert_eq!(judge(&[1e-4, 1e-4]), [Continue, Converged]);
        assert_eq!(judge(&[0.1, 0.01, 0.002, 5e-4]), [Continue, Continue, Continue, Converged]);
    }

    #[test]
    fn an_iteration_stalls_without_progress_or_by_growth() {
        let flat = judge(&[0.01; 10]);
        assert_eq!(flat.iter().position(|v| *v == Verdict::Stalled), Some(7));
        let growing = judge(&[0.01, 0.02, 0.04, 0.4, 0.41]);
        assert_eq!(growing.iter().position(|v| *v == Verdict::Stalled), Some(4));
    }
}
