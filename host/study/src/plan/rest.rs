//! Checks whether a plan gives its robot enough time to reach a steady attitude, and to come to rest between two runs.

use super::{Phases, Plan};
use crate::text::decimal;
use protocol::units::CentiRpm;
use sim::return_to_rest::TimeConstants;

/// Number of time constants in which a motion decays to less than a hundredth.
const ENOUGH: f64 = 5.0;

impl Plan {
    /// Returns the largest time constant of the robot, s, if it has any.
    fn slowest_s(&self) -> Option<f64> {
        Some(TimeConstants::of(&self.robot.parse().ok()?).ok()?.slowest_s())
    }

    /// Returns a note for the user if the rest between two runs is shorter than five time constants of the robot.
    pub fn note_on_rest(&self) -> Option<String> {
        let runs = self.trials.iter().filter(|trial| trial.speeds != [CentiRpm(0); 2]);
        let Phases { rest_at_most_s, calibrate_s, preroll_s, decay_s, .. } = runs.clone().next()?.phases;
        // A plan without a calibration and a pre-roll asks for no rest.
        if runs.count() < 2 || calibrate_s + preroll_s == 0.0 {
            return None;
        }
        let slowest_s = self.slowest_s()?;
        let (planned_s, needed_s) = (calibrate_s + preroll_s + decay_s, ENOUGH * slowest_s);
        if planned_s >= needed_s {
            return None;
        }
        let then = match rest_at_most_s {
            0.0 => "with rest_at_most = 0 no trial waits for it",
            _ => "each trial waits until it is still, so the session takes longer than planned",
        };
        Some(format!(
            "the plan has {} s of rest between two runs, and the robot takes {} s to come to rest (five time constants of {} \
             s): {then}",
            decimal(planned_s, 0),
            decimal(needed_s, 0),
            decimal(slowest_s, 1)
        ))
    }

    /// Returns a note for the user if a run ends before the robot has reached a steady attitude: within five time
    /// constants.
    pub fn note_on_run(&self) -> Option<String> {
        let turning = self.trials.iter().filter(|trial| trial.speeds != [CentiRpm(0); 2]);
        let run_s = turning.map(|trial| trial.phases.run_s).reduce(f64::min)?;
        let needed_s = ENOUGH * self.slowest_s()?;
        (run_s < needed_s).then(|| {
            let [run_s, needed_s] = [run_s, needed_s].map(|seconds| decimal(seconds, 0));
            format!(
                "a run has {run_s} s, and the robot takes {needed_s} s to reach a steady attitude (five time constants)"
            )
        })
    }
}
