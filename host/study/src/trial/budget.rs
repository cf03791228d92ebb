//! The uncertainty of an angle as the sum of its causes (JCGM 100:2008, the GUM). Every stated ± comes from here.

use crate::attitude::student_95;
use serde::Serialize;
use sim::functions::powi;

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
    /// Degrees of freedom; infinite for type B.
    #[serde(skip)]
    pub degrees_of_freedom: f64,
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

impl AngleTerm {
    /// Returns a cause of an angle's uncertainty.
    pub(crate) fn new(angle: &'static str, term: &Term) -> Self {
        Self { angle, term: term.clone() }
    }
}

/// The causes of the uncertainty of an angle.
#[derive(Serialize, Clone, PartialEq, Debug, Default)]
#[serde(transparent)]
pub struct Budget {
    terms: Vec<Term>,
}

impl Budget {
    /// Creates a budget. Terms of zero are left out.
    pub fn new(terms: impl IntoIterator<Item = Term>) -> Self {
        let mut terms: Vec<Term> = terms.into_iter().filter(|term| term.u_deg != 0.0).collect();
        let variance: f64 = terms.iter().map(|term| powi(term.u_deg, 2)).sum();
        terms.iter_mut().for_each(|term| term.share = powi(term.u_deg, 2) / variance);
        Self { terms }
    }

    /// Returns the terms.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Returns the standard uncertainty of the angle, degrees.
    pub fn u_deg(&self) -> f64 {
        self.terms.iter().map(|term| powi(term.u_deg, 2)).fold(0.0, |sum, square| sum + square).sqrt()
    }

    /// Returns the part of the standard uncertainty that is common to all trials of a sensor, degrees.
    pub fn sensor_u_deg(&self) -> f64 {
        let common = self.terms.iter().filter(|term| term.common_to == CommonTo::Sensor);
        // The sum of nothing would be -0.
        common.map(|term| powi(term.u_deg, 2)).fold(0.0, |sum, square| sum + square).sqrt()
    }

    /// Returns the causes that belong to this trial alone.
    #[must_use]
    pub fn of_trial(&self) -> Self {
        Self::new(self.terms.iter().filter(|term| term.common_to == CommonTo::Trial).cloned())
    }

    /// Returns the effective degrees of freedom by the formula of Welch and Satterthwaite (GUM, G.2b).
    pub fn degrees_of_freedom(&self) -> f64 {
        let sum: f64 = self.terms.iter().map(|term| powi(term.u_deg, 4) / term.degrees_of_freedom).sum();
        if sum > 0.0 { powi(self.u_deg(), 4) / sum } else { f64::INFINITY }
    }

    /// Returns the half width of the 95 % interval, degrees.
    pub fn uncertainty_deg(&self) -> f64 {
        if self.terms.is_empty() { 0.0 } else { student_95(self.degrees_of_freedom()) * self.u_deg() }
    }
}

impl Term {
    /// Returns a cause estimated from the readings of the trial.
    pub fn of_trial(name: &'static str, u_deg: f64, degrees_of_freedom: f64) -> Self {
        Self {
            name,
            evaluation: Evaluation::A,
            u_deg,
            sensitivity: None,
            share: 0.0,
            common_to: CommonTo::Trial,
            degrees_of_freedom,
        }
    }

    /// Returns a cause in the sensor: `of` yields the sensitivity to each error and the error's standard uncertainty.
    pub fn of_sensor(name: &'static str, of: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        Self {
            name,
            evaluation: Evaluation::B,
            u_deg: of.clone().map(|(sensitivity, u)| powi(sensitivity * u, 2)).sum::<f64>().sqrt(),
            sensitivity: Some(of.map(|(sensitivity, _)| powi(sensitivity, 2)).sum::<f64>().sqrt()),
            share: 0.0,
            common_to: CommonTo::Sensor,
            degrees_of_freedom: f64::INFINITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interval_has_the_effective_degrees_of_freedom() {
        // Two equal terms, one with 4 degrees of freedom: Welch and Satterthwaite give 16.
        let budget = Budget::new([
            Term::of_trial("noise", 0.3, 4.0),
            Term::of_sensor("scale", [(10.0, 0.03), (5.0, 0.0)].into_iter()),
            Term::of_trial("none", 0.0, 1.0),
        ]);
        assert_eq!(budget.terms().len(), 2);
        assert!((budget.u_deg() - 0.3 * 2f64.sqrt()).abs() < 1e-12);
        assert!((budget.degrees_of_freedom() - 16.0).abs() < 1e-9);
        assert!((budget.uncertainty_deg() - 2.12 * 0.3 * 2f64.sqrt()).abs() < 1e-3);
        assert!((budget.terms()[0].share - 0.5).abs() < 1e-12 && (budget.sensor_u_deg() - 0.3).abs() < 1e-12);
        let json = serde_json::to_value(&budget).unwrap();
        assert_eq!(
            (&json[0]["type"], &json[1]["type"], &json[1]["common_to"]),
            (&"A".into(), &"B".into(), &"sensor".into())
        );
        assert_eq!(Budget::default().uncertainty_deg(), 0.0);
    }
}
