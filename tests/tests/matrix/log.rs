//! A log that is changed and written again.

use biflag_log::schema::biflag::Dropout;
use biflag_log::{
    Body, CalibrationMeta, ClockMeta, LevelMeta, ModelMeta, Reader, RestMeta, SensorMeta, Start, Summary, Writer,
};
use std::path::Path;
use std::time::{Duration, SystemTime};

/// A log in memory, to be changed and written again.
pub(super) struct Log {
    pub start: Start,
    pub level: Option<LevelMeta>,
    pub rest: Option<RestMeta>,
    pub summary: Summary,
    pub calibration: Option<CalibrationMeta>,
    others: (Option<ClockMeta>, Option<ModelMeta>, Option<SensorMeta>),
    /// Time and content of each message.
    pub messages: Vec<(f64, Body)>,
}

impl Log {
    pub fn read(path: &Path) -> Self {
        let mut reader = Reader::open(path).unwrap().only(vec!["/telemetry", "/event"]);
        let mut clock = biflag_log::TrialClock::default();
        let messages = reader.by_ref().map(|message| {
            let message = message.unwrap();
            clock.see(&message);
            (clock.time_s(&message), message.body)
        });
        let messages = messages.collect();
        let start = Start {
            identity: reader.meta().unwrap(),
            plan: reader.meta().unwrap(),
            trial: reader.meta().unwrap(),
            robot: reader.meta().unwrap(),
            board: reader.meta(),
            sensor: reader.meta(),
        };
        let calibration = reader.meta();
        let others = (reader.meta(), reader.meta(), reader.meta());
        let (level, rest, summary) = (reader.meta(), reader.meta(), reader.meta().unwrap());
        Self { start, level, rest, summary, calibration, others, messages }
    }

    pub fn write(self, path: &Path) {
        let host = SystemTime::UNIX_EPOCH + Duration::from_secs(1_700_000_000);
        let mut log = Writer::create(path, &self.start, host).unwrap();
        let (clock, model, sensor) = &self.others;
        model.iter().for_each(|meta| log.meta(meta).unwrap());
        sensor.iter().for_each(|meta| log.meta(meta).unwrap());
        self.calibration.iter().for_each(|meta| log.meta(meta).unwrap());
        self.level.iter().for_each(|meta| log.meta(meta).unwrap());
        self.rest.iter().for_each(|meta| log.meta(meta).unwrap());
        clock.iter().for_each(|meta| log.meta(meta).unwrap());
        log.board_time(0, host);
        for (time_s, body) in &self.messages {
            match body {
                Body::Telemetry(frame) => log.message_at(frame.time_s, &**frame, host).unwrap(),
                Body::Event(event) => log.message_at(*time_s, event, host).unwrap(),
                Body::Dropout(dropout) => log.message_at(*time_s, dropout, host).unwrap(),
                other => panic!("{other:?}"),
            }
        }
        log.finish(&self.summary).unwrap();
    }

    /// Changes every frame.
    pub fn frames(&mut self, mut change: impl FnMut(&mut biflag_log::schema::biflag::Telemetry)) {
        for (_, body) in &mut self.messages {
            if let Body::Telemetry(frame) = body {
                change(frame);
            }
        }
    }

    pub fn run_start_s(&self) -> f64 {
        let begins = |body: &Body| matches!(body, Body::Event(event) if event.text == "run");
        self.messages.iter().find(|(_, body)| begins(body)).unwrap().0
    }

    /// Removes the frames between two times, with the message that says so.
    pub fn lose(&mut self, from_s: f64, to_s: f64) {
        let before = self.messages.len();
        self.messages.retain(|(_, body)| match body {
            Body::Telemetry(frame) => !(from_s..to_s).contains(&frame.time_s),
            _ => true,
        });
        let count = (before - self.messages.len()) as u32;
        let place = self.messages.partition_point(|(time_s, _)| *time_s < from_s);
        self.messages.insert(place, (from_s, Body::Dropout(Dropout { count, ..Dropout::default() })));
        self.summary.link.lost = count.into();
        self.summary.link.samples -= u64::from(count);
    }

    pub fn settings(&mut self, change: impl FnOnce(&mut toml::Table)) {
        let board = self.start.board.as_mut().unwrap();
        let mut settings: toml::Table = board.settings.parse().unwrap();
        change(&mut settings);
        board.settings = settings.to_string();
    }
}
