//! The result of a steered run: its late steps, and the attitude that it held.

use super::{HELD_S, Times};
use crate::trial::Judged;
use serde::Serialize;

/// Counts of the steps of a run.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Set-points.
    pub steps: u64,
    /// Steps without a set-point, or with one that was in force more than one period after it was due.
    pub late: u64,
    latencies_s: Vec<f64>,
}

impl Tally {
    /// Counts a set-point.
    pub fn add(&mut self, times: &Times) {
        self.steps += 1;
        self.late += u64::from(times.is_late());
        self.latencies_s.extend(times.latency_s());
    }

    /// Counts skipped steps, for which an earlier step was not over yet.
    pub fn skip(&mut self, steps: u64) {
        self.late += steps;
    }

    /// Returns the quantile of the latency from an observation until its set-point is in force, s, for this share of
    /// the steps.
    pub fn latency_s(&self, share: f64) -> Option<f64> {
        let mut sorted = self.latencies_s.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        sorted.get((share * last as f64).round() as usize).copied()
    }
}

/// The means at the end of a run.
#[derive(Serialize, Clone, Copy, PartialEq, Debug, Default)]
pub struct Held {
    /// Mean yaw.
    pub mean_yaw_deg: f64,
    /// Its 95 % uncertainty; `None` for a model, or if it is unknown.
    pub mean_yaw_uncertainty_deg: Option<f64>,
    /// Mean pitch.
    pub mean_pitch_deg: f64,
    /// Its 95 % uncertainty.
    pub mean_pitch_uncertainty_deg: Option<f64>,
    /// Averaging time of the means.
    pub mean_over_s: f64,
    /// Mean yaw of the simulated robot behind an emulated board, without the errors of its sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_mean_yaw_deg: Option<f64>,
    /// Its mean pitch.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_mean_pitch_deg: Option<f64>,
}

impl Held {
    /// Returns the means over the last part of a run, corrected like all angles of a trial; `None` without an attitude
    /// in it.
    pub fn of(trial: &Judged) -> Option<Self> {
        let Judged { data, angles: zeroed, .. } = trial;
        let run = zeroed.seen_run();
        // In a short run, the first half is the approach.
        let over = (run.end - HELD_S).max(0.5 * (run.start + run.end))..run.end;
        let [yaw, pitch, _] = zeroed.angles_deg.tracks();
        let middle_s = 0.5 * (over.start + over.end);
        let known = !data.is_model();
        let yaw_budget = zeroed.yaw_budget(middle_s).filter(|_| known);
        let tilt = zeroed.tilt_uncertainty(&over).filter(|_| known);
        let [true_yaw, true_pitch, ..] = data.truth.tracks();
        let true_zero_deg = true_yaw.at(zeroed.from_s).filter(|_| known);
        Some(Self {
            true_mean_yaw_deg: true_zero_deg.and_then(|zero_deg| Some(true_yaw.mean(over.clone())? - zero_deg)),
            true_mean_pitch_deg: true_pitch.mean(over.clone()).filter(|_| true_zero_deg.is_some()),
            mean_yaw_deg: yaw.mean(over.clone()).filter(|_| over.end > over.start)?,
            mean_yaw_uncertainty_deg: yaw_budget.map(|budget| budget.uncertainty_deg()),
            mean_pitch_deg: pitch.mean(over.clone())?,
            mean_pitch_uncertainty_deg: tilt.map(|[pitch, _]| pitch),
            mean_over_s: over.end - over.start,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_steps_are_those_after_a_period_and_those_left_out() {
        let mut tally = Tally::default();
        let times = |in_force_us: Option<u64>| Times { due_us: 100_000, observed_us: 105_000, in_force_us };
        tally.add(&times(Some(115_000)));
        tally.add(&times(Some(150_000)));
        tally.add(&times(Some(155_000)));
        tally.add(&times(None));
        tally.skip(2);
        assert_eq!((tally.steps, tally.late), (4, 4));
        let latency_us = |share: f64| tally.latency_s(share).map(|latency_s| (latency_s * 1e6).round());
        assert_eq!([0.0, 0.5, 1.0].map(latency_us), [Some(10_000.0), Some(45_000.0), Some(50_000.0)]);
        assert_eq!(Tally::default().latency_s(0.5), None);
    }
}
