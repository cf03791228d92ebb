//! The steady state at a pair of speeds, and its combination over several starting phases.

use super::{Kind, Problem, SolveError, Watch, solve};
use crate::trial::profile::{Phases as Run, SpeedProfile};
use crate::trial::quantity::Values;
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
    /// The errors of [`solve`].
    pub fn by(method: Method, problem: &Problem, watch: Watch) -> Result<Self, SolveError> {
        match method {
            Method::Steady => {
                let found = solve(problem, watch)?;
                Ok(Self { kind: found.kind, summary: found.summary })
            }
            Method::Trial => Self::of_trial(problem, watch),
        }
    }

    /// Runs a trial from rest, with a run phase of `longest_s`.
    fn of_trial(problem: &Problem, watch: Watch) -> Result<Self, SolveError> {
        let run = Run { run: problem.longest_s, ..Run::default() };
        let profile = SpeedProfile::phases(&run, problem.rpm)?.from_angles(problem.start_rad);
        // The samples serve only to call `watch`: a few a second are enough.
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
    /// Returns `None` if there is no state.
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

    /// Returns the values of each phase.
    pub fn values(&self) -> Vec<Values> {
        self.0.iter().map(|state| Values::of(&state.summary)).collect()
    }

    /// Returns the sweeps of the solver for all phases.
    pub fn sweeps(&self) -> u64 {
        self.0.iter().map(|state| state.summary.sweeps).sum()
    }
}
