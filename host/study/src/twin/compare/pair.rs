//! The two trials of a comparison.

use crate::trial::{Data, Judged, LogFinding, Steady, Unusable, Zeroed};
use crate::twin::TwinError;
use crate::twin::sensor_key::SensorKey;
use std::ops::Range;

/// One of two compared trials.
pub(super) struct Side<'a> {
    pub data: &'a Data,
    pub zeroed: &'a Zeroed,
    pub steady: Steady,
    pub findings: Vec<LogFinding>,
}

/// The two trials of a comparison: the measured one, then the modelled one.
pub(super) struct Pair<'a> {
    pub measured: Side<'a>,
    pub modelled: Side<'a>,
}

impl<'a> Side<'a> {
    fn new(trial: &'a Judged) -> Result<Self, TwinError> {
        let Judged { data, angles: zeroed, .. } = trial;
        data.check().map_err(|error| TwinError::unusable(data, error))?;
        let no_attitude = || Unusable {
            reason: "contains no attitude in its run".to_owned(),
            help: "check the IMU with `biflag doctor`, and repeat the trial",
        };
        let steady = zeroed.steady.clone().ok_or_else(|| TwinError::unusable(data, no_attitude()))?;
        Ok(Self { data, zeroed, steady, findings: trial.log_findings() })
    }

    /// Returns the time range with angles, relative to the start of the run.
    pub fn span(&self) -> Range<f64> {
        let span = self.zeroed.span();
        span.start - self.zeroed.run.start..span.end - self.zeroed.run.start
    }

    /// Returns the time from the start of the run to its last angle, s.
    pub fn run_s(&self) -> f64 {
        self.zeroed.seen_run().end - self.zeroed.run.start
    }

    /// Converts a time from the run's start to the log's clock.
    pub fn on_clock(&self, from_start: &Range<f64>) -> Range<f64> {
        self.zeroed.run.start + from_start.start..self.zeroed.run.start + from_start.end
    }
}

impl<'a> Pair<'a> {
    pub fn new(measured: &'a Judged, modelled: &'a Judged) -> Result<Self, TwinError> {
        Ok(Self { measured: Side::new(measured)?, modelled: Side::new(modelled)? })
    }

    /// Returns the sensors of both.
    pub fn sensors(&self) -> [Option<SensorKey>; 2] {
        [&self.measured, &self.modelled].map(|side| SensorKey::of(side.data))
    }

    /// Returns whether both were measured with one sensor.
    pub fn is_of_one_sensor(&self) -> bool {
        match self.sensors() {
            [Some(one), Some(other)] => one.is_certainly(&other),
            _ => false,
        }
    }

    /// Returns whether the model is a replay of the measurement.
    pub fn is_replay(&self) -> bool {
        is_replay_of(self.modelled.data, self.measured.data)
    }
}

/// Returns whether a log is the replay of a recording read with its hash.
pub fn is_replay_of(replay: &Data, recording: &Data) -> bool {
    match (&replay.records.replay, &recording.sha256) {
        (Some(replay), Some(sha256)) => replay.source_sha256 == *sha256,
        _ => false,
    }
}
