//! The content of a log as columns over the trial's clock, and its metadata.

use super::fields::{FRAME, TRUTH};
use super::finding::Finding;
use super::shapes::Shapes;
use crate::attitude::{Columns, Reading, Track};
use crate::plan::{PlanError, RobotFile, board, robot};
use crate::sensor::Sensor;
use crate::swing::SwingSpeeds;
use biflag_log::schema::biflag::event::Kind;
use biflag_log::{
    BoardMeta, CalibrationMeta, ClockMeta, Condition, End, Identity, ImportMeta, LevelMeta, LinkStats, Loss,
    MeasuredSensorMeta, Method, ModelMeta, Origin, PlanMeta, Reader, RecoveryMeta, ReplayMeta, RestMeta, RobotMeta,
    SensorMeta, Start, SteadyMeta, SteerMeta, Summary, TrialMeta,
};
use protocol::units::CentiRpm;
use protocol::{Settings, SpeedFrom};
use sim::params::Robot;
use sim::steady::phase::Ratio;
use sim::trial::means::WINDOW;
use sim::trial::quantity::SAMPLE_COLUMNS;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::OnceLock;

/// Columns of [`Data::motors`]: target and measured speed of motor 1, then of motor 2 (rpm); turns of both from their
/// encoders.
pub const MOTORS: usize = 6;

/// Longest time without frames in which no robot makes a full turn, s: the fastest takes 3 s.
const LONG_GAP_S: f64 = 1.0;

/// The optional parts of a log to read.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Want {
    /// The forces of a modelled robot.
    pub forces: bool,
    /// The fields of a board's frames.
    pub frames: bool,
    /// Largest number of the flagella's shapes to keep; 0: none.
    pub shapes: usize,
    /// The hash of the file.
    pub hash: bool,
}

macro_rules! records {
    ($($(#[$about:meta])* $name:ident: $kind:ty,)*) => {
        /// The metadata records of a log.
        #[derive(Clone, PartialEq, Debug, Default)]
        pub struct Records {
            $($(#[$about])* pub $name: Option<$kind>,)*
        }

        impl Records {
            /// Returns the records that a reader has found so far.
            pub(super) fn of(reader: &Reader) -> Self {
                Self { $($name: reader.meta()),* }
            }
        }
    };
}

records! {
    /// The program that wrote the log, and where the trial ran.
    identity: Identity,
    /// The plan.
    plan: PlanMeta,
    /// The trial.
    trial: TrialMeta,
    /// The robot's file, as named in the plan.
    robot: RobotMeta,
    /// The board.
    board: BoardMeta,
    /// The sensor's errors, measured before the trial.
    measured_sensor: MeasuredSensorMeta,
    /// The attitude that a steered trial was to reach.
    steer: SteerMeta,
    /// The model that computed the trial, or the robot behind an emulated board.
    model: ModelMeta,
    /// Errors of an emulated sensor.
    sensor: SensorMeta,
    /// Steady state computed by the model.
    steady: SteadyMeta,
    /// The gyroscope's calibration.
    calibration: CalibrationMeta,
    /// How the robot came to rest before the trial.
    rest: RestMeta,
    /// The vertical at rest.
    level: LevelMeta,
    /// The clocks of board and host.
    clock: ClockMeta,
    /// The damaged log that this one was recovered from.
    recovery: RecoveryMeta,
    /// The recording that drove the model.
    replay: ReplayMeta,
    /// The table that an imported trial was made from.
    import: ImportMeta,
    /// How the trial ended; `None` if the log has no summary.
    summary: Summary,
}

impl Records {
    /// Returns the records at the start of a trial.
    pub fn of_start(start: &Start) -> Self {
        let Start { identity, plan, trial, robot, board, sensor } = start.clone();
        Self {
            identity: Some(identity),
            plan: Some(plan),
            trial: Some(trial),
            robot: Some(robot),
            board,
            measured_sensor: sensor,
            ..Self::default()
        }
    }

    /// Returns where the trial ran; the rig if the log does not say.
    pub fn origin(&self) -> Origin {
        self.identity.as_ref().map_or(Origin::Rig, |identity| identity.origin)
    }
}

/// An event of a trial.
#[derive(Clone, PartialEq, Debug)]
pub struct Event {
    /// Time on the trial's clock.
    pub time_s: f64,
    /// Kind.
    pub kind: Kind,
    /// Text; for a phase, its name.
    pub text: String,
}

/// Link statistics of one second of the trial.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct LinkSecond {
    /// Telemetry frames that arrived.
    pub received: u32,
    /// Telemetry frames that were lost.
    pub lost: u32,
    /// Requests that were sent again.
    pub retries: u32,
    /// Errors counted by the board: frames that it could not send, failed readings of the sensor, damaged frames,
    /// missed ticks.
    pub board: u32,
}

/// Phases of a trial, seconds of its clock. A phase that the trial did not reach is empty.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Times {
    /// The rest before the run.
    pub preroll: Range<f64>,
    /// The motors turn.
    pub run: Range<f64>,
    /// After the run.
    pub decay: Range<f64>,
}

impl Times {
    /// Returns whether the trial reached its run.
    pub fn has_run(&self) -> bool {
        self.run.end > self.run.start
    }

    /// Returns start and end of the run; `None` if the trial did not reach it.
    pub fn run_s(&self) -> Option<[f64; 2]> {
        self.has_run().then_some([self.run.start, self.run.end])
    }
}

/// A trial, read from its log. Times are seconds since its first frame, by the board's clock. If pings have measured
/// the rate of that clock, times and speeds are corrected.
#[derive(Clone, Debug, Default)]
pub struct Data {
    /// Path of the log.
    pub path: PathBuf,
    /// Its metadata.
    pub records: Records,
    /// The settings in the metadata, parsed once.
    pub(crate) settings: OnceLock<Option<Settings>>,
    /// Readings of the sensor, without failed ones; for an imported trial, readings of the other instruments.
    pub readings: Vec<(f64, Reading)>,
    /// Index of the first reading after the gyroscope's calibration; earlier rates have another bias.
    pub calibrated: usize,
    /// The fields in [`FRAME`], a row for each of the readings; empty unless requested, and for an imported trial.
    pub frames: Columns<{ FRAME.len() }>,
    /// See [`MOTORS`].
    pub motors: Columns<MOTORS>,
    /// Modelled and simulated robots only: the fields in [`TRUTH`], unrounded.
    pub truth: Columns<{ TRUTH.len() }>,
    /// The columns of [`sim::trial::quantity::sample_columns`]; empty unless requested.
    pub forces: Columns<SAMPLE_COLUMNS>,
    /// Shapes of the flagella; empty unless requested.
    pub shapes: Shapes,
    /// Events, up to a limit.
    pub events: Vec<Event>,
    /// When the LED of the board was lit: from the first frame with a motor on to the end of the last one.
    pub lit_s: Option<[f64; 2]>,
    /// Number of events dropped beyond the limit.
    pub more_events: usize,
    /// Name and start of each phase.
    pub phases: Vec<(String, f64)>,
    /// Pre-roll, run and decay.
    pub times: Times,
    /// Link statistics of the trial, from its summary or counted from the messages.
    pub link: LinkStats,
    /// Link statistics second by second.
    pub link_seconds: Vec<LinkSecond>,
    /// Mean temperature of the sensor, °C; NaN if it is unknown.
    pub temperature_c: f64,
    /// Time of the last frame.
    pub duration_s: f64,
    /// Number of messages by channel.
    pub channels: BTreeMap<String, u64>,
    /// Condition of the log.
    pub condition: Condition,
    /// The program that rewrote the log, if one did.
    pub rewritten_by: Option<String>,
    /// Unreadable parts of the log.
    pub losses: Vec<Loss>,
    /// SHA-256 of the file, if requested.
    pub sha256: Option<String>,
    /// Reasons for a shortened or shifted run.
    pub warnings: Vec<String>,
    /// Findings about the log's identity within its session: see [`crate::session`].
    pub identity: Vec<Finding>,
}

/// The beginning of a note that the user wrote while the trial ran.
pub const OPERATOR: &str = "operator: ";

impl Data {
    /// Returns the notes that the user wrote while the trial ran, with their times, s.
    pub fn notes(&self) -> impl Iterator<Item = (f64, &str)> {
        let notes = self.events.iter().filter(|event| event.kind == Kind::Note);
        notes.filter_map(|event| Some((event.time_s, event.text.strip_prefix(OPERATOR)?)))
    }

    /// Returns where the trial ran.
    pub fn origin(&self) -> Origin {
        self.records.origin()
    }

    /// Returns whether the trial ended as planned and its log is intact.
    pub fn is_complete(&self) -> bool {
        let ended = self.records.summary.as_ref().is_some_and(|summary| summary.end == End::Complete);
        self.losses.is_empty() && ended
    }

    /// Returns whether the trial was computed by a model.
    pub fn is_model(&self) -> bool {
        self.origin() == Origin::Model
    }

    /// Returns whether the trial is a steady state from a solver, without the motion before it.
    pub fn is_steady_state(&self) -> bool {
        self.records.model.as_ref().is_some_and(|model| model.method == Method::Steady)
    }

    /// Returns whether a board recorded the trial, with its sensor.
    pub fn is_recorded(&self) -> bool {
        self.origin().is_recorded()
    }

    /// Returns the noun and the verb for the missing content of a gap: a camera has no telemetry.
    pub(super) fn lacking(&self) -> [&'static str; 2] {
        if self.origin() == Origin::Imported { ["rows of the table", "are"] } else { ["telemetry", "is"] }
    }

    /// Returns whether the trial measured a real robot: no model computed it, and none was behind its board.
    pub fn is_real(&self) -> bool {
        self.records.model.is_none()
    }

    /// Returns the record of the trial, or an empty one if the log has none.
    pub fn trial(&self) -> TrialMeta {
        let trial = self.records.trial.clone().unwrap_or_default();
        if self.records.steer.is_none() {
            return trial;
        }
        let [w1_rpm, w2_rpm] = self.speeds().map(CentiRpm::rpm);
        TrialMeta { w1_rpm, w2_rpm, ..trial }
    }

    /// Returns the target speeds of flagella 1 and 2 at the start of the run; for a steered trial, their means at its
    /// end, where the steady angles are measured.
    pub fn speeds(&self) -> [CentiRpm; 2] {
        let run = &self.times.run;
        self.steered_speeds((run.end - WINDOW).max(run.start)..run.end).unwrap_or_else(|| self.planned_speeds())
    }

    /// Returns the plan's speeds; for a steered trial, the feed-forward.
    pub fn planned_speeds(&self) -> [CentiRpm; 2] {
        let trial = self.records.trial.as_ref();
        trial.map_or([CentiRpm(0); 2], |trial| [trial.w1_rpm, trial.w2_rpm].map(CentiRpm::from_rpm))
    }

    /// Returns the ratio of the speeds, if it is simple and encoders keep it: the phase of the flagella then matters.
    pub fn ratio(&self) -> Option<Ratio> {
        Ratio::of(self.speeds().map(CentiRpm::rpm)).filter(|_| !self.is_blind())
    }

    /// Returns the mean target speeds of a steered trial over a time; `None` for a trial that was not steered.
    pub(super) fn steered_speeds(&self, over: Range<f64>) -> Option<[CentiRpm; 2]> {
        self.records.steer.as_ref().filter(|_| self.times.has_run())?;
        let [one, _, two, ..] = self.motors.tracks();
        Some([one.mean(over.clone())?, two.mean(over)?].map(CentiRpm::from_rpm))
    }

    /// Returns the motor that reverses, and the time of the reversal, s from the start of the run.
    pub fn reverse(&self) -> Option<(u8, f64)> {
        let trial = self.records.trial.as_ref()?;
        trial.reverse_motor.zip(trial.reverse_after_s)
    }

    /// Returns the settings of the board.
    pub fn settings(&self) -> Option<Settings> {
        *self.settings.get_or_init(|| self.records.board.as_ref().and_then(board::of_log))
    }

    /// Returns a time on the clock of an import's table, or of the recording that it was aligned with, s.
    pub(super) fn by_table_s(&self, time_s: f64) -> f64 {
        time_s + self.records.import.as_ref().map_or(0.0, |import| import.start_s)
    }

    /// Returns whether the motors have no encoders.
    pub fn is_blind(&self) -> bool {
        self.is_recorded() && self.settings().is_some_and(|settings| settings.speed_from == SpeedFrom::Duty)
    }

    /// Replaces the commanded speeds by those measured from the swing, and the turns by their integral. The first and the last
    /// measured speed also hold before and after the measurement.
    pub(super) fn take_speeds(&mut self, measured: &SwingSpeeds) {
        let commanded = self.planned_speeds().map(CentiRpm::rpm);
        let [_, w1, _, w2, turns1, turns2] = &mut self.motors.values;
        for (k, [rpm, turns]) in [[w1, turns1], [w2, turns2]].into_iter().enumerate() {
            let told = measured.over_time.track(k);
            for (i, time_s) in self.motors.time_s.iter().enumerate() {
                let Some(told) = told.at(*time_s).filter(|_| commanded[k] != 0.0) else { break };
                rpm[i] *= told / commanded[k];
                let before = i.saturating_sub(1);
                turns[i] = turns[before] + rpm[i] / 60.0 * (time_s - self.motors.time_s[before]);
            }
        }
    }

    /// Returns the sensor: the measured errors in the log, and the data sheet for all others.
    pub fn sensor(&self) -> Sensor {
        Sensor::of(self.records.measured_sensor.as_ref())
    }

    /// Returns the robot's parameters: the model's, or on a rig those of the robot named in the plan.
    ///
    /// # Errors
    /// [`PlanError`] if the parameters in the log are invalid.
    pub fn robot(&self) -> Result<Robot, PlanError> {
        match (&self.records.model, &self.records.robot) {
            (Some(model), _) => robot::parse(&model.current_parameters(), "its parameters"),
            (None, file) => RobotFile::of_log(file.clone()).parse(),
        }
    }

    /// Returns the turns of a motor by its encoder.
    pub fn motor_turns(&self, motor: usize) -> Track<'_> {
        self.motors.track(4 + motor)
    }

    /// Returns the turns of both shafts over time, unrounded if available.
    pub fn turns(&self) -> Columns<2> {
        if self.truth.is_empty() { self.motors.last() } else { self.truth.last() }
    }

    /// Returns whether a gap in the frames is so long that the robot may have made a full turn in it.
    pub fn has_long_gap(&self) -> bool {
        self.longest_gap().is_some_and(|gap| gap.end - gap.start > LONG_GAP_S)
    }

    /// Returns the longest gap in the frames. A model has none: its samples contain all full turns.
    pub(super) fn longest_gap(&self) -> Option<Range<f64>> {
        if self.is_model() {
            return None;
        }
        let gaps = self.readings[self.calibrated..].windows(2).map(|pair| pair[0].0..pair[1].0);
        gaps.max_by(|a, b| (a.end - a.start).total_cmp(&(b.end - b.start)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{Estimate, MeasuredSensor};
    use crate::trial::Collector;
    use biflag_log::FORMAT;
    use protocol::Info;
    use protocol::units::{Axis, AxisMap};
    use std::path::Path;

    /// Returns a trial on a board whose gyroscope measures body axis y along its z axis.
    fn data(measured: &[(&str, &str, f64, f64)]) -> Data {
        let gyro_axes = AxisMap([Axis::PlusX, Axis::MinusZ, Axis::PlusY]);
        let settings = Settings { gyro_axes, ..Settings::DEFAULT };
        let mut file = MeasuredSensor::new(&settings);
        for (table, key, value, u) in measured {
            file.set(table, key, Estimate { value: *value, u: *u });
        }
        let sensor = MeasuredSensorMeta { name: "sensor.toml".to_owned(), text: file.to_toml() };
        let records = Records {
            board: Some(board::to_log(&Info::default(), &settings)),
            measured_sensor: (!measured.is_empty()).then_some(sensor),
            ..Records::default()
        };
        Collector::new(Want::default(), FORMAT).finish(Path::new("a.mcap"), records)
    }

    #[test]
    fn measured_errors_replace_those_of_the_data_sheet() {
        let sheet = Sensor::of_data_sheet();
        assert_eq!(data(&[]).sensor(), sheet);
        let sensor = data(&[
            ("gyro_scale", "y", -0.021, 0.0005),
            ("gyro_cross", "yz", 0.01, 0.004),
            ("mounting_deg", "z", 1.5, 0.2),
        ])
        .sensor();
        assert!((sensor.gyro_scale[1].value + 0.021).abs() < 1e-12 && sensor.gyro_scale[1].u == 0.0005, "{sensor:?}");
        assert_eq!(sensor.gyro_cross[1][2], Estimate { value: 0.01, u: 0.004 });
        assert_eq!(sensor.mounting_deg[2], Estimate { value: 1.5, u: 0.2 });
        assert_eq!((sensor.gyro_scale[2], sensor.accel_scale), (sheet.gyro_scale[2], sheet.accel_scale));
    }
}
