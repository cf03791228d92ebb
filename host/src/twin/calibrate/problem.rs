//! The least squares problem: residuals of all trials, and how they change with each parameter.

use super::data::{Blocks, Correlated, Data, Whitener};
use super::parameter::Parameter;
use levenberg_marquardt::LeastSquaresProblem;
use nalgebra::{Rotation3, Vector3};
use nalgebra_of_lm::storage::Owned;
use nalgebra_of_lm::{DMatrix, DVector, Dyn};
use rayon::prelude::*;
use sim::body::closure::Closure;
use sim::params::Robot;

/// By how much a parameter moves for a difference: a logarithm, or radians. Small enough to be straight, and large beside
/// what the solver leaves.
const DIFFERENCE: f64 = 0.01;

/// The solver's tolerance for differences, which must not drown in what it leaves. Residuals keep the robot's own: what the
/// solver leaves has a direction (0.6 % of a tilt at 0.02), and the trial may be one that the same solver made.
const TOLERANCE: f64 = 1e-3;

/// The parameters do not move further than this from their start: a factor of ten, or half a turn and more.
const FARTHEST: f64 = 2.3;

/// A residual that no fit likes.
const FAR_OFF: f64 = 1e4;

/// Trials, a robot, and what of it moves.
pub(super) struct Problem<'a> {
    pub trials: &'a [Data],
    pub start: &'a Robot,
    pub closure: Closure,
    pub parameters: &'a [Parameter],
    pub whiteners: &'a [[Whitener; 3]],
    /// Told of the simulations that were done.
    pub simulated: &'a (dyn Fn(usize) + Sync),
    moved: Vec<f64>,
    /// What the model makes of the trials; `None`: the solver could not end one.
    modelled: Option<Vec<Blocks>>,
}

impl<'a> Problem<'a> {
    pub fn new(
        (trials, start, closure): (&'a [Data], &'a Robot, Closure),
        parameters: &'a [Parameter],
        whiteners: &'a [[Whitener; 3]],
        simulated: &'a (dyn Fn(usize) + Sync),
        moved: Vec<f64>,
    ) -> Self {
        let mut problem = Self { trials, start, closure, parameters, whiteners, simulated, moved, modelled: None };
        problem.modelled = problem.model(problem.start, &problem.moved);
        problem
    }

    /// How far each parameter has moved.
    pub fn moved(&self) -> &[f64] {
        &self.moved
    }

    /// A robot with its parameters moved.
    pub fn robot(&self, start: &Robot, moved: &[f64]) -> Robot {
        let mut robot = start.clone();
        for (parameter, moved) in self.parameters.iter().zip(moved) {
            parameter.put(&mut robot, self.closure, *moved);
        }
        robot
    }

    /// Modelled less measured of each trial, degrees.
    pub fn errors(&self) -> Option<Vec<Blocks>> {
        let modelled = self.mounted(self.modelled.as_ref()?, &self.moved);
        Some(
            modelled
                .into_iter()
                .zip(self.trials)
                .map(|(blocks, trial)| {
                    [0, 1, 2].map(|k| blocks[k].iter().zip(&trial.measured[k]).map(|(a, b)| a - b).collect())
                })
                .collect(),
        )
    }

    fn model(&self, start: &Robot, moved: &[f64]) -> Option<Vec<Blocks>> {
        if moved.iter().any(|moved| moved.abs() > FARTHEST || !moved.is_finite()) {
            return None;
        }
        let robot = self.robot(start, moved);
        let one = |trial: &Data| {
            let blocks = trial.modelled(&robot, self.closure);
            (self.simulated)(1);
            blocks
        };
        self.trials.par_iter().map(one).collect()
    }

    /// What a sensor that is turned about the vertical in the body sees.
    fn mounted(&self, modelled: &[Blocks], moved: &[f64]) -> Vec<Blocks> {
        let yaw =
            self.parameters.iter().position(|parameter| *parameter == Parameter::MountYaw).map_or(0.0, |i| moved[i]);
        if yaw == 0.0 {
            return modelled.to_vec();
        }
        modelled.iter().map(|blocks| turned(blocks, yaw)).collect()
    }

    fn whitened(&self, errors: &[Blocks]) -> DVector<f64> {
        let parts = errors.iter().zip(self.whiteners);
        let values = parts.flat_map(|(blocks, whiteners)| {
            blocks.iter().zip(whiteners).flat_map(|(block, whitener)| whitener.whiten(block))
        });
        DVector::from_vec(values.collect())
    }
}

/// Blocks of a sensor that is turned by `yaw` (rad) in the body: the attitude times a turn about z, less that turn.
fn turned(blocks: &Blocks, yaw: f64) -> Blocks {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
    let mut result: Blocks = Default::default();
    for ((psi, theta), phi) in blocks[0].iter().zip(&blocks[1]).zip(&blocks[2]) {
        // Tilt alone: the yaw commutes with the rest, and keeps its turns.
        let tilt = Rotation3::from_euler_angles(phi.to_radians(), theta.to_radians(), 0.0);
        let (roll, pitch, rest) = (tilt * turn).euler_angles();
        result[0].push(psi + (rest - yaw).to_degrees());
        result[1].push(pitch.to_degrees());
        result[2].push(roll.to_degrees());
    }
    result
}

/// What is left unexplained, angle by angle, over all trials.
pub(super) fn correlations(errors: &[Blocks]) -> [Correlated; 3] {
    [0, 1, 2].map(|k| Correlated::of(errors.iter().map(move |blocks| &blocks[k])))
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
        match self.errors() {
            Some(errors) => Some(self.whitened(&errors)),
            // Here the model ends; the fit turns back.
            None => Some(DVector::repeat(self.trials.iter().map(|trial| 3 * trial.blocks()).sum(), FAR_OFF)),
        }
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let mut tight = self.start.clone();
        tight.solver.tolerance = tight.solver.tolerance.min(TOLERANCE);
        let modelled = self.model(&tight, &self.moved)?;
        let now = self.mounted(&modelled, &self.moved);
        let changed = |i: usize, sign: f64| {
            let mut moved = self.moved.clone();
            moved[i] += sign * DIFFERENCE;
            let modelled =
                if self.parameters[i].is_of_the_robot() { self.model(&tight, &moved)? } else { modelled.clone() };
            Some(self.mounted(&modelled, &moved))
        };
        let columns: Option<Vec<_>> = (0..self.parameters.len())
            .into_par_iter()
            .map(|i| {
                // Near where the model ends one side may be missing.
                let (there, sign) = match changed(i, 1.0) {
                    Some(there) => (there, 1.0),
                    None => (changed(i, -1.0)?, -1.0),
                };
                let slope = |there: &Vec<f64>, here: &Vec<f64>| {
                    there.iter().zip(here).map(|(there, here)| sign * (there - here) / DIFFERENCE).collect()
                };
                let slopes: Vec<Blocks> =
                    there.iter().zip(&now).map(|(there, here)| [0, 1, 2].map(|k| slope(&there[k], &here[k]))).collect();
                Some(self.whitened(&slopes))
            })
            .collect();
        Some(DMatrix::from_columns(&columns?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_that_is_turned_sees_the_tilt_from_elsewhere() {
        let blocks = [vec![725.0], vec![4.0], vec![0.0]];
        let quarter = turned(&blocks, std::f64::consts::FRAC_PI_2);
        assert!((quarter[0][0] - 725.0).abs() < 1e-9 && quarter[1][0].abs() < 1e-9, "{quarter:?}");
        assert!((quarter[2][0] - -4.0).abs() < 1e-9 || (quarter[2][0] - 4.0).abs() < 1e-9, "{quarter:?}");
        let back = turned(&turned(&[vec![-400.0], vec![6.0], vec![-3.0]], 0.3), -0.3);
        assert!(
            (back[0][0] + 400.0).abs() < 1e-9 && (back[1][0] - 6.0).abs() < 1e-9 && (back[2][0] + 3.0).abs() < 1e-9
        );
    }
}
