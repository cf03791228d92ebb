//! What a log tells of its trial, read from end to end.

use crate::attitude::{Angles, PhaseTimes, Reading, Series, Times};
use crate::log::schema::biflag::event::Kind;
use crate::log::{
    BoardMeta, Body, CalibrationMeta, ClockFit, Condition, Identity, LogError, Loss, Message, ModelMeta, PlanMeta,
    Reader, RecoveryMeta, RobotMeta, SteadyMeta, Summary, TrialClock, TrialMeta,
};
use crate::stats::LinkStats;
use protocol::units::CentiRpm;
use std::collections::BTreeMap;
use std::path::Path;

/// What a log tells.
#[derive(Clone, Debug)]
pub struct Overview {
    /// What wrote it.
    pub identity: Option<Identity>,
    /// The plan.
    pub plan: Option<PlanMeta>,
    /// The trial.
    pub trial: Option<TrialMeta>,
    /// The robot's parameters, as the plan gave them.
    pub robot: Option<RobotMeta>,
    /// The board.
    pub board: Option<BoardMeta>,
    /// What the trial was computed with, and what it came to, where it was.
    pub model: Option<ModelMeta>,
    /// See [`Overview::model`].
    pub steady: Option<SteadyMeta>,
    /// The gyroscope's calibration in this trial.
    pub calibration: Option<CalibrationMeta>,
    /// The clocks.
    pub clock: Option<ClockFit>,
    /// What it was recovered from.
    pub recovery: Option<RecoveryMeta>,
    /// How the trial ended; `None`: the log does not say.
    pub summary: Option<Summary>,
    /// How well the link worked: as summed up, or as far as it can be counted.
    pub link: LinkStats,
    /// Angles, computed anew.
    pub angles: Option<Angles>,
    /// When its phases were.
    pub times: Times,
    /// Time of the last telemetry frame on the trial's clock.
    pub duration_s: f64,
    /// Messages by channel.
    pub channels: BTreeMap<String, u64>,
    /// How the log is.
    pub condition: Condition,
    /// Where it does not read.
    pub losses: Vec<Loss>,
}

impl Overview {
    /// Reads a whole log.
    ///
    /// # Errors
    /// [`LogError`].
    pub fn read(path: &Path) -> Result<Self, LogError> {
        Self::read_with(path, |_| {}).map(|(overview, _)| overview)
    }

    /// Reads a whole log, and shows each of its messages to `see` on the way. Answers the attitude beside it, from the
    /// gyroscope's calibration on.
    ///
    /// # Errors
    /// [`LogError`].
    pub fn read_with(path: &Path, mut see: impl FnMut(&Message)) -> Result<(Self, Series), LogError> {
        let mut reader = Reader::open(path)?;
        let mut collector = Collector::default();
        while let Some(message) = reader.next() {
            let message = message?;
            if let Body::Event(event) = &message.body
                && event.kind() == Kind::Phase
                && event.text == "run"
                && let Some(level) = reader.meta()
            {
                collector.series.level(&level);
            }
            collector.take(&message);
            see(&message);
        }
        let board: Option<BoardMeta> = reader.meta();
        if let Some(settings) = board.as_ref().and_then(BoardMeta::settings) {
            collector.series.filtered_with(&settings);
        }
        let times = collector.times.times();
        let trial: Option<TrialMeta> = reader.meta();
        let speeds = trial.as_ref().map_or([CentiRpm(0); 2], |t| [t.w1_rpm, t.w2_rpm].map(CentiRpm::from_rpm));
        let summary: Option<Summary> = reader.meta();
        let overview = Self {
            identity: reader.meta(),
            plan: reader.meta(),
            robot: reader.meta(),
            board,
            model: reader.meta(),
            steady: reader.meta(),
            calibration: reader.meta(),
            clock: reader.meta(),
            recovery: reader.meta(),
            link: collector.link(summary.as_ref().map(|summary| summary.link)),
            angles: Angles::of(&collector.series, &times, speeds),
            times,
            duration_s: collector.times.last_s(),
            channels: reader.counts().clone(),
            condition: reader.condition().unwrap_or(Condition::Damaged),
            losses: reader.losses().to_vec(),
            trial,
            summary,
        };
        Ok((overview, collector.series))
    }
}

/// What is kept of the messages as they pass.
#[derive(Default)]
struct Collector {
    series: Series,
    link: LinkStats,
    clock: TrialClock,
    times: PhaseTimes,
}

impl Collector {
    fn take(&mut self, message: &Message) {
        self.clock.see(message);
        match &message.body {
            Body::Telemetry(telemetry) => {
                self.link.samples += 1;
                self.times.go_on(telemetry.time_s);
                if let Some(reading) = Reading::of(telemetry) {
                    self.series.push(telemetry.time_s, &reading);
                }
            }
            Body::Dropout(dropout) => self.link.lost += u64::from(dropout.count),
            Body::Command(command) => self.link.retries += u64::from(command.attempts.saturating_sub(1)),
            // The rates mean something else from here on.
            Body::Event(event) if event.kind() == Kind::Calibration => self.series.restart(),
            Body::Event(event) if event.kind() == Kind::Phase => {
                self.times.begin(&event.text, self.clock.time_s(message));
            }
            _ => {}
        }
    }

    /// Counts of the link. What was summed up when the trial ended knows more than the messages, but for samples that the
    /// log has lost since.
    fn link(&self, summed_up: Option<LinkStats>) -> LinkStats {
        let Some(summed_up) = summed_up else { return self.link };
        let missing = summed_up.samples.saturating_sub(self.link.samples);
        LinkStats { samples: self.link.samples, lost: summed_up.lost + missing, ..summed_up }
    }
}
