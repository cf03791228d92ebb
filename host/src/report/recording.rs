//! What a page shows of a log, read from end to end once.

use super::shapes::Shapes;
use super::table::Table;
use crate::attitude::{Drift, Series, levelling_deg};
use crate::log::schema::biflag::event::Kind;
use crate::log::schema::biflag::{Motor, Telemetry};
use crate::log::{Body, LONGEST_TRIAL_S, LogError, Message, Origin, TrialClock};
use crate::overview::Overview;
use crate::plan::robot;
use sim::params::Robot;
use std::path::{Path, PathBuf};

/// Asked and measured speed of motor 1, then of motor 2; turns of both.
pub(super) const MOTORS: usize = 6;

/// The yaw starts from its mean over the end of the phase before the run.
const START_S: f64 = 1.0;

/// The most events that are kept.
const MAX_EVENTS: usize = 2_000;

/// A trial, from its log.
#[derive(Clone, Debug)]
pub(super) struct Recording {
    pub path: PathBuf,
    pub overview: Overview,
    /// The attitude.
    pub series: Series,
    /// See [`MOTORS`].
    pub motors: Table<MOTORS>,
    /// True yaw, pitch, roll and turns of both shafts, where the log has them.
    pub truth: Table<5>,
    pub events: Vec<Event>,
    /// Events that there were beyond those that are kept.
    pub more_events: usize,
    pub link: Vec<LinkSecond>,
    pub shapes: Shapes,
}

/// Something that happened.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Event {
    /// The trial's clock.
    pub time_s: f64,
    pub kind: Kind,
    pub text: String,
}

/// The link within a second of the trial's clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct LinkSecond {
    /// Telemetry frames that came.
    pub received: u32,
    /// And did not.
    pub lost: u32,
    /// Requests that were sent again.
    pub retries: u32,
    /// What the board counted: frames it could not send, failed readings of the sensor, damaged frames, missed ticks.
    pub board: u32,
}

impl Recording {
    /// Reads a log; `shapes`: at most so many shapes of the flagella are kept.
    pub fn read(path: &Path, shapes: usize) -> Result<Self, LogError> {
        let mut collector = Collector::new(shapes);
        let (overview, series) = Overview::read_with(path, |message| collector.take(message))?;
        Ok(Self {
            path: path.to_owned(),
            overview,
            series,
            motors: collector.motors,
            truth: collector.truth,
            events: collector.events,
            more_events: collector.more_events,
            link: collector.link,
            shapes: collector.shapes,
        })
    }

    /// Whether it is the model's.
    pub fn is_model(&self) -> bool {
        self.overview.identity.as_ref().is_some_and(|identity| identity.origin == Origin::Model)
    }

    /// The robot that the log speaks of; the published one where it does not say, or does not read.
    pub fn robot(&self) -> Robot {
        let model = self.overview.model.as_ref().and_then(|model| model.robot());
        let given = || {
            let meta = self.overview.robot.as_ref()?;
            robot::parse(&meta.text, &meta.name).ok()
        };
        model.or_else(given).unwrap_or_default()
    }

    /// The yaw from where it was before the run, less the gyroscope's drift, and its 95 % uncertainty (NaN: not known).
    /// The drift shows while the robot is still before and after the run.
    pub fn yaw(&self) -> Table<2> {
        let (series, times) = (&self.series, &self.overview.times);
        let mut table = Table::default();
        let start = times.run.start;
        let before = (start - START_S).max(times.preroll.start).max(series.yaw.span().start)..start;
        let has_run = times.run.end > times.run.start;
        let zero = if has_run { series.yaw.mean(before.clone()).unwrap_or(0.0) } else { 0.0 };
        let from = 0.5 * (before.start + before.end);
        let drift = if self.is_model() || !has_run {
            None
        } else {
            Drift::seen(series, times.preroll.clone(), times.decay.clone())
        };
        for (i, (time, value)) in series.yaw.time_s.iter().zip(&series.yaw.value).enumerate() {
            let row = match &drift {
                Some(drift) => {
                    let levelling = levelling_deg(series.levelled_deg, series.pitch.value[i], series.roll.value[i]);
                    let uncertainty = drift.uncertainty(from.min(*time), from.max(*time)).hypot(levelling);
                    [value - zero - drift.between(from, *time), uncertainty]
                }
                None => [value - zero, f64::NAN],
            };
            table.push(*time, row);
        }
        table
    }

    /// When both shafts had turned how far: as truly as the log knows.
    pub fn turns_source(&self) -> (&[f64], [&[f64]; 2]) {
        if self.truth.time_s.is_empty() {
            let [.., one, two] = &self.motors.columns;
            (&self.motors.time_s, [one, two])
        } else {
            let [.., one, two] = &self.truth.columns;
            (&self.truth.time_s, [one, two])
        }
    }
}

/// What is kept of the messages as they pass.
struct Collector {
    motors: Table<MOTORS>,
    truth: Table<5>,
    events: Vec<Event>,
    more_events: usize,
    link: Vec<LinkSecond>,
    shapes: Shapes,
    clock: TrialClock,
    /// The board's counters in the frame before.
    counters: Option<[u32; 4]>,
    turns: [f64; 2],
    has_truth: bool,
}

impl Collector {
    fn new(shapes: usize) -> Self {
        Self {
            motors: Table::default(),
            truth: Table::default(),
            events: Vec::new(),
            more_events: 0,
            link: Vec::new(),
            shapes: Shapes::new(shapes),
            clock: TrialClock::default(),
            counters: None,
            turns: [0.0; 2],
            has_truth: false,
        }
    }

    fn take(&mut self, message: &Message) {
        self.clock.see(message);
        let time_s = self.clock.time_s(message);
        match &message.body {
            Body::Telemetry(telemetry) => self.telemetry(telemetry),
            Body::Truth(truth) => {
                self.has_truth = true;
                self.turns = [truth.motor1_turns, truth.motor2_turns];
                let row = [truth.yaw_deg, truth.pitch_deg, truth.roll_deg, truth.motor1_turns, truth.motor2_turns];
                self.truth.push(truth.time_s, row);
            }
            Body::Flagella(scene) => self.shapes.push(time_s, self.turns, scene),
            Body::Dropout(dropout) => self.second(time_s).lost += dropout.count,
            Body::Command(command) => self.second(time_s).retries += command.attempts.saturating_sub(1),
            Body::Event(event) => {
                if self.events.len() < MAX_EVENTS {
                    self.events.push(Event { time_s, kind: event.kind(), text: event.text.clone() });
                } else {
                    self.more_events += 1;
                }
            }
            _ => {}
        }
    }

    fn telemetry(&mut self, telemetry: &Telemetry) {
        let [one, two] = [&telemetry.motor1, &telemetry.motor2].map(|motor| motor.unwrap_or_default());
        let Motor { target_rpm, speed_rpm, turns, .. } = one;
        if !self.has_truth {
            self.turns = [turns, two.turns];
        }
        let row = [target_rpm, speed_rpm, two.target_rpm, two.speed_rpm, turns, two.turns];
        self.motors.push(telemetry.time_s, row);

        let now = [telemetry.unsent, telemetry.imu_errors, telemetry.bad_frames, telemetry.missed_ticks];
        let grown = |(now, then): (u32, u32)| now.wrapping_sub(then) & 0xFFFF;
        let counted: u32 = now.into_iter().zip(self.counters.unwrap_or(now)).map(grown).sum();
        self.counters = Some(now);
        let second = self.second(telemetry.time_s);
        second.received += 1;
        second.board += counted;
    }

    fn second(&mut self, time_s: f64) -> &mut LinkSecond {
        let index = time_s.clamp(0.0, LONGEST_TRIAL_S) as usize;
        if self.link.len() <= index {
            self.link.resize(index + 1, LinkSecond::default());
        }
        &mut self.link[index]
    }
}
