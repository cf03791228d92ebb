//! The limits of a fit: parameters that the trials do not determine, and trials that the model does not describe.

use super::data::FitTrial;
use super::errors::TrialErrors;
use super::weights::Weights;
use super::{ASSUMED_REST_DEG, Blocks, Parameter};
use crate::plan::{FittedParameter, MAX_FACTOR};
use crate::text;
use crate::trial::sensor_error;
use nalgebra::DMatrix;
use sim::accuracy::ModelError;
use sim::functions::powi;

/// Largest correlation between two separable parameters.
const MAX_CORRELATION: f64 = 0.95;

/// Largest half width of an angle's interval if it counts as determined, degrees.
const MAX_ANGLE_DEG: f64 = 40.0;

/// Ratio of a trial's residuals to their noise above which the model does not describe the trial. For a good model it
/// is about 1.
const MISFIT: f64 = 5.0;

/// Number of misfits listed by name.
const NAMED: usize = 4;

/// Estimated sensor error, in standard uncertainties, above which it is implausible.
const SENSOR_LIMIT: f64 = 4.0;

/// Quantile above which a note states the number of standard errors in an interval.
const USUAL_QUANTILE: f64 = 3.0;

/// RMS error above which a fit that did not leave its start has failed, degrees: it exceeds the model's own error.
const STUCK_DEG: f64 = 10.0;

/// Returns a warning about a fit that did not leave its start.
pub(super) fn stuck(has_moved: bool, rmse_deg: f64) -> Option<String> {
    (!has_moved && rmse_deg > STUCK_DEG).then(|| {
        format!("the fit did not leave its start, where the RMS error is {rmse_deg:.0}°: start from another robot with --robot")
    })
}

/// Returns a warning about parameters that have not reached the minimum.
pub(super) fn short(parameters: &[&str]) -> Option<String> {
    (!parameters.is_empty()).then(|| {
        format!(
            "the fit has not reached its minimum in {}: fit again with --robot from the robot file that it writes",
            parameters.join(", ")
        )
    })
}

/// Returns descriptions of the parameters that cannot be separated or are not determined.
pub(super) fn cannot_tell(
    estimates: &[FittedParameter],
    correlations: &DMatrix<f64>,
    parameters: &[Parameter],
) -> Vec<String> {
    let mut said = Vec::new();
    for i in 0..estimates.len() {
        for j in 0..i {
            let correlation = correlations[(i, j)];
            if correlation.abs() > MAX_CORRELATION {
                let (one, other) = (&estimates[j].name, &estimates[i].name);
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
    for (FittedParameter { name, unit, value, interval_95: [low, high], .. }, parameter) in
        estimates.iter().zip(parameters)
    {
        let is_known = if parameter.is_angle() {
            high - low < 2.0 * MAX_ANGLE_DEG
        } else {
            high / value < MAX_FACTOR && value / low < MAX_FACTOR
        };
        if !is_known {
            let interval = format!("{} to {} {unit}", text::figure(*low), text::figure(*high));
            said.push(format!("{name} is not determined: its 95 % interval is {}", interval.trim_end_matches(" 1")));
        }
    }
    said
}

/// Returns descriptions of residuals that are much larger than the noise, for a real robot plus the model's error.
/// `errors`: modelled minus measured, degrees.
pub(super) fn misfits(
    trials: &[FitTrial],
    weights: &Weights,
    errors: &[Blocks],
    model_error: &ModelError,
) -> Vec<String> {
    let left = weights.without_sensors(errors);
    let mut found: Vec<(f64, String)> = Vec::new();
    for (trial, left) in trials.iter().zip(&left) {
        for (k, angle) in ["yaw", "pitch", "roll"].into_iter().enumerate() {
            let [residual_deg, noise_deg] = residual_and_noise(&trial.errors, k, left[k].as_slice());
            let of_model_deg = if trial.is_real { model_error_deg(model_error, trial, k) } else { 0.0 };
            let ratio = residual_deg / noise_deg;
            if residual_deg > MISFIT * noise_deg + of_model_deg {
                let text = format!(
                    "{}: the residual of the {angle} is {residual_deg:.2}° RMS, {ratio:.0} times its noise",
                    trial.name
                );
                found.push((ratio, text));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut said: Vec<String> = found.iter().take(NAMED).map(|(_, text)| text.clone()).collect();
    if found.len() > NAMED {
        said.push(format!("residuals of {} more angles are more than {MISFIT} times their noise", found.len() - NAMED));
    }
    for (first, each) in weights.sensors(errors) {
        let Some((k, error)) = each.iter().enumerate().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) else { continue };
        let (of, times, name) = (sensor_error(k), error.abs(), &trials[first].name);
        if times > SENSOR_LIMIT {
            said.push(format!(
                "the fit takes an error of the sensor ({of}) to be {times:.0} times its standard uncertainty, for {name} and the \
                 other trials of its board"
            ));
        }
    }
    if !said.is_empty() {
        said.push(
            "the model does not describe these trials, whatever these parameters are, and the intervals do not hold: \
             compare tank, head and flagella of the robot file with the robot, and check the trials; without encoders the \
             start of the motors, which is not measured, may be the cause"
                .to_owned(),
        );
    }
    said
}

/// Returns the root mean squares of an angle's residuals and of their noise, degrees.
fn residual_and_noise(errors: &TrialErrors, angle: usize, residuals: &[f64]) -> [f64; 2] {
    let noise = errors.own[angle].diagonal().iter().map(|variance| variance + powi(ASSUMED_REST_DEG, 2)).sum::<f64>();
    let square = residuals.iter().map(|residual| residual * residual).sum::<f64>();
    [square, noise].map(|sum| (sum / residuals.len().max(1) as f64).sqrt())
}

/// Returns the root mean square of the model's error in an angle, degrees.
fn model_error_deg(error: &ModelError, trial: &FitTrial, angle: usize) -> f64 {
    let [yaw, pitch, roll] = &trial.measured;
    let each =
        yaw.iter().zip(pitch).zip(roll).map(|((yaw, pitch), roll)| error.of_angles_deg([*yaw, *pitch, *roll])[angle]);
    (each.map(|deg| deg * deg).sum::<f64>() / yaw.len().max(1) as f64).sqrt()
}

/// Returns notes about intervals that are much wider than twice the standard error. `quantiles`: one per parameter.
pub(super) fn wide_quantiles(
    estimates: &[FittedParameter],
    quantiles: &[f64],
    degrees_of_freedom: f64,
) -> Option<String> {
    let wide: Vec<String> = (estimates.iter().zip(quantiles))
        .filter(|(_, quantile)| **quantile > USUAL_QUANTILE)
        .map(|(estimate, quantile)| format!("{} {quantile:.1}", estimate.name))
        .collect();
    (!wide.is_empty()).then(|| {
        format!(
            "the residuals are so correlated that they count as {} beyond the parameters, so the 95 % intervals reach more \
             than 2 standard errors to either side (Student's distribution): {}",
            independent_values(degrees_of_freedom),
            wide.join(", ")
        )
    })
}

/// Returns a note if the fit has made the errors larger.
pub(super) fn risen(before_deg: f64, after_deg: f64) -> Option<String> {
    (after_deg > before_deg).then(|| {
        "the RMSE is larger after the fit than before: the fit weights the residuals by the errors of trial and sensor, so that \
         an offset which these explain counts little in the fit, and in full in the RMSE"
            .to_owned()
    })
}

fn independent_values(degrees_of_freedom: f64) -> String {
    if degrees_of_freedom < 1.5 {
        "one independent value".to_owned()
    } else {
        format!("{degrees_of_freedom:.0} independent values")
    }
}
