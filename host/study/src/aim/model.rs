//! The model of a robot, evaluated for its steady states at pairs of speeds.

use super::error::AimError;
use super::quantity::Attitude;
use serde::Serialize;
use sim::body::closure::Closure;
use sim::contact::bundling::Bundling;
use sim::params::Robot;
use sim::steady::phase::{self, Ratio};
use sim::steady::{Kind, Method, Problem, SolveError, SteadyState};
use sim::step::{InversesAtRest, Solver};
use sim::trial::means::WINDOW;
use sim::trial::profile::SpeedProfile;
use sim::trial::{Options, Summary, Trial};
use std::time::Instant;

/// Duration of the trial if no repeating motion is found, s: the default run of a plan.
pub const TRIAL_S: f64 = 120.0;

/// Number of starting phases to evaluate at speeds where the phase matters.
const PHASES: usize = 4;

/// Rate at which a trial is checked, 1/s of simulated time.
const CHECK_HZ: f64 = 0.5;

/// A robot with the caller's callbacks.
#[derive(Clone, Copy)]
pub struct Model<'a> {
    /// The robot, checked.
    pub robot: &'a Robot,
    /// Inverses shared by its trials.
    pub at_rest: &'a InversesAtRest,
    /// Returns whether to go on, or `false` after an interruption by the user.
    pub goes_on: &'a (dyn Fn() -> bool + Sync),
    /// Deadline for the model's answers, if there is one.
    pub until: Option<Instant>,
    /// Is called after each steady state.
    pub solved: &'a (dyn Fn() + Sync),
}

/// A steady state of the model.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct State {
    /// Speed of flagellum 1.
    pub w1_rpm: f64,
    /// Speed of flagellum 2.
    pub w2_rpm: f64,
    /// Its attitude and thrust.
    #[serde(flatten)]
    pub attitude: Attitude,
    /// Whether the motion repeats.
    pub kind: Kind,
    /// Whether the flagella stay apart, touch, or wind round each other at some time.
    pub contact: Bundling,
    /// Share of the time in which the flagella touch.
    pub contact_share: f64,
    /// Smallest gap between their surfaces.
    pub min_gap_m: f64,
}

impl State {
    fn of(rpm: [f64; 2], kind: Kind, summary: &Summary) -> Result<Self, AimError> {
        if kind == Kind::Overturned {
            return Err(AimError::Overturned(rpm));
        }
        let [w1_rpm, w2_rpm] = rpm;
        Ok(Self {
            w1_rpm,
            w2_rpm,
            attitude: Attitude::of(summary),
            kind,
            contact: summary.bundling,
            contact_share: summary.contact_share,
            min_gap_m: summary.min_gap_m,
        })
    }

    /// Returns the speeds, rpm.
    pub fn rpm(&self) -> [f64; 2] {
        [self.w1_rpm, self.w2_rpm]
    }

    /// Returns whether the flagella touch.
    pub fn touches(&self) -> bool {
        self.contact != Bundling::Apart
    }
}

impl Model<'_> {
    fn goes_on(&self) -> bool {
        (self.goes_on)() && self.until.is_none_or(|until| Instant::now() < until)
    }

    /// Converts an error of the solver at these speeds (rpm).
    fn error(&self, rpm: [f64; 2], source: SolveError) -> AimError {
        match source {
            SolveError::Interrupted if (self.goes_on)() => AimError::TimeOver,
            SolveError::Interrupted => AimError::Interrupted,
            source => AimError::Model { rpm, source },
        }
    }

    /// Returns the steady state at these speeds, with motors that start at these angles (deg).
    ///
    /// # Errors
    /// [`AimError::Model`], [`AimError::Overturned`], [`AimError::Interrupted`] and [`AimError::TimeOver`].
    pub fn at(&self, rpm: [f64; 2], start_deg: [f64; 2]) -> Result<State, AimError> {
        self.of(self.robot, rpm, start_deg)
    }

    /// Like [`at`](Self::at), for another robot.
    pub fn of(&self, robot: &Robot, rpm: [f64; 2], start_deg: [f64; 2]) -> Result<State, AimError> {
        self.by(Method::Steady, robot, rpm, start_deg)
    }

    /// Returns the state at the end of a whole trial at these speeds, with motors that start at angles of zero. The
    /// contact refers to the whole trial.
    ///
    /// # Errors
    /// Those of [`at`](Self::at).
    pub fn trial(&self, rpm: [f64; 2]) -> Result<State, AimError> {
        self.by(Method::Trial, self.robot, rpm, [0.0; 2])
    }

    fn by(&self, method: Method, robot: &Robot, rpm: [f64; 2], start_deg: [f64; 2]) -> Result<State, AimError> {
        let start_rad = start_deg.map(f64::to_radians);
        let (closure, at_rest) = (Closure::Full, Some(self.at_rest));
        let problem = Problem { robot, closure, rpm, start_rad, longest_s: TRIAL_S, output: None, at_rest };
        let found = SteadyState::by(method, &problem, &|_| self.goes_on());
        (self.solved)();
        let SteadyState { kind, summary } = found.map_err(|error| self.error(rpm, error))?;
        State::of(rpm, kind, &summary)
    }

    /// Returns whether the flagella touch at some time of a trial at these speeds. The trial ends at the first contact,
    /// because steps in contact take most of the time, or when its means are known.
    ///
    /// # Errors
    /// [`AimError::Model`], [`AimError::Interrupted`] and [`AimError::TimeOver`].
    pub fn touches(&self, rpm: [f64; 2], start_deg: [f64; 2]) -> Result<bool, AimError> {
        let touches = || -> Result<bool, SolveError> {
            let profile = SpeedProfile::constant(rpm, TRIAL_S)?.from_angles(start_deg.map(f64::to_radians));
            let options = Options { rate_hz: CHECK_HZ, shapes: false };
            let solver = Solver::sharing(self.robot, Closure::Full, self.at_rest)?;
            let mut trial = Trial::with_solver(solver, profile, options)?;
            let mut next_s = WINDOW;
            while let Some(sample) = trial.next() {
                sample?;
                if !self.goes_on() {
                    return Err(SolveError::Interrupted);
                }
                if trial.first_contact_s().is_some() {
                    return Ok(true);
                }
                if trial.state().time >= next_s {
                    next_s += WINDOW;
                    if trial.summary().steady.settled {
                        break;
                    }
                }
            }
            Ok(trial.first_contact_s().is_some())
        };
        let touches = touches();
        (self.solved)();
        touches.map_err(|error| self.error(rpm, error))
    }
}

/// Returns the starting angles (deg) at which to evaluate these speeds: zero first, and only zero if the phase does not
/// matter.
pub fn starts(rpm: [f64; 2]) -> Vec<[f64; 2]> {
    phase::starts(rpm, if Ratio::of(rpm).is_some() { PHASES } else { 1 })
}
