//! Estimates a robot's parameters from its trials by least squares between model and experiment.
//!
//! Yaw, pitch and roll of every trial are averaged over blocks of half a second, from the start of the run to the end
//! of the decay, and the model is fitted to them by the Levenberg-Marquardt method. Parameters are fitted as logarithms
//! relative to their start, angles in radians.
//!
//! Successive residuals are correlated, and standard errors that ignored this would be several times too small. The fit
//! weights blocks by the errors of the sensor (the random walk of the yaw, the walk of the gyroscope's bias since the
//! still phase, the levelling, the zeros), of the solver and of the clocks, and by an assumed remaining error, as if it
//! were independent. Weights with the true correlation of the remaining error would be more efficient, but would rely
//! on the first moments of a motion more than the accuracy of model and clocks allows: a delay of 5 ms then changed the
//! tether by 3 %. The size and correlation of the residuals, as a first-order autoregressive process for each angle,
//! enter the standard errors, which hold for any weights of the fit (White 1980, Econometrica 48, 817; Seber and Wild
//! 2003, Nonlinear Regression, chapter 6). The solver's error is added to them. The error of the model is the same in
//! all trials and does not show in their scatter; its effect on each parameter is given beside the standard error
//! ([`Estimate::model_error`]).

mod data;
mod file;
mod parameter;
mod phase;
mod problem;
mod uncertainty;

use crate::trial::{Finding, LogFinding};
pub use file::{StdError, std_errors, to_toml};
pub use parameter::Parameter;
use parameter::wrapped;

use super::TwinError;
use super::replay::pool;
use crate::attitude::student_95;
pub use data::FitTrial;
use data::{Correlated, Whitener};
use levenberg_marquardt::LevenbergMarquardt;
use nalgebra::DMatrix;
use problem::Problem;
use rayon::prelude::*;
use serde::Serialize;
use sim::accuracy::ModelError;
use sim::body::closure::Closure;
use sim::params::Robot;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use uncertainty::Response;

/// Relative change of the parameters below which the fit has converged: a fraction of a standard error.
const PRECISION: f64 = 1e-3;

/// Maximum number of evaluations per parameter.
const MAX_EVALS_PER_PARAM: usize = 20;

/// Largest correlation of two parameters that are separable.
const MAX_CORRELATION: f64 = 0.95;

/// Largest relative standard error of a parameter that counts as determined.
const MAX_REL_ERROR: f64 = 0.2;

/// Largest standard error of a phase that counts as determined, degrees.
const MAX_PHASE_ERROR_DEG: f64 = 20.0;

/// The settings of a fit.
#[derive(Debug)]
pub struct Request {
    /// The robot to start from; `None` for that of the first trial.
    pub robot: Option<Robot>,
    /// The closure; `None` for that of the first trial's model, or `full` if it has no model.
    pub closure: Option<Closure>,
    /// The parameters; [`Parameter::usual`] if there are none.
    pub parameters: Vec<Parameter>,
    /// Number of simulations in parallel.
    pub jobs: usize,
}

/// A fitted parameter.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Estimate {
    /// Its name.
    pub name: &'static str,
    /// Key in the robot's file.
    pub key: Option<&'static str>,
    /// Unit.
    pub unit: &'static str,
    /// The value that the fit started from.
    pub start: f64,
    /// The fitted value.
    pub value: f64,
    /// Standard error from the noise of the measurement and the solver.
    pub std_error: f64,
    /// Possible change of the value by the error of the model ([`sim::accuracy`]); `None` if all trials are of a model
    /// or a simulated robot, which have no such error.
    pub model_error: Option<f64>,
    /// 95 % confidence interval: lower and upper bound. It does not contain the model's error.
    pub interval_95: [f64; 2],
}

/// A trial used by the fit.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Fitted {
    /// Its name.
    pub name: String,
    /// Path of its log.
    #[serde(serialize_with = "crate::text::path")]
    pub log: PathBuf,
    /// SHA-256 of the log.
    pub sha256: String,
    /// Root mean square errors of yaw, pitch and roll with the initial parameters.
    pub rmse_before_deg: [f64; 3],
    /// The same with the fitted parameters.
    pub rmse_after_deg: [f64; 3],
}

/// Mounting of the sensor in the body, from the still phases.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Mounting {
    /// Mean pitch at rest.
    pub pitch_deg: f64,
    /// Mean roll at rest.
    pub roll_deg: f64,
    /// Standard errors of both, from the scatter between trials; `None` for a single trial.
    pub std_error_deg: Option<[f64; 2]>,
}

/// Result of a fit.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Calibration {
    /// The parameters.
    pub parameters: Vec<Estimate>,
    /// Correlations of their errors, in the same order.
    pub correlations: Vec<Vec<f64>>,
    /// Condition number of the correlations; it is large if a combination of parameters is nearly undetermined.
    pub condition_number: f64,
    /// Descriptions of the parameters that the data cannot separate or determine.
    pub cannot_tell: Vec<String>,
    /// Root mean square of all errors with the initial parameters.
    pub rmse_before_deg: f64,
    /// The same with the fitted parameters.
    pub rmse_after_deg: f64,
    /// Mounting of the sensor in the body.
    pub mounting: Mounting,
    /// The trials.
    pub trials: Vec<Fitted>,
    /// The closure of the fit.
    pub closure: Closure,
    /// Total number of simulated trials.
    pub simulations: usize,
    /// Findings about the logs of the trials, also of those that are left out of the fit.
    pub findings: Vec<LogFinding>,
    /// Warnings about the fit itself.
    pub warnings: Vec<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// The fitted robot.
    #[serde(skip)]
    pub robot: Robot,
}

/// Fits parameters of a robot to trials. `progress` is called after each simulation of a trial; returning `false` stops the
/// fit.
///
/// # Errors
/// [`TwinError::Robot`] if the robot of the first trial is invalid, [`TwinError::Fit`] if the fit does not converge or is
/// stopped.
pub fn calibrate(
    trials: Vec<FitTrial>,
    request: &Request,
    progress: &(dyn Fn() -> bool + Sync),
) -> Result<Calibration, TwinError> {
    pool(request.jobs)?.install(|| fit(trials, request, progress))
}

/// RMS error of a fit that did not leave its start above which it is more than the model's own error, degrees.
const STUCK_DEG: f64 = 10.0;

fn fit(
    mut trials: Vec<FitTrial>,
    request: &Request,
    progress: &(dyn Fn() -> bool + Sync),
) -> Result<Calibration, TwinError> {
    let all = trials.len();
    let of_log = |trial: &FitTrial| LogFinding::all_of(&trial.path, trial.findings.iter().cloned());
    let findings: Vec<LogFinding> = trials.iter().flat_map(of_log).collect();
    // One spoilt trial is enough to move every parameter out of its interval.
    trials.retain(|trial| !trial.findings.iter().any(Finding::empties_uncertainty));
    let Some(first) = trials.first_mut() else {
        let grave: Vec<_> = findings.iter().filter(|of_log| of_log.finding.empties_uncertainty()).collect();
        if !grave.is_empty() {
            let texts: Vec<_> = grave.iter().map(|of_log| format!("{}: {}", of_log.log, of_log.finding)).collect();
            let reason = format!("no trial is sound: {}", texts.join("; "));
            return Err(failed(&reason, "name logs without grave findings"));
        }
        return Err(failed("there are no trials", "name the logs of one or more trials"));
    };
    let first_robot = std::mem::replace(&mut first.robot, Ok(Robot::default()));
    let first_closure = first.closure;
    let mut warnings = Vec::new();
    if trials.len() < all {
        let left = all - trials.len();
        warnings.push(format!("{} with grave findings left out of the fit", crate::text::count(left, "trial")));
    }
    let mut start = match &request.robot {
        Some(robot) => robot.clone(),
        None => first_robot?,
    };
    let closure = request.closure.or(first_closure).unwrap_or(Closure::Full);
    if let Some(mixture) = start.fluid.glycerol.as_mut() {
        mixture.temperature_c = trials.iter().map(|trial| trial.temperature_c).sum::<f64>() / trials.len() as f64;
        let (share, celsius) = (mixture.mass_fraction, mixture.temperature_c);
        start.fluid.viscosity_pa_s = start.fluid.viscosity();
        start.fluid.density_kg_m3 = start.fluid.density();
        start.fluid.glycerol = None;
        warnings.push(format!(
            "the initial viscosity is that of {:.1} % glycerol at the sensor's {celsius:.1} °C: {:.3} Pa s",
            100.0 * share,
            start.fluid.viscosity_pa_s
        ));
    }

    let simulations = AtomicUsize::new(0);
    let simulated = || {
        simulations.fetch_add(1, Ordering::Relaxed);
        progress()
    };
    let mut requested = request.parameters.clone();
    if requested.is_empty() {
        requested = Parameter::usual(&start);
    }
    for without in requested.extract_if(.., |parameter| !parameter.has_effect(&start)) {
        let name = without.name();
        warnings
            .push(format!("{name} is not fitted: the head is a body in the flow, and the model does not depend on it"));
    }
    let parameters = phase::with_both(&requested, &trials)?;
    let parameters = parameters.as_slice();
    let whiteners = whiteners(&trials, [Correlated::guess(); 3])?;
    let given = (trials.as_slice(), &start, closure);
    let problem = Problem::new(given, parameters, &whiteners, &simulated);
    let Some(errors_before) = problem.errors() else {
        return Err(failed("the solver fails with the initial parameters", "start from another robot with --robot"));
    };
    let near = phase::nearest(&problem);
    let problem = match &near {
        Some(near) => Problem::new((&trials, near, closure), parameters, &whiteners, &simulated),
        None => problem,
    };
    let fitted_from = near.as_ref().unwrap_or(&start);
    let problem = minimise(problem)?;
    let limited = problem.at_limit();
    if !limited.is_empty() {
        let reason = format!("{} would change by more than a factor of ten", limited.join(", "));
        return Err(failed(&reason, "start from a robot that is nearer with --robot"));
    }
    let errors = problem.errors().unwrap_or_default();
    let rmse_after_deg = rms(errors.iter().flatten());
    if !problem.has_moved() && rmse_after_deg > STUCK_DEG {
        warnings.push(format!(
            "the fit did not leave its start, where the RMS error is {rmse_after_deg:.0}°: start from another robot with --robot"
        ));
    }
    let rest = problem::correlations(&errors);
    let response = Response::new(&problem)?;
    let covariance = response.covariance(&self::whiteners(&trials, rest)?);
    let robot = problem.robot(fitted_from, problem.moved());
    let model_errors = trials.iter().any(|trial| trial.is_real).then(|| response.model_errors(&ModelError::of(&robot)));

    // The fitted parameters absorb a part of the residuals.
    let blocks: usize = trials.iter().map(FitTrial::blocks).sum();
    let independent: f64 = rest.iter().map(|rest| rest.independent(blocks)).sum();
    let freedom = (independent - parameters.len() as f64).max(1.0);
    let dof_correction = (independent / freedom).sqrt();
    let deviation = |(i, parameter): (usize, &Parameter)| {
        (dof_correction * covariance[(i, i)].max(0.0).sqrt()).hypot(parameter.solver_error())
    };
    let deviations: Vec<f64> = parameters.iter().enumerate().map(deviation).collect();
    let quantile = student_95(freedom);
    let estimates: Vec<_> = parameters
        .iter()
        .zip(problem.moved().iter().zip(&deviations))
        .enumerate()
        .map(|(i, (parameter, (moved, deviation)))| {
            let value = |moved| parameter.value(fitted_from, closure, moved);
            // An angle may have come round.
            let turns = if parameter.is_angle() { value(*moved) - wrapped(value(*moved)) } else { 0.0 };
            let value = |moved| value(moved) - turns;
            Estimate {
                name: parameter.name(),
                key: parameter.key(closure),
                unit: parameter.unit(),
                start: parameter.value(&start, closure, 0.0),
                value: value(*moved),
                std_error: parameter.error(value(*moved), *deviation),
                model_error: model_errors.as_ref().map(|errors| parameter.error(value(*moved), errors[i])),
                interval_95: [-1.0, 1.0].map(|side| value(moved + side * quantile * deviation)),
            }
        })
        .collect();
    let correlations = DMatrix::from_fn(parameters.len(), parameters.len(), |i, j| {
        covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt()
    });
    let eigenvalues = correlations.clone().symmetric_eigenvalues();
    let fitted = |i: usize| Fitted {
        name: trials[i].name.clone(),
        log: trials[i].path.clone(),
        sha256: trials[i].sha256.clone(),
        rmse_before_deg: errors_before[i].each_ref().map(|block| rms(std::iter::once(block))),
        rmse_after_deg: errors[i].each_ref().map(|block| rms(std::iter::once(block))),
    };
    Ok(Calibration {
        cannot_tell: cannot_tell(&estimates, &correlations, parameters),
        parameters: estimates,
        condition_number: eigenvalues.max() / eigenvalues.min().max(f64::MIN_POSITIVE),
        correlations: correlations.row_iter().map(|row| row.iter().copied().collect()).collect(),
        rmse_before_deg: rms(errors_before.iter().flatten()),
        rmse_after_deg,
        mounting: mounting(&trials),
        trials: (0..trials.len()).map(fitted).collect(),
        closure,
        simulations: simulations.into_inner(),
        findings,
        warnings,
        notes: phase::unknown(&trials, &start, parameters).into_iter().collect(),
        robot,
    })
}

fn failed(reason: &str, help: &'static str) -> TwinError {
    TwinError::Fit { reason: reason.to_owned(), help }
}

fn whiteners(trials: &[FitTrial], rest: [Correlated; 3]) -> Result<Vec<[Whitener; 3]>, TwinError> {
    let one = |trial: &FitTrial| match [0, 1, 2].map(|k| trial.whitener(k, rest[k])) {
        [Some(yaw), Some(pitch), Some(roll)] => Ok([yaw, pitch, roll]),
        _ => Err(failed("the noise of a trial has no valid covariance", "leave out trials whose logs are damaged")),
    };
    trials.par_iter().map(one).collect()
}

fn minimise(problem: Problem) -> Result<Problem, TwinError> {
    let method = LevenbergMarquardt::new().with_tol(PRECISION).with_patience(MAX_EVALS_PER_PARAM);
    let (problem, report) = method.minimize(problem);
    if report.termination.was_successful() {
        return Ok(problem);
    }
    let reason = format!("{:?} after {} evaluations", report.termination, report.number_of_evaluations);
    Err(failed(&reason, "fit fewer parameters with --fit, or use trials at other speeds"))
}

fn cannot_tell(estimates: &[Estimate], correlations: &DMatrix<f64>, parameters: &[Parameter]) -> Vec<String> {
    let mut said = Vec::new();
    for i in 0..estimates.len() {
        for j in 0..i {
            let correlation = correlations[(i, j)];
            if correlation.abs() > MAX_CORRELATION {
                let (one, other) = (estimates[j].name, estimates[i].name);
                let mixture = match correlation > 0.0 {
                    _ if parameters[i].is_angle() || parameters[j].is_angle() => "combination",
                    true => "ratio",
                    false => "product",
                };
                said.push(format!(
                    "{one} and {other} are hardly separable (correlation {correlation:+.3}): the trials determine their {mixture}"
                ));
            }
        }
    }
    for (estimate, parameter) in estimates.iter().zip(parameters) {
        if parameter.is_phase() && estimate.std_error > MAX_PHASE_ERROR_DEG {
            said.push(format!("{} is known to only {:.0}° (standard error)", estimate.name, estimate.std_error));
        }
        let share = estimate.std_error / estimate.value.abs();
        if !parameter.is_angle() && share > MAX_REL_ERROR {
            said.push(format!("{} is known to only {:.0} % (standard error)", estimate.name, 100.0 * share));
        }
    }
    said
}

fn rms<'a>(blocks: impl Iterator<Item = &'a Vec<f64>>) -> f64 {
    let (sum, count) = blocks.fold((0.0, 0usize), |(sum, count), block| {
        (sum + block.iter().map(|value| value * value).sum::<f64>(), count + block.len())
    });
    (sum / count.max(1) as f64).sqrt()
}

fn mounting(trials: &[FitTrial]) -> Mounting {
    let count = trials.len() as f64;
    let mean = [0, 1].map(|k| trials.iter().map(|trial| trial.askew_deg[k]).sum::<f64>() / count);
    let error = [0, 1].map(|k| {
        let squares: f64 = trials.iter().map(|trial| (trial.askew_deg[k] - mean[k]).powi(2)).sum();
        (squares / (count - 1.0) / count).sqrt()
    });
    let [pitch_deg, roll_deg] = mean;
    Mounting { pitch_deg, roll_deg, std_error_deg: (trials.len() > 1).then_some(error) }
}
