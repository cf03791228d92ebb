//! The uncertainty of an angle as the sum of its causes (JCGM 100:2008, the GUM). Every stated ± comes from here.

use crate::statistics::{effective_freedom, student_95};
use serde::Serialize;
use sim::functions::{hypot, powi};

/// Name of the cause for the rest of a slow approach, which the run does not include.
pub const TO_COME: &str = "slow approach";

/// How an uncertainty was evaluated (GUM, 3.3.5).
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Evaluation {
    /// From the scatter of readings.
    A,
    /// By other means: a data sheet, a calibration, an assumption.
    B,
}

/// The values that share this error.
#[derive(Serialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "snake_case")]
pub enum CommonTo {
    /// All values of one trial.
    Trial,
    /// All values measured with one sensor.
    Sensor,
}

/// A cause of uncertainty.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Term {
    /// The cause.
    pub name: &'static str,
    /// How it was evaluated.
    #[serde(rename = "type")]
    pub evaluation: Evaluation,
    /// Its contribution to the standard uncertainty of the angle, degrees.
    pub u_deg: f64,
    /// Degrees of the angle per unit of the cause, if the cause is a measurable quantity.
    pub sensitivity: Option<f64>,
    /// Share of the variance of the angle.
    pub share: f64,
    /// The values that share this error.
    pub common_to: CommonTo,
    /// The independent errors that it consists of: the effect of one standard uncertainty of each on the angle, degrees,
    /// and its degrees of freedom, infinite for type B.
    #[serde(skip)]
    pub(crate) parts: Vec<(f64, f64)>,
}

/// A cause of uncertainty of one of several angles.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct AngleTerm {
    /// `yaw`, `pitch`, `roll` or `tilt`.
    pub angle: &'static str,
    /// The cause.
    #[serde(flatten)]
    pub term: Term,
}

/// The causes of the uncertainty of an angle, to first order in each error: errors that are common to two angles cancel in
/// their difference, instead of counting twice.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Budget {
    terms: Vec<Term>,
}

impl Budget {
    /// Creates a budget.
    pub fn new(terms: impl IntoIterator<Item = Term>) -> Self {
        let mut terms: Vec<Term> = terms.into_iter().collect();
        let variance: f64 = terms.iter().map(|term| powi(term.u_deg, 2)).sum();
        terms.iter_mut().for_each(|term| term.share = powi(term.u_deg, 2) / variance);
        Self { terms }
    }

    /// Returns the terms that are not zero.
    pub fn terms(&self) -> impl Iterator<Item = &Term> {
        self.terms.iter().filter(|term| term.u_deg != 0.0)
    }

    /// Returns the terms with the name of their angle.
    pub(crate) fn terms_of(&self, angle: &'static str) -> impl Iterator<Item = AngleTerm> {
        self.terms().map(move |term| AngleTerm { angle, term: term.clone() })
    }

    /// Returns the standard uncertainty of the angle, degrees.
    pub fn u_deg(&self) -> f64 {
        // The sum of nothing would be -0.
        self.terms.iter().map(|term| powi(term.u_deg, 2)).fold(0.0, |sum, square| sum + square).sqrt()
    }

    /// Returns the causes that are errors of this trial alone, or those shared by all trials of its sensor.
    #[must_use]
    pub fn common_to(&self, common_to: CommonTo) -> Self {
        Self::new(self.terms.iter().filter(|term| term.common_to == common_to).cloned())
    }

    /// Returns the budget with a further cause.
    #[must_use]
    pub(crate) fn with(self, term: Term) -> Self {
        Self::new(self.terms.into_iter().chain([term]))
    }

    /// Returns the budget without a cause.
    #[must_use]
    pub(crate) fn without(&self, name: &str) -> Self {
        Self::new(self.terms.iter().filter(|term| term.name != name).cloned())
    }

    /// Returns the effective degrees of freedom.
    pub fn degrees_of_freedom(&self) -> f64 {
        let parts = self.terms.iter().flat_map(|term| &term.parts);
        effective_freedom(powi(self.u_deg(), 2), parts.map(|(effect, freedom)| (powi(*effect, 2), *freedom)))
    }

    /// Returns the half width of the 95 % interval, degrees.
    pub fn uncertainty_deg(&self) -> f64 {
        student_95(self.degrees_of_freedom()) * self.u_deg()
    }

    /// Returns the budget of the difference from another angle. Readings of one sensor have the same errors.
    pub(crate) fn minus(&self, other: &Self, is_same_sensor: bool) -> Self {
        let negative = |term: &Term| Term {
            parts: term.parts.iter().map(|(effect, freedom)| (-effect, *freedom)).collect(),
            ..term.clone()
        };
        let mut terms: Vec<Term> = other.terms.iter().map(negative).collect();
        for term in &self.terms {
            match terms.iter_mut().find(|sum| (sum.name, sum.common_to) == (term.name, term.common_to)) {
                Some(sum) if is_same_sensor && term.common_to == CommonTo::Sensor => {
                    sum.parts.iter_mut().zip(&term.parts).for_each(|(sum, part)| sum.0 += part.0);
                }
                Some(sum) => {
                    sum.parts.extend(&term.parts);
                    sum.sensitivity = sum.sensitivity.zip(term.sensitivity).map(|(one, other)| hypot(one, other));
                }
                None => terms.push(term.clone()),
            }
        }
        terms.sort_by_key(|term| term.common_to == CommonTo::Sensor);
        Self::new(terms.into_iter().map(|term| Term {
            evaluation: term.evaluation,
            // The difference of a sensor's effects on two trials has no unit.
            sensitivity: term.sensitivity.filter(|_| term.common_to == CommonTo::Trial),
            ..Term::new(term.name, term.common_to, term.parts)
        }))
    }

    /// Returns the covariance with another angle, degrees², due to the errors that all trials of one sensor share.
    pub(crate) fn covariance_with(&self, other: &Self) -> f64 {
        let of_sensor = |term: &&Term| term.common_to == CommonTo::Sensor;
        let product = |term: &Term| -> Option<f64> {
            let same = other.terms.iter().filter(of_sensor).find(|same| same.name == term.name)?;
            Some(term.parts.iter().zip(&same.parts).map(|(one, other)| one.0 * other.0).sum())
        };
        self.terms.iter().filter(of_sensor).filter_map(product).sum()
    }
}

impl Term {
    /// Returns a cause that consists of independent errors: their effects on the angle, degrees, and degrees of freedom.
    pub(crate) fn new(name: &'static str, common_to: CommonTo, parts: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let parts: Vec<(f64, f64)> = parts.into_iter().collect();
        let evaluation = if common_to == CommonTo::Trial { Evaluation::A } else { Evaluation::B };
        let u_deg = parts.iter().map(|(effect, _)| powi(*effect, 2)).sum::<f64>().sqrt();
        Self { name, evaluation, u_deg, sensitivity: None, share: 0.0, common_to, parts }
    }

    /// Returns a cause estimated from the readings of the trial.
    pub fn of_trial(name: &'static str, u_deg: f64, degrees_of_freedom: f64) -> Self {
        Self::new(name, CommonTo::Trial, [(u_deg, degrees_of_freedom)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::SQRT_2;

    #[test]
    fn interval_has_the_effective_degrees_of_freedom() {
        // Two equal terms, one with 4 degrees of freedom: Welch and Satterthwaite give 16.
        let budget = Budget::new([
            Term::of_trial("noise", 0.3, 4.0),
            Term::new("scale", CommonTo::Sensor, [(0.3, f64::INFINITY), (0.0, f64::INFINITY)]),
            Term::of_trial("none", 0.0, 1.0),
        ]);
        let terms: Vec<_> = budget.terms().collect();
        assert_eq!(terms.len(), 2);
        assert!((budget.u_deg() - 0.3 * SQRT_2).abs() < 1e-12);
        assert!((budget.degrees_of_freedom() - 16.0).abs() < 1e-9);
        assert!((budget.uncertainty_deg() - 2.12 * 0.3 * SQRT_2).abs() < 1e-3);
        let of_sensor = budget.common_to(CommonTo::Sensor);
        assert!((terms[0].share - 0.5).abs() < 1e-12 && (of_sensor.u_deg() - 0.3).abs() < 1e-12);
        let json = serde_json::to_value(terms).unwrap();
        assert_eq!(
            (&json[0]["type"], &json[1]["type"], &json[1]["common_to"]),
            (&"A".into(), &"B".into(), &"sensor".into())
        );
        assert_eq!(Budget::default().uncertainty_deg(), 0.0);
    }

    fn budget(noise_deg: f64, scale_deg: f64) -> Budget {
        let of_sensor = |name, deg: f64| Term::new(name, CommonTo::Sensor, [(deg, f64::INFINITY)]);
        let noise = Term::of_trial("noise", noise_deg, 4.0);
        Budget::new([noise, of_sensor("gyroscope scale", scale_deg), of_sensor("clock", 0.5 * scale_deg)])
    }

    #[test]
    fn two_recordings_of_one_sensor_have_its_scale_error_once() {
        let (one, other) = (budget(0.3, 2.0), budget(0.3, 2.2));
        let same = other.minus(&one, true);
        assert!((same.common_to(CommonTo::Sensor).u_deg() - 0.2 * 1.25f64.sqrt()).abs() < 1e-12, "{same:?}");
        let own = same.common_to(CommonTo::Trial);
        assert!((own.u_deg() - 0.3 * SQRT_2).abs() < 1e-12 && (own.degrees_of_freedom() - 8.0).abs() < 1e-9);
        let others = other.minus(&one, false);
        let of_sensors = others.common_to(CommonTo::Sensor).u_deg();
        assert!((of_sensors - 2f64.hypot(2.2) * 1.25f64.sqrt()).abs() < 1e-12, "{others:?}");
        let names: Vec<_> = others.terms().map(|term| term.name).collect();
        assert_eq!(names, ["noise", "gyroscope scale", "clock"]);
        assert!((one.covariance_with(&other) - 2.0 * 2.2 * 1.25).abs() < 1e-12);
    }

    /// The unit of a clock is its relative error: the effect of one standard uncertainty is the product of both.
    #[test]
    fn a_clock_in_a_difference_has_its_degrees_per_unit() {
        let of_clock = |deg: f64, u: f64| {
            let term = Term::of_trial("clock", deg * u, f64::INFINITY);
            Budget::new([Term { sensitivity: Some(deg), ..term }])
        };
        let sensitivity = |budget: &Budget| budget.terms[0].sensitivity.unwrap();
        let (one, other) = (of_clock(30.0, 2e-6), of_clock(40.0, 2e-6));
        for difference in [one.minus(&Budget::default(), false), Budget::default().minus(&one, false)] {
            assert!((sensitivity(&difference) - 30.0).abs() < 1e-12, "{difference:?}");
        }
        let both = other.minus(&one, true);
        assert!((sensitivity(&both) - 50.0).abs() < 1e-12 && (both.u_deg() - 50.0 * 2e-6).abs() < 1e-15, "{both:?}");
    }

    #[test]
    fn difference_from_a_model_has_the_uncertainty_of_the_recording() {
        let difference = Budget::default().minus(&budget(0.3, -2.0), false);
        assert!((difference.u_deg() - 0.3f64.hypot(2.0 * 1.25f64.sqrt())).abs() < 1e-12);
        assert_eq!(Budget::default().minus(&Budget::default(), false).uncertainty_deg(), 0.0);
    }
}
