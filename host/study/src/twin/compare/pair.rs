//! The two trials of a comparison.

use crate::trial::{Data, FindingKind, Judged, LogFinding, Steady, Unusable, Zeroed};
use crate::twin::TwinError;
use crate::twin::sensor_key::SensorKey;
use std::ops::Range;

/// One of two compared trials.
pub(super) struct Side<'a> {
    pub data: &'a Data,
    pub zeroed: &'a Zeroed,
    /// Start of the run on the clock of the log, s. The run of a steady state starts before its log, and ends with the log.
    pub start_s: f64,
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
        Ok(Self { data, zeroed, start_s: zeroed.run.start, steady, findings: trial.log_findings() })
    }

    /// Returns the time range with angles, relative to the start of the run.
    pub fn span(&self) -> Range<f64> {
        let span = self.zeroed.span();
        span.start - self.start_s..span.end - self.start_s
    }

    /// Returns the time from the start of the run to its last angle, s.
    pub fn run_s(&self) -> f64 {
        self.zeroed.seen_run().end - self.start_s
    }

    /// Converts a time from the run's start to the log's clock.
    pub fn on_clock(&self, from_start: &Range<f64>) -> Range<f64> {
        self.start_s + from_start.start..self.start_s + from_start.end
    }
}

impl<'a> Pair<'a> {
    pub fn new(measured: &'a Judged, modelled: &'a Judged) -> Result<Self, TwinError> {
        let [mut measured, mut modelled] = [Side::new(measured)?, Side::new(modelled)?];
        let run_s = measured.run_s().max(modelled.run_s());
        for side in [&mut measured, &mut modelled] {
            if side.data.is_steady_state() {
                side.start_s -= run_s - side.run_s();
            }
        }
        // The ± holds what speeds that wander would still change.
        if measured.data.is_blind() && is_replay_of(modelled.data, measured.data) {
            modelled.findings.retain(|LogFinding { finding, .. }| {
                finding.kind != FindingKind::Window || finding.empties_uncertainty()
            });
        }
        Ok(Self { measured, modelled })
    }

    /// Returns whether the motors of one of them have no encoders.
    pub fn is_blind(&self) -> bool {
        self.measured.data.is_blind() || self.modelled.data.is_blind()
    }

    /// Returns whether one of them is a steady state, without a transient.
    pub fn has_steady_state(&self) -> bool {
        self.measured.data.is_steady_state() || self.modelled.data.is_steady_state()
    }

    /// Returns the sensors of both.
    pub fn sensors(&self) -> [Option<SensorKey>; 2] {
        [&self.measured, &self.modelled].map(|side| SensorKey::of(side.data))
    }

    /// Returns whether both were measured with one sensor.
    pub fn is_of_one_sensor(&self) -> bool {
        if let [Some(one), Some(other)] = self.sensors() { one.is_certainly(&other) } else { false }
    }

    /// Returns whether the model is a replay of the measurement.
    pub fn is_replay(&self) -> bool {
        is_replay_of(self.modelled.data, self.measured.data)
    }
}

/// Returns whether a log is the replay of a recording read with its hash.
pub fn is_replay_of(replay: &Data, recording: &Data) -> bool {
    let source = replay.records.replay.as_ref().map(|replay| &replay.source_sha256);
    source.is_some() && source == recording.sha256.as_ref()
}
