//! The motion that a modelled trial records: the whole trial, or with [`Method::Steady`] the last period or window of
//! its final motion.

use super::Model;
use biflag_log::{Method, SteadyMeta};
use sim::contact::history::BundlingChange;
use sim::steady::{self, Periodic, Problem, SolveError, Watch};
use sim::step::{Solver, StepError};
use sim::trial::Trial;
use sim::trial::profile::SpeedProfile;
use sim::trial::sample::Sample;
use std::vec;

/// A motion, as an iterator over its samples. Times are from the start of the record.
pub struct Motion(Source);

enum Source {
    /// A trial, computed while its samples are taken.
    Trial(Box<Trial>),
    /// A solved steady state.
    Steady { solved: Box<Periodic>, samples: vec::IntoIter<Sample> },
}

impl Motion {
    /// Returns the motion of a trial with this profile. With [`Method::Steady`] its motors turn at `rpm`, starting at
    /// the angles `start_rad`.
    ///
    /// # Errors
    /// The errors of [`steady::solve`], and [`SolveError::Parameter`] for an impossible rate.
    pub fn new(
        model: &Model,
        profile: &SpeedProfile,
        rpm: [f64; 2],
        start_rad: [f64; 2],
        watch: Watch,
    ) -> Result<Self, SolveError> {
        let &Model { ref robot, closure, options, ref at_rest, .. } = model;
        Ok(Self(match model.meta().method {
            Method::Trial => {
                let solver = Solver::sharing(robot, closure, at_rest)?;
                Source::Trial(Box::new(Trial::with_solver(solver, profile.clone(), options)?))
            }
            Method::Steady => {
                let [start_s, stop_s] = profile.run();
                let longest_s = stop_s - start_s;
                let output = Some(options);
                let at_rest = Some(at_rest);
                let problem = Problem { robot, closure, rpm, start_rad, longest_s, output, at_rest };
                let mut solved = steady::solve(&problem, watch)?;
                let samples = std::mem::take(&mut solved.samples).into_iter();
                Source::Steady { solved: Box::new(solved), samples }
            }
        }))
    }

    /// Returns the duration of the record if it replaces the whole trial, s.
    pub fn duration_s(&self) -> Option<f64> {
        if let Source::Steady { solved, .. } = &self.0 { Some(solved.duration_s) } else { None }
    }

    /// Returns the simulated time before the first sample, s.
    pub fn simulated_s(&self) -> f64 {
        if let Source::Steady { solved, .. } = &self.0 { solved.simulated_s } else { 0.0 }
    }

    /// Returns the steady state, once all samples have been taken.
    pub fn steady(&self, bundling_changes: Vec<BundlingChange>) -> SteadyMeta {
        match &self.0 {
            Source::Trial(trial) => SteadyMeta::new(&trial.summary(), bundling_changes),
            Source::Steady { solved, .. } => {
                SteadyMeta { kind: Some(solved.kind), ..SteadyMeta::new(&solved.summary, bundling_changes) }
            }
        }
    }
}

impl Iterator for Motion {
    type Item = Result<Sample, StepError>;

    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.0 {
            // Finish the run, so that the steady state covers all of it.
            Source::Trial(trial) => trial.next().or_else(|| trial.finish().err().map(Err)),
            Source::Steady { samples, .. } => samples.next().map(Ok),
        }
    }
}
