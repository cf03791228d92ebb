//! The causes of uncertainty of an angle, with the sign of each sensor error. So errors common to two angles cancel in
//! their difference, instead of counting twice.

use super::budget::{Budget, Term};
use crate::sensor::{GROUPS, PARAMETERS};
use nalgebra::DMatrix;
use sim::functions::{hypot, powi};

/// Number of errors shared by all trials of a sensor: [`crate::sensor::Sensor::parameters`], and the rate of the
/// board's clock.
pub const SENSOR_ERRORS: usize = PARAMETERS + 1;

/// Returns the name of one of these errors, as in budgets.
pub fn sensor_error(index: usize) -> &'static str {
    GROUPS.iter().find(|group| group.range.contains(&index)).map_or("clock", |group| group.name)
}

/// The causes of uncertainty of an angle.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Causes {
    /// The trial's own causes.
    pub own: Vec<Term>,
    /// Effect on the angle of one standard uncertainty of each sensor error, degrees. Empty for a model; for two
    /// sensors, one list after the other.
    pub effects_deg: Vec<f64>,
}

impl Causes {
    /// Returns the causes of uncertainty of the difference of two angles. Readings of one sensor have the same errors.
    pub fn of_difference(one: &Self, other: &Self, is_same_sensor: bool) -> Self {
        let own = both_sums(&one.own, &other.own);
        let effects_deg = if is_same_sensor {
            one.effects_deg.iter().zip(&other.effects_deg).map(|(one, other)| other - one).collect()
        } else {
            one.effects_deg.iter().map(|effect| -effect).chain(other.effects_deg.iter().copied()).collect()
        };
        Self { own, effects_deg }
    }

    /// Returns the causes as a budget.
    pub fn budget(&self) -> Budget {
        let of_sensors = |range: std::ops::Range<usize>| {
            let each = self.effects_deg.chunks(SENSOR_ERRORS).flat_map(|sensor| &sensor[range.clone()]);
            each.map(|effect| powi(*effect, 2)).sum::<f64>().sqrt()
        };
        let groups = GROUPS.iter().map(|group| (group.name, group.range.clone()));
        let common = groups.chain([("clock", PARAMETERS..SENSOR_ERRORS)]).map(|(name, range)| Term {
            sensitivity: None,
            ..Term::of_sensor(name, std::iter::once((of_sensors(range), 1.0)))
        });
        Budget::new(self.own.iter().cloned().chain(common))
    }
}

/// Returns the terms of two trials; terms of the same name are combined.
fn both_sums(one: &[Term], other: &[Term]) -> Vec<Term> {
    let mut sums = one.to_vec();
    for term in other {
        match sums.iter_mut().find(|sum| sum.name == term.name) {
            Some(sum) => {
                // Welch and Satterthwaite.
                let [a, b] = [&*sum, term].map(|term| powi(term.u_deg, 4) / term.degrees_of_freedom);
                let u_deg = hypot(sum.u_deg, term.u_deg);
                sum.degrees_of_freedom = if a + b > 0.0 { powi(u_deg, 4) / (a + b) } else { f64::INFINITY };
                sum.u_deg = u_deg;
            }
            None => sums.push(term.clone()),
        }
    }
    sums
}

/// The uncertainty of an angle over times.
#[derive(Clone, PartialEq, Debug)]
pub struct OverTime {
    /// Covariance between the times due to the trial's own errors, degrees².
    pub own: DMatrix<f64>,
    /// Effect of each error of the sensor at each time, as in [`Causes`].
    pub effects: DMatrix<f64>,
    /// Variance of the noise of a mean over [`super::BLOCK_S`] that the covariance does not contain, degrees².
    pub block_variance: f64,
}

impl OverTime {
    /// Returns the uncertainty of an exact angle.
    pub fn exact(times: usize) -> Self {
        let zeros = |columns: usize| DMatrix::zeros(times, columns);
        Self { own: zeros(times), effects: zeros(SENSOR_ERRORS), block_variance: 0.0 }
    }

    /// Returns the covariance of the difference between two angles' means over blocks around the times, degrees².
    /// `noise`: the share of [`Self::block_variance`] in the mean of a block, smaller for longer blocks.
    pub fn of_difference(one: &Self, other: &Self, is_same_sensor: bool, noise: f64) -> DMatrix<f64> {
        let common = if is_same_sensor {
            let effects = &other.effects - &one.effects;
            &effects * effects.transpose()
        } else {
            &one.effects * one.effects.transpose() + &other.effects * other.effects.transpose()
        };
        let count = one.own.nrows();
        let noise = DMatrix::from_diagonal_element(count, count, noise * (one.block_variance + other.block_variance));
        &one.own + &other.own + common + noise
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::CommonTo;
    use std::f64::consts::SQRT_2;

    fn causes(noise_deg: f64, scale_deg: f64) -> Causes {
        let mut effects_deg = vec![0.0; SENSOR_ERRORS];
        effects_deg[2] = scale_deg;
        effects_deg[PARAMETERS] = 0.5 * scale_deg;
        Causes { own: vec![Term::of_trial("noise", noise_deg, 4.0)], effects_deg }
    }

    #[test]
    fn two_recordings_of_one_sensor_have_its_scale_error_once() {
        let (one, other) = (causes(0.3, 2.0), causes(0.3, 2.2));
        let same = Causes::of_difference(&one, &other, true).budget();
        assert!((same.sensor_u_deg() - 0.2 * 1.25f64.sqrt()).abs() < 1e-12, "{same:?}");
        let own = same.terms().iter().find(|term| term.common_to == CommonTo::Trial).unwrap();
        assert!((own.u_deg - 0.3 * SQRT_2).abs() < 1e-12 && (own.degrees_of_freedom - 8.0).abs() < 1e-9);
        let others = Causes::of_difference(&one, &other, false).budget();
        assert!((others.sensor_u_deg() - 2f64.hypot(2.2) * 1.25f64.sqrt()).abs() < 1e-12, "{others:?}");
        let names: Vec<_> = others.terms().iter().map(|term| term.name).collect();
        assert_eq!(names, ["noise", "gyroscope scale", "clock"]);
    }

    #[test]
    fn difference_from_a_model_has_the_uncertainty_of_the_recording() {
        let one = causes(0.3, -2.0);
        let budget = Causes::of_difference(&one, &Causes::default(), false).budget();
        assert!((budget.u_deg() - 0.3f64.hypot(2.0 * 1.25f64.sqrt())).abs() < 1e-12);
        assert_eq!(
            Causes::of_difference(&Causes::default(), &Causes::default(), false).budget().uncertainty_deg(),
            0.0
        );
    }

    #[test]
    fn covariance_over_time_cancels_as_the_budget_does() {
        let at = |scale: [f64; 2]| OverTime {
            own: DMatrix::from_element(2, 2, 0.09),
            effects: DMatrix::from_fn(2, SENSOR_ERRORS, |i, k| if k == 2 { scale[i] } else { 0.0 }),
            block_variance: 0.01,
        };
        let (one, other) = (at([1.0, 2.0]), at([1.0, 2.2]));
        let same = OverTime::of_difference(&one, &other, true, 1.0);
        assert!((same[(0, 0)] - 0.20).abs() < 1e-12 && (same[(1, 1)] - 0.24).abs() < 1e-12, "{same}");
        let model = OverTime::of_difference(&one, &OverTime::exact(2), false, 0.5);
        assert!((model[(0, 1)] - (&one.own + &one.effects * one.effects.transpose())[(0, 1)]).abs() < 1e-12);
    }
}
