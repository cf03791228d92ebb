//! The steady errors of all trials of a session together, compared with chance.

use super::comparison::{Chance, SessionAngle};
use crate::statistics::{ExpectedRms, beyond_chance, effective_freedom, student_95};
use crate::twin::{AngleComparison, Comparison, Uncertainty};
use nalgebra::DMatrix;
use sim::functions::powi;

/// Share of tests that find a difference although there is none.
const ALARMS: f64 = 0.05;

/// Returns the steady errors over all trials for each angle with a known, nonzero uncertainty.
pub(super) fn angles(trials: &[Comparison]) -> Vec<SessionAngle> {
    [0, 1, 2].into_iter().filter_map(|k| of_angle(trials, k)).collect()
}

fn of_angle(trials: &[Comparison], k: usize) -> Option<SessionAngle> {
    let known = |trial: &&Comparison| trial.angles[k].p_value().is_some();
    let trials: Vec<&Comparison> = trials.iter().filter(known).collect();
    let angle = |i: usize| -> &AngleComparison { &trials[i].angles[k] };
    let uncertainty = |i: usize| -> Uncertainty { angle(i).uncertainty.unwrap_or_default() };
    let count = trials.len();
    let first = trials.first()?;
    let covariance = DMatrix::from_fn(count, count, |i, j| {
        if i == j {
            return powi(uncertainty(i).u_deg, 2);
        }
        let is_one_sensor = trials[i].sensors == trials[j].sensors;
        let sensor = if is_one_sensor { angle(i).budget.covariance_with(&angle(j).budget) } else { 0.0 };
        // Several repeats may be compared with the same recording.
        let is_one_trial = trials[i].modelled == trials[j].modelled;
        sensor + if is_one_trial { powi(angle(i).other_u_deg, 2) } else { 0.0 }
    });
    // The sensor's errors are known with infinitely many degrees of freedom.
    let parts = || (0..count).map(|i| (powi(uncertainty(i).u_deg, 2), uncertainty(i).degrees_of_freedom));
    let freedom = |variance: f64| effective_freedom(variance, parts());
    let number = count as f64;
    let errors = || (0..count).map(|i| angle(i).error_deg);
    let expected = ExpectedRms::new(&covariance, freedom(covariance.trace()));
    Some(SessionAngle {
        angle: first.angles[k].angle,
        trials: count,
        mean_error_deg: errors().sum::<f64>() / number,
        mean_uncertainty_deg: student_95(freedom(covariance.sum())) * covariance.sum().max(0.0).sqrt() / number,
        rms_error_deg: (errors().map(|error| error * error).sum::<f64>() / number).sqrt(),
        rms_allowed_deg: expected.bound,
        independent_trials: expected.independent,
    })
}

/// Counts the differences, and marks the trials with a difference that chance does not explain. Returns `None` if no
/// test involves chance.
pub(super) fn chance(trials: &mut [Comparison]) -> Option<Chance> {
    let of_trial = |trial: &Comparison| trial.angles.each_ref().map(AngleComparison::p_value);
    let tests: Vec<(usize, f64)> = (trials.iter().enumerate())
        .flat_map(|(i, trial)| of_trial(trial).into_iter().flatten().map(move |p_value| (i, p_value)))
        .collect();
    let p_values: Vec<f64> = tests.iter().map(|(_, p_value)| *p_value).collect();
    for ((i, _), is_beyond) in tests.iter().zip(beyond_chance(&p_values)) {
        trials[*i].is_beyond_chance |= is_beyond;
    }
    let beyond = trials.iter().filter(|trial| trial.is_beyond_chance).map(|trial| trial.name.clone());
    (!tests.is_empty()).then(|| Chance {
        tests: tests.len(),
        alarms: p_values.iter().filter(|p_value| **p_value < ALARMS).count(),
        expected_alarms: ALARMS * tests.len() as f64,
        beyond: beyond.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Budget, CommonTo, Term};

    /// Returns a trial with an error of the yaw. Its uncertainty is `noise_deg` from the trial and `scale_deg` from the
    /// sensor.
    pub fn trial(name: &str, error_deg: f64, noise_deg: f64, scale_deg: f64) -> Comparison {
        let u_deg = noise_deg.hypot(scale_deg);
        let uncertainty = Some(Uncertainty {
            noise_deg: 1.96 * noise_deg,
            sensor_deg: 1.96 * scale_deg.abs(),
            total_deg: 1.96 * u_deg,
            u_deg,
            degrees_of_freedom: f64::INFINITY,
        });
        let budget = Budget::new([Term::new("scale", CommonTo::Sensor, [(scale_deg, f64::INFINITY)])]);
        let yaw = AngleComparison { angle: "yaw", error_deg, uncertainty, budget, ..AngleComparison::default() };
        let angles = [yaw, AngleComparison::default(), AngleComparison::default()];
        Comparison { name: name.to_owned(), angles, ..Comparison::default() }
    }

    #[test]
    fn errors_of_the_sensor_do_not_average_out() {
        let of = |noise: f64, scale: f64| {
            let trials: Vec<Comparison> = (0..16).map(|_| trial("", 0.5, noise, scale)).collect();
            let [yaw] = angles(&trials).try_into().unwrap();
            yaw
        };
        let noise = of(0.4, 0.0);
        assert!((noise.mean_uncertainty_deg - 1.96 * 0.1).abs() < 1e-3 && noise.differs(), "{noise:?}");
        assert!((noise.independent_trials - 16.0).abs() < 1e-9);
        let scale = of(0.0, 0.4);
        assert!((scale.mean_uncertainty_deg - 1.96 * 0.4).abs() < 1e-3 && !scale.differs(), "{scale:?}");
        assert!((scale.independent_trials - 1.0).abs() < 1e-9 && (scale.rms_allowed_deg - 1.96 * 0.4).abs() < 1e-3);
        // Trials with opposite yaws have opposite errors from the same scale.
        let opposite: Vec<Comparison> = [1.0, -1.0].map(|sign| trial("", sign, 0.1, 0.4 * sign)).into();
        let [yaw] = angles(&opposite).try_into().unwrap();
        assert!((yaw.mean_uncertainty_deg - 1.96 * 0.1 / 2f64.sqrt()).abs() < 1e-3, "{yaw:?}");
    }

    #[test]
    fn noise_of_a_recording_that_several_are_compared_with_does_not_average_out() {
        let trials: Vec<Comparison> = (0..16)
            .map(|_| {
                let mut trial = trial("", 0.5, 0.5, 0.0);
                (trial.modelled, trial.angles[0].other_u_deg) = ("one.mcap".into(), 0.4);
                trial
            })
            .collect();
        let [yaw] = angles(&trials).try_into().unwrap();
        // 0.3² is divided by sixteen trials; 0.4² is common.
        assert!((yaw.mean_uncertainty_deg - 1.96 * (0.09f64 / 16.0 + 0.16).sqrt()).abs() < 1e-3, "{yaw:?}");
    }

    #[test]
    fn alarms_by_chance_are_not_flagged() {
        let mut trials: Vec<Comparison> = (0..20).map(|i| trial(&i.to_string(), 0.1, 0.5, 0.0)).collect();
        trials[3] = trial("3", 1.1, 0.5, 0.0);
        let found = chance(&mut trials).unwrap();
        assert_eq!((found.tests, found.alarms, found.beyond.len()), (20, 1, 0));
        assert!((found.expected_alarms - 1.0).abs() < 1e-12);
        trials[7] = trial("7", 3.0, 0.5, 0.0);
        let found = chance(&mut trials).unwrap();
        assert_eq!((found.alarms, found.beyond), (2, vec!["7".to_owned()]));
        assert!(trials[7].is_beyond_chance && !trials[3].is_beyond_chance);
        assert_eq!(chance(&mut [trial("models", 0.5, 0.0, 0.0)]), None);
    }
}
