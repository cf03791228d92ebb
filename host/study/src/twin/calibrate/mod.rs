//! Estimates a robot's parameters from its trials by least squares between model and experiment.
//!
//! Yaw, pitch and roll of every trial are averaged over blocks of half a second, from the start of the run (without encoders:
//! from where the swing tells the speeds) to the end of the decay, and the model is fitted to them by the Levenberg-Marquardt method. Parameters are fitted as logarithms
//! relative to their start, angles in radians.
//!
//! The errors of a sensor (scale, axes, sensitivity to gravity, mounting, the clock of its board) are the same in all
//! of its trials, so more trials do not average them out. They are estimated together with the parameters, with the
//! data sheet or the sensor's own measurement as the prior: generalised least squares with the covariance of all trials
//! (`weights.rs`). Different boards have independent errors.
//!
//! Successive residuals are correlated, and standard errors that ignored this would be several times too small. The fit
//! weights blocks by the errors of the sensor (including the trial's own: the random walk of the yaw, the walk of the
//! gyroscope's bias since the still phase, the levelling, the zeros), of the solver and of the clocks, and by an
//! assumed remaining error, treated as independent. Weights with the true correlation of the remaining error would be
//! more efficient, but would rely too much on the beginning of a motion for the accuracy of model and clocks: a delay
//! of 5 ms then changed the tether by 3 %. The size and correlation of the residuals enter the standard errors as a
//! first-order autoregressive process for each angle. The standard errors hold for any weights of the fit (White 1980,
//! Econometrica 48, 817; Seber and Wild 2003, Nonlinear Regression, chapter 6). The solver's error is added to them.
//!
//! The error of the model is the same in all trials and does not show in their scatter. Its effect on each parameter
//! ([`FittedParameter::model_error`]) is part of the interval, but not of the standard error.

mod data;
mod errors;
mod fluid;
mod judge;
mod parameter;
mod phase;
mod problem;
mod result;
mod select;
mod uncertainty;
mod weights;

pub use data::FitTrial;
pub use parameter::Parameter;
pub use result::{Calibration, Fitted, Mounting, to_toml};

use super::TwinError;
use crate::attitude::wrapped;
use crate::plan::FittedParameter;
use crate::run::model::pool;
use crate::trial::LogFinding;
use levenberg_marquardt::LevenbergMarquardt;
use nalgebra::{DMatrix, DVector};
use problem::{Given, Problem};
use sim::accuracy::ModelError;
use sim::body::closure::Closure;
use sim::functions::{hypot, powi};
use sim::params::Robot;
use sim::step::InversesAtRest;
use std::sync::atomic::{AtomicUsize, Ordering};
use uncertainty::Spread;
use weights::Weights;

/// Yaw, pitch and roll of every block of a trial, degrees.
type Blocks = [DVector<f64>; 3];

/// Relative change of the parameters below which the fit has converged: a fraction of a standard error.
const PRECISION: f64 = 1e-3;

/// Maximum number of evaluations per parameter.
const MAX_EVALS_PER_PARAM: usize = 20;

/// Standard deviation of the remaining error of a block assumed by the weights of the fit, degrees.
const ASSUMED_REST_DEG: f64 = 0.1;

/// The settings of a fit.
#[derive(Debug)]
pub struct Request {
    /// The robot to start from; `None` for the first trial's robot.
    pub robot: Option<Robot>,
    /// The closure; `None` for the closure of the first trial's model, or `full` if it has no model.
    pub closure: Option<Closure>,
    /// The parameters; [`Parameter::usual`] if there are none.
    pub parameters: Vec<Parameter>,
    /// Number of simulations in parallel.
    pub jobs: usize,
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

fn fit(
    trials: Vec<FitTrial>,
    request: &Request,
    progress: &(dyn Fn() -> bool + Sync),
) -> Result<Calibration, TwinError> {
    let all_of = |trial: &FitTrial| LogFinding::all_of(&trial.path, trial.findings.iter().cloned());
    let findings: Vec<LogFinding> = trials.iter().flat_map(all_of).collect();
    let mut warnings = Vec::new();
    let mut trials = select::usable(trials, &findings, &mut warnings)?;
    let (mut start, closure) = select::start(&mut trials, request, &mut warnings)?;
    let [warning, of_fluid] = fluid::at_temperatures(&mut trials, &mut start.fluid)?;
    warnings.extend(warning);
    let parameters = select::parameters(&mut trials, &start, &request.parameters, &mut warnings)?;
    let simulations = AtomicUsize::new(0);
    let simulated = || {
        simulations.fetch_add(1, Ordering::Relaxed);
        progress()
    };
    let weights = Weights::new(&trials.iter().map(|trial| &trial.errors).collect::<Vec<_>>(), ASSUMED_REST_DEG)?;
    let given = Given {
        trials: &trials,
        closure,
        parameters: &parameters,
        weights: &weights,
        at_rest: &InversesAtRest::default(),
        simulated: &simulated,
    };
    let problem = Problem::new(given, &start);
    let Some(errors_before) = problem.errors() else {
        return Err(failed("the solver fails with the initial parameters", "start from another robot with --robot"));
    };
    let near = phase::nearest(&problem);
    let problem = minimise(near.as_ref().map_or(problem, |near| Problem::new(given, near)))?;
    let errors = problem.errors().unwrap_or_default();
    let rmse_after_deg = rms(errors.iter().flatten());
    warnings.extend(judge::stuck(problem.has_moved(), rmse_after_deg));
    let robot = problem.robot(problem.start, &problem.moved);
    let model_error = ModelError::of(&robot);
    let spread = Spread::of(&problem, &errors, &model_error)?;
    let short_of_minimum = spread.short_of_minimum(&parameters);
    warnings.extend(judge::short(&short_of_minimum));
    let estimates = estimates(&problem, &start, &spread);
    let correlations = correlations(&spread.covariance);
    let eigenvalues = correlations.clone().symmetric_eigenvalues();
    let per: Vec<f64> = estimates.iter().zip(&parameters).map(|(e, parameter)| parameter.error(e.value, 1.0)).collect();
    let in_units =
        |matrix: &DMatrix<f64>| rows(&DMatrix::from_fn(per.len(), per.len(), |i, j| matrix[(i, j)] * per[i] * per[j]));
    let rmse_before_deg = rms(errors_before.iter().flatten());
    let risen = judge::risen(rmse_before_deg, rmse_after_deg);
    let wide = judge::wide_quantiles(&estimates, &spread.quantiles, spread.degrees_of_freedom);
    Ok(Calibration {
        cannot_tell: judge::cannot_tell(&estimates, &correlations, &parameters),
        misfits: judge::misfits(&trials, &weights, &errors, &model_error),
        covariance: in_units(&spread.covariance),
        scatter_covariance: in_units(&spread.scatter),
        degrees_of_freedom: spread.degrees_of_freedom,
        parameters: estimates,
        condition_number: eigenvalues.max() / eigenvalues.min().max(f64::MIN_POSITIVE),
        correlations: rows(&correlations),
        weighted: [&errors_before, &errors].map(|all| weights.whiten(all).norm() / (weights.count() as f64).sqrt()),
        rmse_before_deg,
        rmse_after_deg,
        mounting: mounting(&trials),
        trials: fitted(&trials, &errors_before, &errors),
        temperature_c: fluid::mean_c(&trials),
        closure,
        simulations: simulations.load(Ordering::Relaxed),
        findings,
        warnings,
        notes: phase::unknown(&trials, &start, &parameters)
            .into_iter()
            .chain(of_fluid)
            .chain(wide)
            .chain(risen)
            .collect(),
        short_of_minimum,
        robot,
    })
}

fn fitted(trials: &[FitTrial], before: &[Blocks], after: &[Blocks]) -> Vec<Fitted> {
    let each = |blocks: &Blocks| blocks.each_ref().map(|block| rms(std::iter::once(block)));
    let one = |((trial, before), after): ((&FitTrial, &Blocks), &Blocks)| Fitted {
        name: trial.name.clone(),
        log: trial.path.clone(),
        sha256: trial.sha256.clone(),
        origin: trial.origin.name(),
        rmse_before_deg: each(before),
        rmse_after_deg: each(after),
    };
    trials.iter().zip(before).zip(after).map(one).collect()
}

/// Returns the fitted parameters. `start`: the robot before the search for the phases.
fn estimates(problem: &Problem, start: &Robot, spread: &Spread) -> Vec<FittedParameter> {
    let Given { parameters, closure, .. } = problem.given;
    let one = |(i, parameter): (usize, &Parameter)| {
        let value = parameter.value(problem.start, closure, problem.moved[i]);
        // An angle may have passed half a turn.
        let value = if parameter.is_angle() { wrapped(value) } else { value };
        let deviation = spread.deviation(i);
        let model_error = spread.model_errors.as_ref().map(|errors| errors[i]);
        let half = hypot(spread.quantiles[i] * deviation, model_error.unwrap_or_default());
        FittedParameter {
            name: parameter.name().to_owned(),
            key: parameter.key(closure).map(str::to_owned),
            unit: parameter.unit().to_owned(),
            start: parameter.value(start, closure, 0.0),
            value,
            std_error: parameter.error(value, deviation),
            model_error: model_error.map(|error| parameter.error(value, error)),
            interval_95: parameter.bounds(value, half),
        }
    };
    parameters.iter().enumerate().map(one).collect()
}

fn correlations(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |i, j| {
        covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt()
    })
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn failed(reason: &str, help: &'static str) -> TwinError {
    TwinError::Fit { reason: reason.to_owned(), help }
}

/// # Errors
/// [`TwinError::Fit`] if there is no minimum near the start.
fn minimise(problem: Problem) -> Result<Problem, TwinError> {
    let method = LevenbergMarquardt::new().with_tol(PRECISION).with_patience(MAX_EVALS_PER_PARAM);
    let (problem, report) = method.minimize(problem);
    if !report.termination.was_successful() {
        let reason = format!("{:?} after {} evaluations", report.termination, report.number_of_evaluations);
        return Err(failed(&reason, "fit fewer parameters with --fit, or use trials at other speeds"));
    }
    let limited = problem.at_limit();
    if !limited.is_empty() {
        let reason = format!("{} would change by more than a factor of ten", limited.join(", "));
        return Err(failed(&reason, "start from a robot that is nearer with --robot, and check the times of the runs"));
    }
    Ok(problem)
}

fn rms<'a>(blocks: impl Iterator<Item = &'a DVector<f64>>) -> f64 {
    let (sum, count) = blocks.fold((0.0, 0usize), |(sum, count), block| {
        (sum + block.iter().map(|value| value * value).sum::<f64>(), count + block.len())
    });
    (sum / count.max(1) as f64).sqrt()
}

fn mounting(trials: &[FitTrial]) -> Mounting {
    let count = trials.len() as f64;
    let mean = [0, 1].map(|k| trials.iter().map(|trial| trial.askew_deg[k]).sum::<f64>() / count);
    let error = [0, 1].map(|k| {
        let squares: f64 = trials.iter().map(|trial| powi(trial.askew_deg[k] - mean[k], 2)).sum();
        (squares / (count - 1.0) / count).sqrt()
    });
    let [pitch_deg, roll_deg] = mean;
    Mounting { pitch_deg, roll_deg, std_error_deg: (trials.len() > 1).then_some(error) }
}
