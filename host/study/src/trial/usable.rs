//! Checks whether a trial can be compared with a model.

use super::data::Data;
use biflag_log::{Origin, SteadyMeta};

/// Shortest interval between frames that counts as a gap, s: twenty frames of a board, or four of a model.
const GAP_S: f64 = 0.21;

/// Time in which a motor reaches its speed, or stops, s.
const STARTING_S: f64 = 1.0;

/// Shortest run that can be compared with a model, s.
const SHORTEST_RUN_S: f64 = 1.0;

/// Why a trial cannot be used.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Unusable {
    /// The reason.
    pub reason: String,
    /// How to fix it.
    pub help: &'static str,
}

const NO_TRIAL: &str = "name the log of a trial run by `biflag record` or `biflag simulate`";
/// Remedy for a robot that overturned.
pub(super) const OVERTURNED: &str = "give it the mass that hangs upright";

const REPEAT: &str = "repeat the trial with `biflag record PLAN --resume`";

fn unusable<T>(reason: impl Into<String>, help: &'static str) -> Result<T, Unusable> {
    Err(Unusable { reason: reason.into(), help })
}

impl Data {
    /// Checks that the trial has a run with encoders, so that a model can follow it.
    ///
    /// # Errors
    /// [`Unusable`].
    pub fn check(&self) -> Result<(), Unusable> {
        if self.records.trial.is_none() {
            return unusable("the record of its trial cannot be read", NO_TRIAL);
        }
        if self.motors.is_empty() {
            let reason = if self.link.samples == 0 { "contains no telemetry" } else { "contains no motor speeds" };
            return unusable(reason, NO_TRIAL);
        }
        let run = &self.times.run;
        if self.times.run == (0.0..0.0) {
            return unusable("its motors never ran", REPEAT);
        }
        if run.end - run.start < SHORTEST_RUN_S {
            let ran_s = (run.end - run.start).max(0.0);
            return unusable(format!("its motors ran for only {ran_s:.1} s"), REPEAT);
        }
        self.upright()?;
        self.encoders().map(drop)
    }

    /// Checks that a modelled robot did not turn over.
    pub(super) fn upright(&self) -> Result<(), Unusable> {
        match self.records.steady.as_ref().is_some_and(SteadyMeta::is_overturned) {
            true => unusable("the robot overturned, so it has no steady attitude", OVERTURNED),
            false => Ok(()),
        }
    }

    /// Describes the gaps in the telemetry.
    pub(super) fn gaps(&self) -> Option<String> {
        let times = &self.motors.time_s;
        let gaps: Vec<_> =
            times.windows(2).map(|pair| (pair[0], pair[1])).filter(|(from, to)| to - from > GAP_S).collect();
        let (from, to) = gaps.iter().copied().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))?;
        // The step of a model with a low sampling rate is not a gap.
        let usual = self.duration_s / times.len().max(2) as f64;
        (to - from > 3.0 * usual).then(|| {
            let [from, to] = [from, to].map(|time_s| self.by_table_s(time_s));
            let total = gaps.iter().map(|(from, to)| to - from).sum::<f64>();
            let places = if gaps.len() == 1 { "1 place".to_owned() } else { format!("{} places", gaps.len()) };
            let [what, verb] = self.lacking();
            let bridged = match self.origin() {
                Origin::Imported => "the angles are interpolated over the gaps",
                _ if self.is_blind() => "the speeds from the swing bridge the gaps",
                _ => "the encoders' angles bridge the gaps",
            };
            format!(
                "{what} {verb} missing in {places}, {total:.1} s in total, the longest from {from:.1} s to {to:.1} s; {bridged}"
            )
        })
    }

    /// Checks the encoders, whose angles drive the model. Returns the differences from the plan.
    pub(super) fn encoders(&self) -> Result<Vec<String>, Unusable> {
        if self.is_blind() {
            return Ok(Vec::new());
        }
        let run = &self.times.run;
        let row = |time: f64| self.motors.time_s.partition_point(|t| *t < time).min(self.motors.len() - 1);
        let (first, last) = (row(run.start), row(run.end));
        let mut warnings = Vec::new();
        let speeds = self.steered_speeds(run.clone()).unwrap_or_else(|| self.planned_speeds());
        for (k, speed) in speeds.into_iter().enumerate() {
            let backwards_s = match self.reverse() {
                Some((motor, after_s)) if usize::from(motor) == k + 1 => (run.end - run.start - after_s).max(0.0),
                _ => 0.0,
            };
            let target = speed.rpm() / 60.0 * (run.end - run.start - 2.0 * backwards_s);
            let turns = self.motor_turns(k).value;
            let turned = turns[last] - turns[first];
            if target.abs() > 0.5 && turns.iter().all(|value| *value == turns[first]) {
                let reason = format!("the encoder of motor {} did not move at a target of {} rpm", k + 1, speed.rpm());
                return unusable(reason, "check the motor and its encoder, then repeat the trial");
            }
            if (turned - target).abs() > 0.1 * target.abs().max(1.0) + STARTING_S * speed.rpm().abs() / 60.0 {
                warnings.push(format!(
                    "flagellum {} made {turned:.1} turns in the run, but the plan gives {target:.1}; the measured turns are used",
                    k + 1
                ));
            }
        }
        Ok(warnings)
    }
}
