//! Selects the trials, the robot and the parameters of a fit.

use super::data::FitTrial;
use super::{Parameter, Request, TwinError, failed, phase};
use crate::statistics::each_once;
use crate::text::{count, listed};
use crate::trial::{Finding, LogFinding};
use crate::twin::sensor_key::SensorKey;
use biflag_log::Origin;
use sim::body::closure::Closure;
use sim::params::Robot;

/// Returns the trials that a fit may use: those without grave findings, each recording once.
///
/// # Errors
/// [`TwinError::Fit`] if there are none.
pub(super) fn usable(
    trials: Vec<FitTrial>,
    findings: &[LogFinding],
    warnings: &mut Vec<String>,
) -> Result<Vec<FitTrial>, TwinError> {
    let all = trials.len();
    // One bad trial is enough to move every parameter out of its interval.
    let is_sound = |trial: &FitTrial| !trial.findings.iter().any(Finding::empties_uncertainty);
    let sound: Vec<FitTrial> = trials.into_iter().filter(is_sound).collect();
    if sound.is_empty() {
        let grave: Vec<_> = findings.iter().filter(|of_log| of_log.finding.empties_uncertainty()).collect();
        if grave.is_empty() {
            return Err(failed("there are no trials", "name the logs of one or more trials"));
        }
        let texts: Vec<_> = grave.iter().map(|of_log| format!("{}: {}", of_log.log, of_log.finding)).collect();
        let reason = format!("no trial is sound: {}", texts.join("; "));
        return Err(failed(&reason, "name logs without grave findings"));
    }
    if sound.len() < all {
        warnings.push(format!("{} with grave findings left out of the fit", count(all - sound.len(), "trial")));
    }
    // A model would pull the fit to its own robot.
    let (modelled, measured): (Vec<_>, Vec<_>) = sound.into_iter().partition(|trial| trial.origin == Origin::Model);
    let used = if measured.is_empty() {
        modelled
    } else {
        warnings.extend((!modelled.is_empty()).then(|| {
            let names: Vec<_> = modelled.iter().map(|trial| trial.path.display().to_string()).collect();
            format!("computed by the model, and left out of the fit to recordings: {}", listed(&names))
        }));
        measured
    };
    let mut each: Vec<FitTrial> = Vec::new();
    for trial in used {
        match each.iter_mut().find(|other| trial.is_copy_of(other)) {
            Some(other) => {
                let [one, two] = [&trial.path, &other.path].map(|path| path.display());
                warnings.push(format!("{one} and {two} are the same recording, which counts once"));
                if trial.blocks() > other.blocks() {
                    *other = trial;
                }
            }
            None => each.push(trial),
        }
    }
    if each.iter().any(|trial| trial.before > 0) {
        warnings.push(
            "without encoders the intervals may be too narrow: how the motors start and stop is not measured".into(),
        );
    }
    Ok(each)
}

/// Returns the initial robot and closure of the fit: the requested ones, or the first trial's.
///
/// # Errors
/// [`TwinError::Robot`].
pub(super) fn start(
    trials: &mut [FitTrial],
    request: &Request,
    warnings: &mut Vec<String>,
) -> Result<(Robot, Closure), TwinError> {
    let others = |differs: &dyn Fn(&FitTrial) -> bool| {
        let others: Vec<_> = trials.iter().filter(|trial| differs(trial)).map(|trial| trial.name.as_str()).collect();
        (!others.is_empty()).then(|| others.join(", "))
    };
    let robot = |trial: &FitTrial| trial.robot.as_ref().ok().cloned();
    if request.robot.is_none()
        && let Some(others) = others(&|trial| robot(trial) != robot(&trials[0]))
    {
        warnings.push(format!("{others}: of another robot than {}, from which the fit starts", trials[0].name));
    }
    if request.closure.is_none()
        && let Some(others) = others(&|trial| trial.closure != trials[0].closure)
    {
        warnings.push(format!("{others}: of another closure than {}, whose closure is fitted", trials[0].name));
    }
    let closure = request.closure.or(trials[0].closure).unwrap_or(Closure::Full);
    let of_first = std::mem::replace(&mut trials[0].robot, Ok(Robot::default()));
    Ok((request.robot.clone().map_or(of_first, Ok)?, closure))
}

/// Returns the parameters to fit, or the usual ones if none are requested, and prepares the trials for them.
///
/// # Errors
/// [`TwinError::Fit`] if a parameter cannot be fitted to these trials.
pub(super) fn parameters(
    trials: &mut [FitTrial],
    start: &Robot,
    requested: &[Parameter],
    warnings: &mut Vec<String>,
) -> Result<Vec<Parameter>, TwinError> {
    let is_usual = requested.is_empty();
    let mut parameters = if is_usual { Parameter::usual(start) } else { requested.to_vec() };
    for without in parameters.extract_if(.., |parameter| !parameter.has_effect(start)) {
        let name = without.name();
        warnings
            .push(format!("{name} is not fitted: the head is a body in the flow, and the model does not depend on it"));
    }
    let boards = boards(trials);
    if parameters.contains(&Parameter::MountYaw) && boards > 1 {
        let reason = format!("mount-yaw is the mounting of one sensor, and the trials are of {boards} boards");
        if !is_usual {
            return Err(failed(&reason, "fit the trials of each board alone, or leave mount-yaw out of --fit"));
        }
        warnings.push(format!("mount-yaw is not fitted: {reason}"));
        parameters.retain(|parameter| *parameter != Parameter::MountYaw);
    }
    if parameters.contains(&Parameter::MountYaw) {
        trials.iter_mut().for_each(|trial| trial.errors.without_mounting_yaw());
    }
    phase::with_both(&parameters, trials)
}

/// Returns the number of boards that recorded the trials.
fn boards(trials: &[FitTrial]) -> usize {
    let sensors = trials.iter().filter_map(|trial| trial.errors.sensor.as_ref());
    each_once(sensors.map(SensorKey::board)).len()
}
