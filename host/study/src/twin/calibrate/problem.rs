//! The least squares problem: residuals of all trials, and their derivatives with respect to each parameter.

use super::Blocks;
use super::data::FitTrial;
use super::parameter::Parameter;
use super::weights::Weights;
use levenberg_marquardt::LeastSquaresProblem;
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn, Vector3};
use rayon::prelude::*;
use sim::body::attitude::{euler_zyx, of_euler_zyx, of_vector};
use sim::body::closure::Closure;
use sim::params::Robot;
use sim::step::InversesAtRest;
use std::sync::{Arc, Mutex, PoisonError};

/// Step of the finite differences, a logarithm or radians: small enough for the model to be linear, and large compared
/// with the solver's error.
const FD_STEP: f64 = 0.01;

/// The solver's tolerance for finite differences, so that they exceed its error. Residuals use the tolerance of the
/// robot: the solver's error is systematic (0.6 % of a tilt at 0.02), and the trial may have been computed by the same
/// solver.
const TOLERANCE: f64 = 1e-3;

/// Largest change of a parameter after which slopes are reused: it changes them by a similar relative amount, and a
/// simulation with slopes costs as much as three or more without.
const SAME_SLOPES: f64 = 0.03;

/// Largest change of the logarithm of a parameter from its start: a factor of ten.
const MAX_LOG_CHANGE: f64 = 2.3;

/// Largest change of an angle from its start, rad: more than half a turn either way, so every angle can be reached.
const MAX_TURN: f64 = 3.5;

/// Share of the largest change above which a parameter counts as being at its limit.
const AT_LIMIT: f64 = 0.95;

/// Residual if the solver fails, large enough to make the fit turn back.
const FAILED_RESIDUAL: f64 = 1e4;

/// The inputs of a fit, independent of its start.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    pub trials: &'a [FitTrial],
    pub closure: Closure,
    pub parameters: &'a [Parameter],
    pub weights: &'a Weights,
    /// Inverses shared by all simulations.
    pub at_rest: &'a InversesAtRest,
    /// Called after each simulation of a trial; returning `false` stops the fit.
    pub simulated: &'a (dyn Fn() -> bool + Sync),
}

/// The trials, the robot, and its free parameters.
pub(super) struct Problem<'a> {
    pub given: Given<'a>,
    pub start: &'a Robot,
    /// The change of each parameter.
    pub moved: Vec<f64>,
    /// The model's blocks of the trials; `None` if the solver failed.
    modelled: Option<Vec<Blocks>>,
    /// The last slopes, and the parameters at which they were computed.
    slopes: Mutex<Option<(Vec<f64>, Arc<Slopes>)>>,
}

/// The derivatives of the errors: for each parameter, for each trial.
pub(super) type Slopes = Vec<Vec<Blocks>>;

impl<'a> Problem<'a> {
    pub fn new(given: Given<'a>, start: &'a Robot) -> Self {
        let mut problem =
            Self { moved: vec![0.0; given.parameters.len()], given, start, modelled: None, slopes: Mutex::default() };
        problem.modelled = problem.model(problem.start, &problem.moved);
        problem
    }

    /// Returns the parameters that have reached, or nearly reached, their limit.
    pub fn at_limit(&self) -> Vec<&'static str> {
        let nearly: Vec<f64> = self.moved.iter().map(|moved| moved / AT_LIMIT).collect();
        self.beyond(&nearly)
    }

    /// Returns whether a parameter has left its start.
    pub fn has_moved(&self) -> bool {
        self.moved.iter().any(|moved| moved.abs() > FD_STEP)
    }

    /// Returns the parameters that exceed their limit.
    fn beyond(&self, moved: &[f64]) -> Vec<&'static str> {
        let is_beyond = |(parameter, moved): &(&Parameter, &f64)| {
            let limit = if parameter.is_angle() { MAX_TURN } else { MAX_LOG_CHANGE };
            moved.abs() > limit || !moved.is_finite()
        };
        self.given.parameters.iter().zip(moved).filter(is_beyond).map(|(parameter, _)| parameter.name()).collect()
    }

    /// Returns a robot with changed parameters.
    pub fn robot(&self, start: &Robot, moved: &[f64]) -> Robot {
        let mut robot = start.clone();
        for (parameter, moved) in self.given.parameters.iter().zip(moved) {
            parameter.put(&mut robot, self.given.closure, *moved);
        }
        robot
    }

    /// Returns the errors of each trial, modelled minus measured, degrees.
    pub fn errors(&self) -> Option<Vec<Blocks>> {
        let modelled = self.mounted(self.modelled.as_ref()?, &self.moved);
        Some(
            modelled.iter().zip(self.given.trials).map(|(blocks, trial)| difference(blocks, &trial.measured)).collect(),
        )
    }

    /// Returns the sum of the squared residuals of one trial with another robot; infinite if the solver fails.
    pub fn misfit(&self, trial: usize, robot: &Robot) -> f64 {
        let Some(modelled) = self.simulate(&self.given.trials[trial], robot) else {
            return f64::INFINITY;
        };
        self.given.weights.square(trial, &difference(&modelled, &self.given.trials[trial].measured))
    }

    /// Returns the derivatives of the errors with respect to each parameter, here or nearby; `None` if the solver
    /// fails.
    pub fn slopes(&self) -> Option<Arc<Slopes>> {
        let mut last = self.slopes.lock().unwrap_or_else(PoisonError::into_inner);
        let is_near = |at: &[f64]| at.iter().zip(&self.moved).all(|(at, now)| (at - now).abs() < SAME_SLOPES);
        if !last.as_ref().is_some_and(|(at, _)| is_near(at)) {
            *last = Some((self.moved.clone(), Arc::new(self.slopes_here()?)));
        }
        last.as_ref().map(|(_, slopes)| slopes.clone())
    }

    fn slopes_here(&self) -> Option<Slopes> {
        let mut tight = self.start.clone();
        tight.solver.tolerance = tight.solver.tolerance.min(TOLERANCE);
        let modelled = self.model(&tight, &self.moved)?;
        let now = self.mounted(&modelled, &self.moved);
        let changed = |i: usize, sign: f64| {
            let mut moved = self.moved.clone();
            moved[i] += sign * FD_STEP;
            // The mounting of the sensor needs no new simulation.
            let is_of_robot = self.given.parameters[i] != Parameter::MountYaw;
            let modelled = if is_of_robot { self.model(&tight, &moved)? } else { modelled.clone() };
            Some(self.mounted(&modelled, &moved))
        };
        let slopes = |i: usize| {
            // Near the limit of the model, one side may fail.
            let (there, sign) = match changed(i, 1.0) {
                Some(there) => (there, 1.0),
                None => (changed(i, -1.0)?, -1.0),
            };
            let of_trial =
                |(there, here): (&Blocks, &Blocks)| difference(there, here).map(|change| change * sign / FD_STEP);
            Some(there.iter().zip(&now).map(of_trial).collect())
        };
        (0..self.given.parameters.len()).into_par_iter().map(slopes).collect()
    }

    fn model(&self, start: &Robot, moved: &[f64]) -> Option<Vec<Blocks>> {
        if !self.beyond(moved).is_empty() {
            return None;
        }
        let robot = self.robot(start, moved);
        self.given.trials.par_iter().map(|trial| self.simulate(trial, &robot)).collect()
    }

    fn simulate(&self, trial: &FitTrial, robot: &Robot) -> Option<Blocks> {
        let blocks = trial.modelled(robot, self.given.closure, self.given.at_rest);
        let goes_on = (self.given.simulated)();
        blocks.filter(|_| goes_on)
    }

    /// Returns the attitude measured by a sensor rotated about the vertical in the body.
    fn mounted(&self, modelled: &[Blocks], moved: &[f64]) -> Vec<Blocks> {
        let yaw = self
            .given
            .parameters
            .iter()
            .position(|parameter| *parameter == Parameter::MountYaw)
            .map_or(0.0, |i| moved[i]);
        if yaw == 0.0 {
            return modelled.to_vec();
        }
        modelled.iter().map(|blocks| turned(blocks, yaw)).collect()
    }
}

fn difference(one: &Blocks, other: &Blocks) -> Blocks {
    [0, 1, 2].map(|k| &one[k] - &other[k])
}

/// Returns the blocks of a sensor rotated by `yaw` (rad) about z in the body.
fn turned(blocks: &Blocks, yaw: f64) -> Blocks {
    let turn = of_vector(Vector3::z() * yaw);
    let mut result = blocks.clone();
    let [psi, theta, phi] = &mut result;
    for ((psi, theta), phi) in psi.iter_mut().zip(theta).zip(phi) {
        // Only the tilt changes: a rotation about z commutes with the yaw, so the yaw keeps its full turns.
        let tilt = of_euler_zyx([0.0, theta.to_radians(), phi.to_radians()]);
        let [rest, pitch, roll] = euler_zyx(&(tilt * turn));
        (*psi, *theta, *phi) = (*psi + (rest - yaw).to_degrees(), pitch.to_degrees(), roll.to_degrees());
    }
    result
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, moved: &DVector<f64>) {
        self.moved = moved.as_slice().to_vec();
        self.modelled = self.model(self.start, &self.moved);
    }

    fn params(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.moved)
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        Some(match self.errors() {
            Some(errors) => self.given.weights.whiten(&errors),
            None => DVector::repeat(self.given.weights.count(), FAILED_RESIDUAL),
        })
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let columns: Vec<_> = self.slopes()?.iter().map(|slopes| self.given.weights.whiten(slopes)).collect();
        Some(DMatrix::from_columns(&columns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotated_sensor_exchanges_pitch_and_roll() {
        let blocks = [725.0, 4.0, 0.0].map(|deg| DVector::repeat(1, deg));
        let quarter = turned(&blocks, std::f64::consts::FRAC_PI_2);
        assert!((quarter[0][0] - 725.0).abs() < 1e-9 && quarter[1][0].abs() < 1e-9, "{quarter:?}");
        assert!((quarter[2][0] - -4.0).abs() < 1e-9 || (quarter[2][0] - 4.0).abs() < 1e-9, "{quarter:?}");
        let back = turned(&turned(&[-400.0, 6.0, -3.0].map(|deg| DVector::repeat(1, deg)), 0.3), -0.3);
        assert!(
            (back[0][0] + 400.0).abs() < 1e-9 && (back[1][0] - 6.0).abs() < 1e-9 && (back[2][0] + 3.0).abs() < 1e-9
        );
    }
}
