//! Who gives the speeds.

use super::{Controller, Observation, Policy, SteerError};
use std::time::Duration;

/// Who gives the speeds.
#[derive(Debug)]
#[expect(missing_docs, reason = "the variants say what their fields are")]
pub enum Pilot {
    /// The built-in controller, which answers at once.
    Controller { controller: Box<Controller>, answer: Option<[f64; 2]> },
    /// An external program.
    Policy(Policy),
}

impl Pilot {
    /// Returns the built-in controller as a pilot.
    pub fn of(controller: Controller) -> Self {
        Self::Controller { controller: Box::new(controller), answer: None }
    }

    /// Passes an observation on. `period_s`: time since the previous one.
    ///
    /// # Errors
    /// Those of a policy.
    pub(super) fn ask(&mut self, observation: &Observation, period_s: f64) -> Result<(), SteerError> {
        match self {
            Self::Controller { controller, answer } => {
                *answer = Some(controller.speeds(observation, period_s));
                Ok(())
            }
            Self::Policy(policy) => policy.ask(observation),
        }
    }

    /// Returns the speeds (rpm) for the last observation; `None` if they do not arrive within this time.
    ///
    /// # Errors
    /// Those of a policy.
    pub(super) fn answer(&mut self, within: Duration) -> Result<Option<[f64; 2]>, SteerError> {
        match self {
            Self::Controller { answer, .. } => Ok(answer.take()),
            Self::Policy(policy) => policy.answer(within),
        }
    }
}
