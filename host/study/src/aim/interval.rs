//! Intervals of a predicted attitude, from the starting phase of the flagella and the standard errors of the robot's
//! parameters.
//!
//! Phases: at speeds where the phase matters ([`sim::phase`]), the model is evaluated at several phases. A steady angle
//! changes with the phase nearly as a sine, whose extremes may lie between these phases.
//!
//! Parameters: linear propagation of their standard errors, as if they were independent. Errors of one fit are
//! correlated: their effects on the yaw partly cancel, so the interval is too wide rather than too narrow. It does not
//! include the error of the model ([`sim::accuracy`]).

use super::error::AimError;
use super::model::{Model, State, starts};
use super::quantity::Attitude;
use crate::twin::calibrate::StdError;
use rayon::prelude::*;
use serde::Serialize;
use sim::params::Robot;
use std::f64::consts::TAU;

/// Relative change of a parameter for derivatives: far above the solver's error, and small enough to be linear.
const CHANGE: f64 = 0.02;
/// Relative difference below which the value of a parameter and the rounded value beside its standard error are the
/// same.
const ROUNDED: f64 = 1e-4;
/// 95 % quantile of the magnitude of a normal deviate.
const NORMAL_95: f64 = 1.96;
/// Error of the solver in steady angles, degrees: solutions with tolerances of 0.02 and 0.001 differ by no more.
const SOLVER_DEG: f64 = 0.1;

/// 95 % intervals of the angles, and their parts.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct Interval {
    /// Of the yaw: lower and upper bound.
    pub yaw_ci_deg: [f64; 2],
    /// Of the pitch.
    pub pitch_ci_deg: [f64; 2],
    /// Of the roll.
    pub roll_ci_deg: [f64; 2],
    /// Largest minus smallest yaw, pitch and roll over the starting phases.
    pub phase_spread_deg: [f64; 3],
    /// Standard errors of yaw, pitch and roll from those of the parameters.
    pub std_error_deg: [f64; 3],
    /// Whether the flagella touch at some starting phases only.
    pub contact_by_phase: bool,
}

impl Interval {
    /// Returns the interval about a steady state of the model at starting angles of zero, and about `trial`, the attitude at the
    /// end of a whole trial at the same speeds.
    ///
    /// # Errors
    /// [`AimError::Model`] and [`AimError::Interrupted`].
    pub fn about(model: &Model, errors: &[StdError], state: &State, trial: &Attitude) -> Result<Self, AimError> {
        let rpm = state.rpm();
        let shifted = errors.iter().filter_map(|error| Some((shifted(model.robot, error)?, error)));
        let shifted: Vec<_> = shifted.collect();
        let (phases, slopes) = rayon::join(
            || starts(rpm).par_iter().skip(1).map(|start| model.at(rpm, *start)).collect::<Result<Vec<_>, _>>(),
            || {
                let slope = |(robot, error): &(Robot, &StdError)| -> Result<[f64; 3], AimError> {
                    let moved = model.of(robot, rpm, [0.0; 2])?.attitude.angles_deg();
                    let own = state.attitude.angles_deg();
                    let steps = error.std_error / error.value.abs() / CHANGE;
                    Ok([0, 1, 2].map(|i| (moved[i] - own[i]) * steps))
                };
                shifted.par_iter().map(slope).collect::<Result<Vec<_>, _>>()
            },
        );
        let (phases, slopes) = (phases?, slopes?);
        let std_error_deg = [0, 1, 2].map(|i| slopes.iter().fold(0.0, |sum: f64, slope| sum + slope[i].powi(2)).sqrt());
        let contact_by_phase = phases.iter().any(|phase| phase.touches() != state.touches());
        let all: Vec<[f64; 3]> = [state].into_iter().chain(&phases).map(|state| state.attitude.angles_deg()).collect();
        let ranges = [0, 1, 2].map(|i| range(&all.iter().map(|angles| angles[i]).collect::<Vec<_>>()));
        let trial = trial.angles_deg();
        let [yaw_ci_deg, pitch_ci_deg, roll_ci_deg] = [0, 1, 2].map(|i| {
            let beside = (NORMAL_95 * std_error_deg[i]).hypot(SOLVER_DEG);
            [ranges[i][0].min(trial[i]) - beside, ranges[i][1].max(trial[i]) + beside]
        });
        let phase_spread_deg = ranges.map(|[low, high]| high - low);
        Ok(Self { yaw_ci_deg, pitch_ci_deg, roll_ci_deg, phase_spread_deg, std_error_deg, contact_by_phase })
    }
}

/// Returns the minimum and the maximum of a value that was sampled evenly over its period. Extremes between samples are
/// those of its first harmonic.
fn range(samples: &[f64]) -> [f64; 2] {
    let low = samples.iter().copied().fold(f64::INFINITY, f64::min);
    let high = samples.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let count = samples.len() as f64;
    if samples.len() < 3 {
        return [low, high];
    }
    let mean = samples.iter().sum::<f64>() / count;
    let part = |of: fn(f64) -> f64| -> f64 {
        let terms = samples.iter().enumerate().map(|(i, value)| value * of(TAU * i as f64 / count));
        2.0 / count * terms.sum::<f64>()
    };
    let amplitude = part(f64::cos).hypot(part(f64::sin));
    [low.min(mean - amplitude), high.max(mean + amplitude)]
}

/// Returns the robot with one parameter increased by [`CHANGE`]; `None` for a phase, which need not be positive, and
/// for a value that was changed after the fit.
fn shifted(robot: &Robot, error: &StdError) -> Option<Robot> {
    let mut whole = toml::Value::try_from(robot).ok()?;
    let (table, key) = error.key.split_once('.')?;
    let value = whole.get_mut(table)?.get_mut(key)?;
    let own = value.as_float()?;
    if (own - error.value).abs() > ROUNDED * own.abs() || own == 0.0 {
        return None;
    }
    *value = toml::Value::Float(own * (1.0 + CHANGE));
    whole.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_between_phases_are_found() {
        let sine = |phase: f64| 10.0 + 2.0 * (phase - 0.7).sin();
        let samples: Vec<f64> = (0..4).map(|i| sine(TAU * f64::from(i) / 4.0)).collect();
        let [low, high] = range(&samples);
        assert!((low - 8.0).abs() < 1e-9 && (high - 12.0).abs() < 1e-9, "{low} {high}");
        assert_eq!(range(&[3.0]), [3.0, 3.0]);
    }

    #[test]
    fn a_standard_error_counts_for_the_value_that_it_was_fitted_to() {
        let robot = Robot::default();
        let error = |key: &str, value| StdError { key: key.to_owned(), value, std_error: 0.1 };
        let thick = shifted(&robot, &error("fluid.viscosity_pa_s", 1.0)).unwrap();
        assert_eq!(thick.fluid.viscosity_pa_s, 1.02);
        assert_eq!(shifted(&robot, &error("fluid.viscosity_pa_s", 1.1)), None);
        assert_eq!(shifted(&robot, &error("flagellum.phase_deg", 30.0)), None);
    }
}
