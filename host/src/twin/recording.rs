//! A trial's log as the twin needs it: attitude, encoders, phases, and what is wrong with it.

use super::TwinError;
use crate::attitude::{Reading, Times, rotation};
use crate::log::schema::biflag::{self, event::Kind};
use crate::log::{
    BoardMeta, Body, Condition, End, Identity, LevelMeta, Message, ModelMeta, Origin, PlanMeta, Reader, ReplayMeta,
    RobotMeta, Summary, TrialClock, TrialMeta,
};
use crate::plan::robot;
use protocol::units::{CentiRpm, LOW_PASS};
use sim::params::Robot;
use std::path::{Path, PathBuf};

/// Frames further apart than this have a gap between them, s. Twenty frames of a board, or four of a model.
const GAP_S: f64 = 0.21;

/// The shortest run that is worth a model's while, s.
const SHORTEST_RUN_S: f64 = 1.0;

/// The channels that are read.
const CHANNELS: &[&str] = &["/telemetry", "/event"];

/// What a log tells of its trial. Times are seconds since its first frame.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The log.
    pub path: PathBuf,
    /// The trial.
    pub trial: TrialMeta,
    /// Where it was run.
    pub origin: Origin,
    /// Its plan.
    pub plan: Option<PlanMeta>,
    /// The board.
    pub board: Option<BoardMeta>,
    /// What a model computed it with: all of it, or the robot behind an emulated board.
    pub model: Option<ModelMeta>,
    /// What its plan says of the robot.
    pub robot_meta: Option<RobotMeta>,
    /// What it is a replay of.
    pub replay: Option<ReplayMeta>,
    /// How the sensor hung before the run, where that was taken off the attitude.
    pub level: Option<LevelMeta>,
    /// Time and what the sensor said, from the gyroscope's calibration on; readings that failed are left out.
    pub attitude: Vec<(f64, Reading)>,
    /// Time and turns of both flagella by their encoders.
    pub turns: Vec<(f64, [f64; 2])>,
    /// Names and beginnings of the phases.
    pub phases: Vec<(String, f64)>,
    /// Still, run and decay.
    pub times: Times,
    /// Time of the last frame.
    pub end_s: f64,
    /// Mean temperature of the sensor, °C.
    pub temperature_c: f64,
    /// What is wrong with it, and what is done about it.
    pub warnings: Vec<String>,
}

impl Recording {
    /// Reads a log from end to end.
    ///
    /// # Errors
    /// [`TwinError::Log`]; [`TwinError::Unusable`] where there is no run in it.
    pub fn read(path: &Path) -> Result<Self, TwinError> {
        let mut reader = Reader::open(path)?.only(CHANNELS);
        let mut collector = Collector::default();
        for message in reader.by_ref() {
            collector.take(&message?);
        }
        let unusable = |reason: &str, help| TwinError::Unusable { path: path.to_owned(), reason: reason.into(), help };
        let whole = "name the log of a trial that `biflag record` or `biflag simulate` ran";
        let trial: TrialMeta =
            reader.meta().ok_or_else(|| unusable("the record that says which trial it is does not read", whole))?;
        let identity: Option<Identity> = reader.meta();
        let origin = identity.as_ref().map_or(Origin::Rig, |identity| identity.origin);
        let mut warnings = Vec::new();
        if let Some(found) = identity.map(|identity| identity.protocol).filter(|found| *found != protocol::VERSION) {
            warnings.push(format!(
                "it was recorded with protocol {found} and this program speaks {}; the log's own messages are used, \
                 which do not depend on it",
                protocol::VERSION
            ));
        }
        if collector.turns.is_empty() {
            let reason = if collector.frames == 0 { "holds no telemetry" } else { "holds no speeds of the motors" };
            return Err(unusable(reason, whole));
        }
        match reader.condition() {
            Some(Condition::Clean) => {}
            Some(Condition::CutOff) => warnings.push("the log is cut off; what is there is used".to_owned()),
            _ => {
                let lost: Vec<_> = reader.losses().iter().map(ToString::to_string).collect();
                warnings.push(format!("the log is damaged ({}); what reads is used", lost.join("; ")));
            }
        }
        // A log is levelled from its run on; what came before is levelled alike, so that both have one zero.
        let level = reader.meta::<LevelMeta>().filter(|level| level.used);
        if let Some(level) = &level {
            for (_, reading) in &mut collector.attitude[..collector.before_run] {
                let levelled = level.levelled(rotation(reading.attitude));
                reading.attitude = [levelled.w, levelled.i, levelled.j, levelled.k];
            }
        }
        // The sensor's filter tells of a motion some milliseconds after it; encoders are read at once.
        let settings = reader.meta::<BoardMeta>().and_then(|board| board.settings());
        if let (Some(settings), false) = (settings, origin == Origin::Model) {
            let (_, delay_s) = LOW_PASS[usize::from(settings.low_pass).min(LOW_PASS.len() - 1)];
            collector.attitude.iter_mut().for_each(|(time, _)| *time -= delay_s);
        }
        let end_s = collector.turns.last().map_or(0.0, |(time, _)| *time);
        let mut recording = Self {
            path: path.to_owned(),
            origin,
            plan: reader.meta(),
            board: reader.meta(),
            model: reader.meta(),
            replay: reader.meta(),
            robot_meta: reader.meta(),
            times: Times::default(),
            end_s,
            temperature_c: collector.temperature_sum / collector.frames as f64,
            warnings,
            trial,
            level,
            attitude: std::mem::take(&mut collector.attitude),
            turns: std::mem::take(&mut collector.turns),
            phases: std::mem::take(&mut collector.phases),
        };
        recording.bound(&collector, reader.meta::<Summary>())?;
        recording.look_for_gaps();
        recording.look_at_the_encoders()?;
        Ok(recording)
    }

    /// Speeds that were asked for.
    pub fn speeds(&self) -> [CentiRpm; 2] {
        [self.trial.w1_rpm, self.trial.w2_rpm].map(CentiRpm::from_rpm)
    }

    /// The motor that reversed, and when, s from the start of the run.
    pub fn reverse(&self) -> Option<(u8, f64)> {
        self.trial.reverse_motor.zip(self.trial.reverse_after_s)
    }

    /// The robot: of a model, what it was computed with; of a rig, what its plan says.
    ///
    /// # Errors
    /// [`TwinError::Robot`].
    pub fn robot(&self) -> Result<Robot, TwinError> {
        let parse = |text: &str, name: &str| {
            robot::parse(text, name)
                .map_err(|source| TwinError::Robot { path: self.path.clone(), source: Box::new(source) })
        };
        match (&self.model, &self.robot_meta) {
            (Some(model), _) => parse(&model.parameters, "its parameters"),
            (None, Some(robot)) => parse(&robot.text, &robot.name),
            (None, None) => Ok(Robot::default()),
        }
    }

    /// Whether frames are missing for so long that the yaw may have gone round unseen: the fastest robot takes 3 s.
    pub(super) fn has_long_gap(&self) -> bool {
        self.attitude.windows(2).any(|pair| pair[1].0 - pair[0].0 > 1.0)
    }

    /// Finds the phases, and where the run really ends.
    fn bound(&mut self, collector: &Collector, summary: Option<Summary>) -> Result<(), TwinError> {
        let unusable = |reason: String, help| Err(TwinError::Unusable { path: self.path.clone(), reason, help });
        let moves = self.speeds() != [CentiRpm(0); 2];
        let begun = self.phases.iter().find(|(name, _)| name == "run").map(|(_, start)| *start);
        // The motors of a rig get their speeds a moment after the phase has begun.
        let start = match (begun, collector.ordered_s.filter(|_| moves && self.origin != Origin::Model)) {
            (_, Some(ordered)) => ordered,
            (Some(begun), None) => begun,
            (None, None) => {
                return unusable("its motors never ran".into(), "repeat the trial with `biflag record PLAN --resume`");
            }
        };
        let phase = |name: &str| self.phases.iter().position(|(phase, _)| phase == name);
        let next = phase("run").and_then(|at| self.phases.get(at + 1)).map(|(_, next)| *next);
        let mut end = next.unwrap_or(self.end_s).min(self.end_s);
        let after = end;
        if let Some((time, fault)) = &collector.fault
            && *time < end
        {
            self.warnings.push(format!("the board stopped at {time:.1} s ({fault}); the run is used up to there"));
            end = *time;
        } else if next.is_none() {
            let how = match summary {
                None => "it ends without a summary".to_owned(),
                Some(Summary { end: End::Aborted, .. }) => "it was interrupted".to_owned(),
                Some(summary) if summary.reason.is_empty() => "it ends in the run".to_owned(),
                Some(summary) => summary.reason,
            };
            self.warnings.push(format!("the trial is not whole: {how}; its run is used up to {end:.1} s"));
        }
        if end - start < SHORTEST_RUN_S {
            let reason = format!("its motors ran for {:.1} s only", (end - start).max(0.0));
            return unusable(reason, "repeat the trial with `biflag record PLAN --resume`");
        }
        let still = phase("preroll").map_or(start..start, |at| self.phases[at].1..start);
        let decay = phase("decay").map_or(after..after, |at| {
            self.phases[at].1..self.phases.get(at + 1).map_or(self.end_s, |(_, next)| *next)
        });
        self.times = Times { preroll: still, run: start..end, decay };
        Ok(())
    }

    fn look_for_gaps(&mut self) {
        let gaps: Vec<_> =
            self.turns.windows(2).map(|pair| (pair[0].0, pair[1].0)).filter(|(from, to)| to - from > GAP_S).collect();
        // A slow model has no gaps but its own step.
        let usual = self.end_s / self.turns.len().max(2) as f64;
        if let Some((from, to)) = gaps.iter().copied().max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))
            && to - from > 3.0 * usual
        {
            let (count, total) = (gaps.len(), gaps.iter().map(|(from, to)| to - from).sum::<f64>());
            self.warnings.push(format!(
                "telemetry is missing in {count} places, {total:.1} s together, the longest from {from:.1} s to {to:.1} s; \
                 the encoders' angles bridge them"
            ));
        }
    }

    /// A motor that was asked to turn and whose encoder says nothing would drive the model wrongly.
    fn look_at_the_encoders(&mut self) -> Result<(), TwinError> {
        let run = self.times.run.clone();
        let at = |time: f64| {
            let after = self.turns.partition_point(|(t, _)| *t < time).min(self.turns.len() - 1);
            self.turns[after].1
        };
        let (first, last) = (at(run.start), at(run.end));
        for (k, speed) in self.speeds().into_iter().enumerate() {
            let backwards_s = match self.reverse() {
                Some((motor, after_s)) if usize::from(motor) == k + 1 => (run.end - run.start - after_s).max(0.0),
                _ => 0.0,
            };
            let asked = speed.rpm() / 60.0 * (run.end - run.start - 2.0 * backwards_s);
            let turned = last[k] - first[k];
            let moved = self.turns.iter().any(|(_, turns)| turns[k] != first[k]);
            if asked.abs() > 0.5 && !moved {
                let reason =
                    format!("the encoder of motor {} stands still while {} rpm were asked for", k + 1, speed.rpm());
                let help = "check the motor and its encoder, then repeat the trial";
                return Err(TwinError::Unusable { path: self.path.clone(), reason, help });
            }
            if (turned - asked).abs() > 0.1 * asked.abs().max(1.0) {
                self.warnings.push(format!(
                    "flagellum {} made {turned:.1} turns in the run, and {asked:.1} were asked for; what it did is used",
                    k + 1
                ));
            }
        }
        Ok(())
    }
}

/// What is kept of the messages as they pass.
#[derive(Default)]
struct Collector {
    frames: u64,
    clock: TrialClock,
    attitude: Vec<(f64, Reading)>,
    /// How many of them came before the run.
    before_run: usize,
    turns: Vec<(f64, [f64; 2])>,
    phases: Vec<(String, f64)>,
    /// When the motors got their speeds.
    ordered_s: Option<f64>,
    fault: Option<(f64, String)>,
    temperature_sum: f64,
}

impl Collector {
    fn take(&mut self, message: &Message) {
        self.clock.see(message);
        match &message.body {
            Body::Telemetry(frame) => self.telemetry(frame),
            // The rates mean something else from here on.
            Body::Event(event) if event.kind() == Kind::Calibration => {
                self.attitude.clear();
                self.before_run = 0;
            }
            Body::Event(event) if event.kind() == Kind::Phase => {
                if event.text == "run" {
                    self.before_run = self.attitude.len();
                }
                self.phases.push((event.text.clone(), self.clock.time_s(message)));
            }
            _ => {}
        }
    }

    fn telemetry(&mut self, frame: &biflag::Telemetry) {
        let time = frame.time_s;
        // A clock that goes back is that of a damaged frame.
        if !time.is_finite() || self.turns.last().is_some_and(|(last, _)| *last >= time) {
            return;
        }
        self.frames += 1;
        self.temperature_sum += frame.temperature_c;
        if let Some(reading) = Reading::of(frame).filter(|_| frame.imu_fresh) {
            self.attitude.push((time, reading));
        }
        if let (Some(motor1), Some(motor2)) = (&frame.motor1, &frame.motor2) {
            self.turns.push((time, [motor1.turns, motor2.turns]));
            if self.ordered_s.is_none() && (motor1.target_rpm != 0.0 || motor2.target_rpm != 0.0) {
                self.ordered_s = Some(time);
            }
        }
        if self.fault.is_none() && frame.fault() != biflag::Fault::None {
            let name = frame.fault().as_str_name().trim_start_matches("FAULT_").to_lowercase().replace('_', " ");
            self.fault = Some((time, name));
        }
    }
}
