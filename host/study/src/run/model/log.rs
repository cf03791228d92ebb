//! The log of a trial in the model, with the messages that an ideal board sends.

use super::Model;
use super::board::IdealBoard;
use crate::plan::{Plan, Setpoint, Trial, board};
use crate::run::{Recorder, start};
use biflag_log::{EventKind, LogError, Origin, Summary};
use nalgebra::Vector3;
use sim::trial::sample::Sample;
use std::path::Path;
use std::time::{Duration, SystemTime};

pub(super) struct ModelLog {
    board: IdealBoard,
    pub kept: Recorder,
    /// Number of samples.
    index: u64,
}

impl ModelLog {
    pub fn create(model: &Model, plan: &Plan, trial: &Trial, (attempt, path): (u32, &Path)) -> Result<Self, LogError> {
        let board = IdealBoard::new(&model.robot, model.settings);
        let board_meta = board::to_log(&board.info(), &model.settings);
        let start = start(plan, trial, attempt, Origin::Model, Some(board_meta), instant(0.0));
        let mut kept = Recorder::create(path, &start, model.settings, instant(0.0))?;
        kept.meta(model.meta().clone(), |records| &mut records.model)?;
        Ok(Self { board, kept, index: 0 })
    }

    pub fn sample(&mut self, sample: &Sample, acceleration: Vector3<f64>, setpoint: Setpoint) -> Result<(), LogError> {
        let frame = self.board.telemetry(self.index, sample, acceleration, setpoint);
        let host = instant(sample.time_s);
        self.kept.frame(&frame, IdealBoard::clock_us(sample.time_s), host)?;
        self.kept.sample(sample, host)?;
        self.index += 1;
        Ok(())
    }

    pub fn event(&mut self, time_s: f64, kind: EventKind, text: &str) -> Result<(), LogError> {
        self.kept.log.at(time_s);
        self.kept.event(kind, text, instant(time_s))
    }

    pub fn finish(self, mut summary: Summary) -> Result<(), LogError> {
        summary.link.samples = self.index;
        self.kept.finish(&mut summary).map(drop)
    }
}

/// Returns the rate of change between two times; zero if the times are equal.
pub(super) fn change(from: (f64, Vector3<f64>), to: (f64, Vector3<f64>)) -> Vector3<f64> {
    if to.0 > from.0 { (to.1 - from.1) / (to.0 - from.0) } else { Vector3::zeros() }
}

/// Returns the host time of a modelled trial, which begins at the epoch.
pub(super) fn instant(time_s: f64) -> SystemTime {
    SystemTime::UNIX_EPOCH + Duration::from_secs_f64(time_s)
}
