//! The motion that a modelled trial records: the trial from its start, or with [`Method::Steady`] one period of the motion
//! that it ends in.

use super::{Model, Watch};
use biflag_log::{Method, SteadyMeta};
use sim::contact::history::BundlingChange;
use sim::periodic::{self, Kind, SolveError};
use sim::profile::SpeedProfile;
use sim::sample::Sample;
use sim::step::StepError;
use sim::trial::Trial;

/// A motion, as an iterator over its samples. Their times are those of the record: of a period from its start.
pub struct Motion {
    trial: Trial,
    method: Method,
    /// The period, s, if it is one of a motion that repeats.
    pub period_s: Option<f64>,
    /// Time that was simulated before, s.
    pub searched_s: f64,
    /// Time of the solver at time 0 of the record, s.
    start_s: f64,
}

impl Motion {
    /// Returns the motion of a trial with this profile. With [`Method::Steady`] its motors turn at `rpm` from the angles
    /// `start_rad` on, and where no motion that repeats is found it is the trial.
    ///
    /// # Errors
    /// Those of [`periodic::search`], and [`SolveError::Parameter`] for an impossible rate.
    pub fn new(
        model: &Model,
        profile: &SpeedProfile,
        rpm: [f64; 2],
        start_rad: [f64; 2],
        watch: Watch,
    ) -> Result<Self, SolveError> {
        let Model { robot, closure, options, .. } = model;
        let method = model.meta().method;
        let trial = Trial::new(robot, *closure, profile.clone(), *options)?;
        let mut motion = Self { trial, method, period_s: None, searched_s: 0.0, start_s: 0.0 };
        if method == Method::Steady {
            let [start_s, stop_s] = profile.run();
            let search = periodic::search(robot, *closure, rpm, start_rad, stop_s - start_s, watch)?;
            motion.searched_s = search.simulated_s;
            if let Some(orbit) = search.orbit {
                motion.period_s = Some(orbit.period_s);
                motion.trial = orbit.into_trial(*options);
                motion.start_s = motion.trial.state().time;
            }
        }
        Ok(motion)
    }

    /// Returns the steady state, once all samples have been taken.
    pub fn steady(&self, bundling_changes: Vec<BundlingChange>) -> SteadyMeta {
        let mut steady = SteadyMeta::new(&self.trial.summary(), bundling_changes);
        if self.method == Method::Steady {
            let found = self.period_s.is_some();
            steady.kind = Some(if found { Kind::Steady } else { Kind::of_trial(steady.settled) });
            steady.settled |= found;
            steady.simulated_s += self.searched_s;
            if found {
                steady.settle_s = 0.0;
            }
        }
        steady
    }
}

impl Iterator for Motion {
    type Item = Result<Sample, StepError>;

    fn next(&mut self) -> Option<Self::Item> {
        let sample = self.trial.next()?;
        Some(sample.map(|sample| Sample { time_s: sample.time_s - self.start_s, ..sample }))
    }
}
