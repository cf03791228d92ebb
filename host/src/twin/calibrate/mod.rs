//! A robot's parameters from its trials: least squares between model and experiment.
//!
//! Yaw, pitch and roll of every trial are averaged over blocks of half a second, from the start of the run to the end of
//! the decay, and the model is made to meet them by Levenberg's and Marquardt's method. Parameters are fitted as
//! logarithms over their start.
//!
//! Residuals that follow each other are alike, and standard errors that took them for independent would be too small
//! several times over. The fit weighs blocks by what the sensor does by itself (the random walk of the yaw, the walk of
//! the gyroscope's bias since it was still, the levelling, the error of the zeros), what the model's numbers and the clocks
//! leave, and a guess at the rest, as if that were independent. Weights that took the rest for as alike as it is would be
//! sharper, but trust the first moments of a motion more than model and clocks deserve: a delay of 5 ms then moved the
//! tether by 3 %. How large and how alike the residuals are, taken for a process of first order for each angle, goes into
//! the standard errors, which hold for whatever weights the fit had (White 1980, Econometrica 48, 817; Seber and Wild 2003,
//! Nonlinear Regression, chapter 6). To them the model's own numbers add theirs. What is wrong with the model itself, the
//! fit takes for noise that lasts.

mod data;
mod file;
mod parameter;
mod problem;

pub use file::to_toml;
pub use parameter::Parameter;

use super::replay::pool;
use super::{Recording, TwinError};
use crate::attitude::student_95;
use data::{Correlated, Data, Whitener};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::DMatrix;
use problem::Problem;
use rayon::prelude::*;
use serde::Serialize;
use sim::body::closure::Closure;
use sim::params::Robot;
use std::path::PathBuf;

/// The fit has ended where no parameter moves by more than this share of itself; a part of a standard error.
const PRECISION: f64 = 1e-3;

/// A fit that has not ended after this many times as many evaluations as parameters will not.
const PATIENCE: usize = 20;

/// Two parameters with a correlation beyond this are told apart badly.
const ALIKE: f64 = 0.95;

/// A standard error beyond this share of the value tells little.
const VAGUE: f64 = 0.2;

/// What to fit to what.
#[derive(Debug)]
pub struct Request {
    /// The robot to start from; `None`: that of the first trial.
    pub robot: Option<Robot>,
    /// The closure; `None`: that of the first trial's model, and `full` where it has none.
    pub closure: Option<Closure>,
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// Simulations at a time.
    pub jobs: usize,
}

/// A parameter, fitted.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Estimate {
    /// Its name.
    pub name: &'static str,
    /// Its key in the robot's file.
    pub key: Option<&'static str>,
    /// Its unit.
    pub unit: &'static str,
    /// The value that the fit started from.
    pub start: f64,
    /// The fitted value.
    pub value: f64,
    /// Its standard error.
    pub std_error: f64,
    /// The 95 % interval: from, to.
    pub interval_95: [f64; 2],
}

/// A trial that was fitted to.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Fitted {
    /// Its name.
    pub name: String,
    /// Its log.
    pub log: PathBuf,
    /// SHA-256 of the log.
    pub sha256: String,
    /// Root of the mean square of the errors of yaw, pitch and roll with the start's parameters.
    pub rmse_before_deg: [f64; 3],
    /// The same with the fitted ones.
    pub rmse_after_deg: [f64; 3],
}

/// How the sensor sits in the body, from the still phases.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Mounting {
    /// Mean pitch at rest.
    pub pitch_deg: f64,
    /// Mean roll at rest.
    pub roll_deg: f64,
    /// Standard errors of both, from the scatter between trials; `None` for a single one.
    pub std_error_deg: Option<[f64; 2]>,
}

/// What a fit came to.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Calibration {
    /// The parameters.
    pub parameters: Vec<Estimate>,
    /// Correlations of their errors, in the same order.
    pub correlations: Vec<Vec<f64>>,
    /// Largest over least eigenvalue of the correlations: how nearly some mixture of parameters is not told at all.
    pub condition_number: f64,
    /// What the data cannot tell, in sentences.
    pub cannot_tell: Vec<String>,
    /// Root of the mean square of all errors with the start's parameters.
    pub rmse_before_deg: f64,
    /// The same with the fitted ones.
    pub rmse_after_deg: f64,
    /// How the sensor sits in the body.
    pub mounting: Mounting,
    /// The trials.
    pub trials: Vec<Fitted>,
    /// The closure that it goes for.
    pub closure: Closure,
    /// How often the trials were simulated, all together.
    pub simulations: usize,
    /// What whoever uses it should know.
    pub warnings: Vec<String>,
    /// The fitted robot.
    #[serde(skip)]
    pub robot: Robot,
}

/// Fits parameters of a robot to recorded trials. `progress` is told of each simulation of a trial that ends.
///
/// # Errors
/// [`TwinError::Unusable`] where a trial says too little, [`TwinError::Fit`] where the fit does not end.
pub fn calibrate(
    recordings: &[Recording],
    request: &Request,
    progress: &(dyn Fn() + Sync),
) -> Result<Calibration, TwinError> {
    let pool = pool(request.jobs)?;
    pool.install(|| fit(recordings, request, progress))
}

fn fit(recordings: &[Recording], request: &Request, progress: &(dyn Fn() + Sync)) -> Result<Calibration, TwinError> {
    let trials: Vec<_> = recordings.par_iter().map(Data::new).collect::<Result<_, _>>()?;
    let Some(recording) = recordings.first() else {
        return Err(failed("there are no trials", "name the logs of one or more trials"));
    };
    let mut warnings: Vec<String> =
        trials.iter().flat_map(|trial| trial.warnings.iter().map(|text| format!("{}: {text}", trial.name))).collect();
    let mut start = match &request.robot {
        Some(robot) => robot.clone(),
        None => recording.robot()?,
    };
    let closure = request.closure.or(recording.model.as_ref().map(|model| model.closure)).unwrap_or(Closure::Full);
    if let Some(mixture) = start.fluid.glycerol.as_mut() {
        mixture.temperature_c = trials.iter().map(|trial| trial.temperature_c).sum::<f64>() / trials.len() as f64;
        let (share, celsius) = (mixture.mass_fraction, mixture.temperature_c);
        start.fluid.viscosity_pa_s = start.fluid.viscosity();
        start.fluid.density_kg_m3 = start.fluid.density();
        start.fluid.glycerol = None;
        warnings.push(format!(
            "the viscosity starts from that of {:.1} % glycerol at the sensor's {celsius:.1} °C: {:.3} Pa s",
            100.0 * share,
            start.fluid.viscosity_pa_s
        ));
    }

    let simulations = std::sync::atomic::AtomicUsize::new(0);
    let simulated = |count: usize| {
        simulations.fetch_add(count, std::sync::atomic::Ordering::Relaxed);
        progress();
    };
    let parameters = request.parameters.as_slice();
    let given = (trials.as_slice(), &start, closure);
    let whiteners = whiteners(&trials, [Correlated::guess(); 3])?;
    let problem = Problem::new(given, parameters, &whiteners, &simulated, vec![0.0; parameters.len()]);
    let Some(errors_before) = problem.errors() else {
        return Err(failed(
            "the model of the start's parameters does not end",
            "start from another robot with --robot",
        ));
    };
    let problem = minimise(problem)?;
    let errors = problem.errors().unwrap_or_default();
    let rest = problem::correlations(&errors);
    let covariance = covariance(&problem, &self::whiteners(&trials, rest)?)?;

    // What the parameters took up of the residuals is not seen in them any more.
    let blocks: usize = trials.iter().map(Data::blocks).sum();
    let independent: f64 = rest.iter().map(|rest| rest.independent(blocks)).sum();
    let freedom = (independent - parameters.len() as f64).max(1.0);
    let taken_up = (independent / freedom).sqrt();
    let deviation = |(i, parameter): (usize, &Parameter)| {
        (taken_up * covariance[(i, i)].max(0.0).sqrt()).hypot(parameter.numbers())
    };
    let deviations: Vec<f64> = parameters.iter().enumerate().map(deviation).collect();
    let quantile = student_95(freedom);
    let estimates: Vec<_> = parameters
        .iter()
        .zip(problem.moved().iter().zip(&deviations))
        .map(|(parameter, (moved, deviation))| {
            let value = |moved| parameter.value(&start, closure, moved);
            Estimate {
                name: parameter.name(),
                key: parameter.key(closure),
                unit: parameter.unit(),
                start: value(0.0),
                value: value(*moved),
                std_error: parameter.error(value(*moved), *deviation),
                interval_95: [-1.0, 1.0].map(|side| value(moved + side * quantile * deviation)),
            }
        })
        .collect();
    let correlations = DMatrix::from_fn(parameters.len(), parameters.len(), |i, j| {
        covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt()
    });
    let eigenvalues = correlations.clone().symmetric_eigenvalues();
    let robot = problem.robot(&start, problem.moved());
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
        rmse_after_deg: rms(errors.iter().flatten()),
        mounting: mounting(&trials),
        trials: (0..trials.len()).map(fitted).collect(),
        closure,
        simulations: simulations.into_inner(),
        warnings,
        robot,
    })
}

fn failed(reason: &str, help: &'static str) -> TwinError {
    TwinError::Fit { reason: reason.to_owned(), help }
}

fn whiteners(trials: &[Data], rest: [Correlated; 3]) -> Result<Vec<[Whitener; 3]>, TwinError> {
    let one = |trial: &Data| match [0, 1, 2].map(|k| trial.whitener(k, rest[k])) {
        [Some(yaw), Some(pitch), Some(roll)] => Ok([yaw, pitch, roll]),
        _ => Err(failed("the noise of a trial makes no sense", "leave out trials whose logs are damaged")),
    };
    trials.par_iter().map(one).collect()
}

fn minimise(problem: Problem) -> Result<Problem, TwinError> {
    let method = LevenbergMarquardt::new().with_tol(PRECISION).with_patience(PATIENCE);
    let (problem, report) = method.minimize(problem);
    if report.termination.was_successful() {
        return Ok(problem);
    }
    let reason = format!("{:?} after {} evaluations", report.termination, report.number_of_evaluations);
    Err(failed(&reason, "fit fewer parameters with --fit, or to trials at other speeds"))
}

/// Covariance of what the fit moved, where errors have the covariance `noise`, whatever the weights of the fit were.
fn covariance(problem: &Problem, noise: &[[Whitener; 3]]) -> Result<DMatrix<f64>, TwinError> {
    let blind = || failed("the trials do not tell all parameters", "fit fewer parameters with --fit");
    let jacobian = problem.jacobian().ok_or_else(blind)?;
    let jacobian = DMatrix::from_column_slice(jacobian.nrows(), jacobian.ncols(), jacobian.as_slice());
    let scale: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
    if scale.iter().any(|norm| *norm == 0.0 || !norm.is_finite()) {
        return Err(blind());
    }
    let scaled = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, j| jacobian[(i, j)] / scale[j]);
    let inverse = (scaled.transpose() * &scaled).cholesky().ok_or_else(blind)?.inverse();
    // How far each error moves each parameter, spread by what errors there are.
    let mut spread = scaled;
    let mut first = 0;
    for (weights, noise) in problem.whiteners.iter().flatten().zip(noise.iter().flatten()) {
        let count = weights.count();
        for j in 0..spread.ncols() {
            let mut part = spread.view((first, j), (count, 1)).column(0).into_owned();
            weights.whiten_transposed(&mut part);
            spread.view_mut((first, j), (count, 1)).copy_from(&noise.spread(&part));
        }
        first += count;
    }
    let covariance = &inverse * (spread.transpose() * spread) * &inverse;
    Ok(DMatrix::from_fn(scale.len(), scale.len(), |i, j| covariance[(i, j)] / (scale[i] * scale[j])))
}

fn cannot_tell(estimates: &[Estimate], correlations: &DMatrix<f64>, parameters: &[Parameter]) -> Vec<String> {
    let mut said = Vec::new();
    for i in 0..estimates.len() {
        for j in 0..i {
            let correlation = correlations[(i, j)];
            if correlation.abs() > ALIKE {
                let (one, other) = (estimates[j].name, estimates[i].name);
                let mixture = if correlation > 0.0 { "ratio" } else { "product" };
                said.push(format!(
                    "{one} and {other} are hardly told apart (correlation {correlation:+.3}): the data tell their {mixture}"
                ));
            }
        }
    }
    for (estimate, parameter) in estimates.iter().zip(parameters) {
        let share = estimate.std_error / estimate.value.abs();
        if parameter.is_of_the_robot() && share > VAGUE {
            said.push(format!("{} is told to {:.0} % only (standard error)", estimate.name, 100.0 * share));
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

fn mounting(trials: &[Data]) -> Mounting {
    let count = trials.len() as f64;
    let mean = [0, 1].map(|k| trials.iter().map(|trial| trial.askew_deg[k]).sum::<f64>() / count);
    let error = [0, 1].map(|k| {
        let squares: f64 = trials.iter().map(|trial| (trial.askew_deg[k] - mean[k]).powi(2)).sum();
        (squares / (count - 1.0) / count).sqrt()
    });
    let [pitch_deg, roll_deg] = mean;
    Mounting { pitch_deg, roll_deg, std_error_deg: (trials.len() > 1).then_some(error) }
}
