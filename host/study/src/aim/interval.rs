//! Intervals of a predicted attitude, from the starting phase of the flagella, the covariance of the fitted parameters, and
//! the errors of the model and of the solver.
//!
//! Phases: at speeds where the phase matters ([`sim::steady::phase`]), the model is evaluated at several phases. A
//! steady angle varies with the phase nearly as a sine, and its extremes may lie between these phases.
//!
//! Parameters: linear propagation of their covariance, with Student's quantile for the effective degrees of freedom (GUM,
//! G.2b). The half width of the resulting 95 % interval, the model's error ([`sim::accuracy`]) and the solver's error
//! add in quadrature. A fit absorbs part of the model's error, but an unknown part at other speeds, so the whole error
//! counts.

use super::error::AimError;
use super::known::Known;
use super::model::{Model, State, starts};
use super::quantity::Attitude;
use crate::plan::Fit;
use crate::statistics::{effective_freedom, extremes, student_95};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;
use sim::functions::{cos, hypot, sin};
use sim::params::Robot;
use std::f64::consts::TAU;

/// Relative change of a parameter for derivatives: far above the solver's error, and small enough to be linear.
const CHANGE: f64 = 0.02;
/// Error of the solver in steady angles, degrees: solutions with tolerances of 0.02 and 0.001 differ by no more.
const SOLVER_DEG: f64 = 0.1;

/// Intervals of the angles, and their parts. They are 95 % intervals if [`Known::confidence`] says so. Parts that the
/// model has not computed in time are `None`.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Interval {
    /// Interval of the yaw: lower and upper bound.
    pub yaw_ci_deg: Option<[f64; 2]>,
    /// Interval of the pitch.
    pub pitch_ci_deg: Option<[f64; 2]>,
    /// Interval of the roll.
    pub roll_ci_deg: Option<[f64; 2]>,
    /// Largest minus smallest yaw, pitch and roll of the starting phases. Only the intervals include extremes between
    /// them.
    pub phase_spread_deg: Option<[f64; 3]>,
    /// Standard errors of yaw, pitch and roll, propagated from the parameters.
    pub std_error_deg: Option<[f64; 3]>,
    /// Error of the model in yaw, pitch and roll; `None` if the robot was fitted to a simulation.
    pub model_error_deg: Option<[f64; 3]>,
    /// Whether the flagella touch at some starting phases only.
    pub contact_by_phase: Option<bool>,
}

impl Interval {
    /// Returns the interval that contains a steady state of the model at starting angles of zero, and `trial`, the
    /// attitude at the end of a whole trial at the same speeds.
    ///
    /// # Errors
    /// [`AimError::Model`], [`AimError::Interrupted`] and [`AimError::TimeOver`].
    pub fn about(model: &Model, known: &Known, state: &State, trial: &Attitude) -> Result<Self, AimError> {
        let rpm = state.rpm();
        let changes = known.fit.as_ref().map_or_else(Vec::new, |fit| changes(model.robot, fit));
        let own = state.attitude.angles_deg();
        let (phases, slopes) = rayon::join(
            || starts(rpm).par_iter().skip(1).map(|start| model.at(rpm, *start)).collect::<Result<Vec<_>, _>>(),
            || {
                let slope = |change: &Change| -> Result<[f64; 3], AimError> {
                    let moved = model.of(&change.robot, rpm, [0.0; 2])?.attitude.angles_deg();
                    Ok([0, 1, 2].map(|i| (moved[i] - own[i]) / change.by))
                };
                changes.par_iter().map(slope).collect::<Result<Vec<_>, _>>()
            },
        );
        let (phases, slopes) = (phases?, slopes?);
        let contact_by_phase = phases.iter().any(|phase| phase.touches() != state.touches());
        let all: Vec<[f64; 3]> = [state].into_iter().chain(&phases).map(|state| state.attitude.angles_deg()).collect();
        let ranges = [0, 1, 2].map(|i| range(&all.iter().map(|angles| angles[i]).collect::<Vec<_>>()));
        let unknown = Self::unknown(known, trial);
        let spread = [0, 1, 2].map(|i| {
            let slopes: Vec<f64> = slopes.iter().map(|slope| slope[i]).collect();
            known.fit.as_ref().map_or([0.0; 2], |fit| propagated(fit, &changes, &slopes))
        });
        let trial = trial.angles_deg();
        let [yaw_ci_deg, pitch_ci_deg, roll_ci_deg] = [0, 1, 2].map(|i| {
            let [_, half] = spread[i];
            let beside = hypot(hypot(half, SOLVER_DEG), unknown.model_error_deg.map_or(0.0, |error| error[i]));
            Some([ranges[i][0].min(trial[i]) - beside, ranges[i][1].max(trial[i]) + beside])
        });
        Ok(Self {
            yaw_ci_deg,
            pitch_ci_deg,
            roll_ci_deg,
            phase_spread_deg: Some([0, 1, 2].map(|i| {
                let [least, most] = extremes(all.iter().map(|angles| angles[i]));
                most - least
            })),
            std_error_deg: Some(spread.map(|[std_error, _]| std_error)),
            contact_by_phase: Some(contact_by_phase),
            ..unknown
        })
    }

    /// Returns the known parts for the attitude at the end of a trial, without evaluating the model again.
    pub fn unknown(known: &Known, trial: &Attitude) -> Self {
        let model_error_deg = known.model_error.as_ref().map(|error| error.of_modelled_deg(trial.angles_deg()));
        Self { model_error_deg, ..Self::default() }
    }
}

/// Returns the minimum and the maximum of a value sampled evenly over its period. Its first harmonic gives the extremes
/// between samples.
fn range(samples: &[f64]) -> [f64; 2] {
    let [low, high] = extremes(samples.iter().copied());
    let count = samples.len() as f64;
    if samples.len() < 3 {
        return [low, high];
    }
    let mean = samples.iter().sum::<f64>() / count;
    let part = |of: fn(f64) -> f64| -> f64 {
        let terms = samples.iter().enumerate().map(|(i, value)| value * of(TAU * i as f64 / count));
        2.0 / count * terms.sum::<f64>()
    };
    let amplitude = hypot(part(cos), part(sin));
    [low.min(mean - amplitude), high.max(mean + amplitude)]
}

/// A robot with one parameter changed.
struct Change {
    /// Index of the parameter in the fit.
    parameter: usize,
    robot: Robot,
    /// The change, in the unit of the parameter.
    by: f64,
}

/// Returns one robot per fitted parameter, with that parameter increased by [`CHANGE`]. Only single numbers in the
/// robot file count: the intervals hold for all angles of the flagella.
fn changes(robot: &Robot, fit: &Fit) -> Vec<Change> {
    let changed = |(parameter, key): (usize, &String)| {
        let mut whole = toml::Value::try_from(robot).ok()?;
        let (table, key) = key.split_once('.')?;
        let value = whole.get_mut(table)?.get_mut(key)?;
        let by = CHANGE * value.as_float().filter(|value| *value != 0.0)?;
        *value = toml::Value::Float(value.as_float()? + by);
        Some(Change { parameter, robot: whole.try_into().ok()?, by })
    };
    let keys = fit.parameters.iter().enumerate().filter_map(|(i, parameter)| Some((i, parameter.key.as_ref()?)));
    keys.filter_map(changed).collect()
}

/// Returns the standard error and the half width of the 95 % interval of an angle. `slopes`: its derivatives by the changed
/// parameters.
fn propagated(fit: &Fit, changes: &[Change], slopes: &[f64]) -> [f64; 2] {
    let slopes = DVector::from_column_slice(slopes);
    let variance = |matrix: &[Vec<f64>]| {
        let places = |i: usize| changes[i].parameter;
        let of_changes = DMatrix::from_fn(slopes.len(), slopes.len(), |i, j| matrix[places(i)][places(j)]);
        slopes.dot(&(of_changes * &slopes)).max(0.0)
    };
    let (all, scatter) = (variance(&fit.covariance), variance(&fit.scatter_covariance));
    let degrees_of_freedom = effective_freedom(all, std::iter::once((scatter, fit.degrees_of_freedom)));
    [all.sqrt(), student_95(degrees_of_freedom) * all.sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{FittedParameter, FittedTo};
    use sim::body::closure::Closure;

    #[test]
    fn extremes_between_phases_are_found() {
        let sine = |phase: f64| 10.0 + 2.0 * (phase - 0.7).sin();
        let samples: Vec<f64> = (0..4).map(|i| sine(TAU * f64::from(i) / 4.0)).collect();
        let [low, high] = range(&samples);
        assert!((low - 8.0).abs() < 1e-9 && (high - 12.0).abs() < 1e-9, "{low} {high}");
        assert_eq!(range(&[3.0]), [3.0, 3.0]);
    }

    #[test]
    fn errors_that_cancel_in_an_angle_do_so_in_its_interval() {
        let parameter = |name: &str, key: &str, value: f64| FittedParameter {
            name: name.to_owned(),
            key: Some(key.to_owned()),
            unit: String::new(),
            start: value,
            value,
            std_error: 0.1 * value,
            interval_95: [0.8 * value, 1.2 * value],
            model_error: None,
        };
        let (viscosity, tether) = (1.0, 5e-4);
        let product = 0.01 * viscosity * tether;
        let fit = Fit {
            closure: Closure::Full,
            fitted_to: FittedTo::Simulation,
            is_described: true,
            short_of_minimum: Vec::new(),
            temperature_c: Some(20.0),
            degrees_of_freedom: 1.0,
            // The trials have determined only the ratio.
            covariance: vec![
                vec![0.01 * viscosity * viscosity, 0.99 * product],
                vec![0.99 * product, 0.01 * tether * tether],
            ],
            scatter_covariance: vec![vec![0.0; 2]; 2],
            lacks_correlations: false,
            parameters: vec![
                parameter("viscosity", "fluid.viscosity_pa_s", viscosity),
                parameter("tether", "joint.tether_full_nm_per_rad", tether),
            ],
        };
        let mut robot = Robot::default();
        robot.joint.tether_full_nm_per_rad = tether;
        let changes = changes(&robot, &fit);
        assert_eq!(changes[0].robot.fluid.viscosity_pa_s, 1.02);
        assert!((changes[1].by - 1e-5).abs() < 1e-12 && changes.len() == 2);
        // A yaw of 100 degrees in proportion to the viscosity over the tether.
        let slopes = [100.0 / viscosity, -100.0 / tether];
        let [std_error, half] = propagated(&fit, &changes, &slopes);
        assert!((std_error - 100.0 * (2.0 * 0.01f64 * 0.01).sqrt()).abs() < 1e-9, "{std_error}");
        assert!((half / std_error - 1.96).abs() < 0.01);
        // One degree of freedom has the quantile 12.7.
        let few = Fit { scatter_covariance: fit.covariance.clone(), ..fit };
        assert!((propagated(&few, &changes, &slopes)[1] / std_error - 12.7).abs() < 0.1);
    }
}
