//! The steady state of a pair of speeds, and the steady states of its starting phases together.

use super::quantities::{OverPhases, Quantity, STANDARD_ERRORS, StandardError};
use super::{Kind, Problem, SolveError, Watch, solve};
use crate::trial::profile::{Phases as Run, SpeedProfile};
use crate::trial::{Options, Summary, Trial};
use serde::{Deserialize, Serialize};

/// How a steady state is computed.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// By a trial from rest.
    #[default]
    Trial,
    /// By [`solve`].
    Steady,
}

/// A steady state.
#[derive(Clone, Debug)]
pub struct SteadyState {
    /// Kind of the motion.
    pub kind: Kind,
    /// Its results.
    pub summary: Summary,
}

/// The steady states of all starting phases at a pair of speeds.
#[derive(Clone, Debug)]
pub struct Phases(Vec<SteadyState>);

impl SteadyState {
    /// Computes the steady state by this method.
    ///
    /// # Errors
    /// Those of [`solve`].
    pub fn by(method: Method, problem: &Problem, watch: Watch) -> Result<Self, SolveError> {
        match method {
            Method::Steady => {
                let found = solve(problem, watch)?;
                Ok(Self { kind: found.kind, summary: found.summary })
            }
            Method::Trial => Self::of_trial(problem, watch),
        }
    }

    /// Runs a trial from rest to its end, as long as a solution would take at most.
    fn of_trial(problem: &Problem, watch: Watch) -> Result<Self, SolveError> {
        let run = Run { run: problem.longest_s, ..Run::default() };
        let profile = SpeedProfile::phases(&run, problem.rpm)?.from_angles(problem.start_rad);
        // No samples are needed; a few a second are enough to ask whether to go on.
        let options = Options { rate_hz: 2.0, shapes: false };
        let mut trial = Trial::with_solver(problem.solver()?, profile, options)?;
        for sample in trial.by_ref() {
            if !watch(sample?.time_s) {
                return Err(SolveError::Interrupted);
            }
        }
        // The last sample may be before the end.
        let summary = trial.finish()?;
        Ok(Self { kind: Kind::of_trial(&summary.steady), summary })
    }
}

impl Phases {
    /// `None` without a state.
    pub fn new(states: Vec<SteadyState>) -> Option<Self> {
        (!states.is_empty()).then_some(Self(states))
    }

    /// Returns the number of starting phases.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Returns the least steady kind of all phases.
    pub fn kind(&self) -> Kind {
        self.0.iter().map(|state| state.kind).max().unwrap_or(Kind::NotFound)
    }

    /// Returns a quantity as it is stated for all phases.
    pub fn value(&self, quantity: &Quantity) -> f64 {
        match quantity.over_phases {
            OverPhases::Mean => self.values(quantity).sum::<f64>() / self.0.len() as f64,
            OverPhases::Least => self.range(quantity)[0],
        }
    }

    /// Returns the least and the largest value of a quantity.
    pub fn range(&self, quantity: &Quantity) -> [f64; 2] {
        self.values(quantity).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
    }

    /// Returns the standard errors of the means over the phases; `None` where one is unknown.
    pub fn standard_errors(&self) -> [Option<f64>; STANDARD_ERRORS.len()] {
        let of = |(.., error): StandardError| error_of_mean(self.0.iter().map(|state| error(&state.summary)));
        STANDARD_ERRORS.map(of)
    }

    /// Returns the sweeps of the solver for all phases.
    pub fn sweeps(&self) -> u64 {
        self.0.iter().map(|state| state.summary.sweeps).sum()
    }

    fn values<'a>(&'a self, quantity: &'a Quantity) -> impl Iterator<Item = f64> + 'a {
        self.0.iter().map(|state| (quantity.value)(&state.summary))
    }
}

/// Returns the standard error of the mean over starting phases from those of the phases; `None` where one is unknown.
///
/// It is their mean, as for values whose errors are the same. What the solver misses has mostly one sign in all phases, and most
/// standard errors are those of the solver ([`crate::trial::means`]): more phases do not average it away.
pub fn error_of_mean(errors: impl ExactSizeIterator<Item = Option<f64>>) -> Option<f64> {
    let count = errors.len() as f64;
    let sum: Option<f64> = errors.sum();
    sum.map(|sum| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_solver_misses_stays_in_a_mean_over_phases() {
        let least = 0.075;
        let of = |errors: &[Option<f64>]| error_of_mean(errors.iter().copied());
        assert_eq!(of(&[Some(least); 4]), Some(least));
        assert_eq!(of(&[Some(1.0), Some(3.0)]), Some(2.0));
        assert_eq!(of(&[Some(least), None]), None);
    }
}
