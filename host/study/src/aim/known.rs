//! What is known about the robot's parameters, and why no confidence can be stated for predictions made with them.

use crate::plan::{Fit, FittedParameter, FittedTo, MAX_FACTOR};
use serde::Serialize;
use sim::accuracy::ModelError;
use sim::body::closure::Closure;
use sim::functions::powi;
use sim::params::Robot;

/// The confidence of the intervals, if it can be stated.
const CONFIDENCE: f64 = 0.95;

/// What is known about a robot.
#[derive(Clone, PartialEq, Debug)]
pub struct Known {
    /// The fit of its parameters; `None` for a robot that was not fitted.
    pub fit: Option<Fit>,
    /// The model's error; `None` for a robot fitted to a simulation, which has no such error.
    pub model_error: Option<ModelError>,
    /// Why no confidence can be stated.
    pub doubts: Vec<Doubt>,
}

/// A reason why an interval has no stated confidence.
#[derive(Serialize, Clone, PartialEq, Eq, Debug)]
pub struct Doubt {
    /// The reason.
    pub reason: String,
    /// Whether the user should do something about it, and the exit code is 3.
    pub is_grave: bool,
}

impl Known {
    /// Returns what the robot's file says about its parameters.
    pub fn new(robot: &Robot, fit: Option<Fit>) -> Self {
        let is_simulated = fit.as_ref().is_some_and(|fit| fit.fitted_to == FittedTo::Simulation);
        let model_error = (!is_simulated).then(|| ModelError::of(robot));
        let doubts = fit.as_ref().map_or_else(
            || vec![slight("the robot's parameters were not fitted, so their uncertainties are unknown".to_owned())],
            |fit| doubts(robot, fit),
        );
        Self { fit, model_error, doubts }
    }

    /// Returns the confidence of the intervals; `None` if it cannot be stated.
    pub fn confidence(&self) -> Option<f64> {
        self.doubts.is_empty().then_some(CONFIDENCE)
    }
}

fn slight(reason: String) -> Doubt {
    Doubt { reason, is_grave: false }
}

fn doubts(robot: &Robot, fit: &Fit) -> Vec<Doubt> {
    let mut reasons = Vec::new();
    if fit.lacks_correlations {
        let reason = "an earlier version wrote the robot file, without correlations: fit again with `biflag calibrate`";
        reasons.push(reason.to_owned());
    }
    if fit.closure != Closure::Full {
        let closure = format!("{:?}", fit.closure).to_lowercase();
        reasons.push(format!("the robot was fitted for the closure {closure}, and these are attitudes of the closure full: fit again with --closure full"));
    }
    let changed = fit.changed(robot);
    if !changed.is_empty() {
        reasons.push(format!("the robot file has other values than its fit: {}", changed.join(", ")));
    }
    if !fit.is_described {
        reasons.push("the model did not describe the trials of the fit within their noise".to_owned());
    }
    if !fit.short_of_minimum.is_empty() {
        let names = fit.short_of_minimum.join(", ");
        reasons.push(format!(
            "the fit has not reached its minimum in {names}: fit again with `biflag calibrate --robot` from this file"
        ));
    }
    // The angles of the flagella are not needed: the intervals hold for all angles.
    let is_unknown = |parameter: &&FittedParameter| {
        let [low, high] = parameter.interval_95;
        parameter.unit != "deg" && !(low > 0.0 && high / low < powi(MAX_FACTOR, 2))
    };
    let unknown: Vec<_> = fit.parameters.iter().filter(is_unknown).map(|parameter| parameter.name.as_str()).collect();
    if !unknown.is_empty() {
        reasons.push(format!("the fit has not determined {}", unknown.join(", ")));
    }
    reasons.into_iter().map(|reason| Doubt { reason, is_grave: true }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a fit of the viscosity of a robot.
    fn fit(change: impl Fn(&mut Fit)) -> Fit {
        let parameter = FittedParameter {
            name: "viscosity".to_owned(),
            key: Some("fluid.viscosity_pa_s".to_owned()),
            unit: "Pa s".to_owned(),
            start: 1.0,
            value: 1.0,
            std_error: 0.02,
            interval_95: [0.96, 1.04],
            model_error: None,
        };
        let mut fit = Fit {
            closure: Closure::Full,
            fitted_to: FittedTo::Simulation,
            is_described: true,
            short_of_minimum: Vec::new(),
            temperature_c: Some(20.0),
            degrees_of_freedom: 10.0,
            covariance: vec![vec![4e-4]],
            scatter_covariance: vec![vec![0.0]],
            lacks_correlations: false,
            parameters: vec![parameter],
        };
        change(&mut fit);
        fit
    }

    #[test]
    fn confidence_is_stated_for_a_sound_fit_alone() {
        let robot = Robot::default();
        let known = |change: fn(&mut Fit)| Known::new(&robot, Some(fit(change)));
        assert_eq!((known(|_| {}).confidence(), known(|_| {}).model_error), (Some(0.95), None));
        assert!(known(|fit| fit.fitted_to = FittedTo::Robot).model_error.is_some());
        for (change, words) in [
            ((|fit| fit.closure = Closure::Lumped) as fn(&mut Fit), "closure lumped"),
            (|fit| fit.parameters[0].value = 1.01, "other values than its fit: viscosity"),
            (|fit| fit.is_described = false, "did not describe"),
            (|fit| fit.short_of_minimum = vec!["viscosity".to_owned()], "not reached its minimum in viscosity"),
            (|fit| fit.parameters[0].interval_95 = [0.35, 2.8], "not determined viscosity"),
            (|fit| fit.lacks_correlations = true, "earlier version"),
        ] {
            let known = known(change);
            assert_eq!(known.confidence(), None);
            let [Doubt { reason, is_grave: true }] = known.doubts.as_slice() else { panic!("{known:?}") };
            assert!(reason.contains(words), "{reason}");
        }
        let tilt = |rod_radius_m: f64| {
            let mut robot = robot.clone();
            robot.flagellum.rod_radius_m = rod_radius_m;
            Known::new(&robot, Some(fit(|fit| fit.fitted_to = FittedTo::Robot))).model_error.unwrap().tilt()
        };
        assert!(tilt(0.0062) > 1.1 * tilt(0.0021), "lines miss more of the flow of thick rods");
        let unfitted = Known::new(&robot, None);
        assert!(unfitted.confidence().is_none() && unfitted.model_error.is_some() && !unfitted.doubts[0].is_grave);
    }
}
