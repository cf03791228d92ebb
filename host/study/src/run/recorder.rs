//! Records a running trial of the rig or of a model, in its log and in memory.

use crate::attitude::{Level, Leveller, Motion, RestForce, Still, rotation};
use crate::draw::{self, Drawing};
use crate::plan::RobotFile;
use crate::sensor::MeasuredSensor;
use crate::steer::{SetPoint, Times, message};
use crate::trial::{Angles, Collector, Finding, Judged, Records, Want};
use biflag_log::schema::biflag::{Quaternion, Vector};
use biflag_log::{
    CommandRecord, Converter, EventKind, FORMAT, LevelMeta, LogError, Meta, Origin, Start, Summary, Tap, Writer, sample,
};
use nalgebra::UnitQuaternion;
use protocol::units::{Count, STANDARD_GRAVITY_MPS2};
use protocol::{Calibration, Settings, State, TICK_HZ, Telemetry};
use sim::trial::sample::Sample;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Writes a trial into its log, and collects it for the results at its end.
pub struct Recorder {
    path: PathBuf,
    /// The log, for records that are not part of the results.
    pub log: Writer,
    records: Records,
    /// `None` for a model: its results come from the solver, so memory need not grow with the trial.
    collector: Option<Collector>,
    converter: Converter,
    rest: RestForce,
    still: Still,
    /// The board's counts of clipped readings in the first frame and in the last one.
    clipped: Option<[Count; 2]>,
    /// Levels the attitude for viewers.
    leveller: Option<Leveller>,
    /// Proportional gain of the board's attitude filter, 1/s.
    filter_gain: f64,
    /// Draws the robot for viewers.
    drawing: Option<Drawing>,
    /// Frames of the board so far.
    frames: u32,
    /// Angular velocity in the last frame.
    pub rates_dps: [f64; 3],
}

/// The sensor's state while the robot was at rest.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct AtRest {
    /// Magnitude of the mean acceleration less the offset in the sensor's file, in standard gravity; `None` if the rest was
    /// shorter than a second.
    pub force_g: Option<f64>,
    /// Angle between the mean acceleration and the robot's axis, degrees; `None` if the rest was shorter than a second, or
    /// if it may be an offset of the accelerometer.
    pub mounted_askew_deg: Option<f64>,
    /// Readings at the end of the sensor's range.
    pub clipped: u16,
}

/// Frames between two drawings of a robot without a model: 20 drawings a second.
const FRAMES_A_DRAWING: u32 = TICK_HZ as u32 / 20;

impl Recorder {
    /// Starts a log at `path`, which must not exist. `settings` are the board's settings; `time` is the host's clock.
    ///
    /// # Errors
    /// As [`Writer::create`].
    pub fn create(path: &Path, start: &Start, settings: Settings, time: SystemTime) -> Result<Self, LogError> {
        Ok(Self {
            path: path.to_owned(),
            log: Writer::create(path, start, time)?,
            records: Records::of_start(start),
            collector: (start.identity.origin != Origin::Model).then(|| Collector::new(Want::default(), FORMAT)),
            converter: Converter::new(settings, start.board.as_ref().map_or(0, |board| board.imu_id)),
            rest: RestForce::new(TICK_HZ),
            still: Still::default(),
            clipped: None,
            leveller: None,
            filter_gain: settings.attitude_kp.into(),
            drawing: RobotFile::of_log(Some(start.robot.clone())).parse().ok().map(|robot| Drawing::new(&robot)),
            frames: 0,
            rates_dps: [0.0; 3],
        })
    }

    /// Passes every message from here on to `tap` as well.
    pub fn tap(&mut self, tap: Tap) {
        self.log.tap(tap);
    }

    /// Records a frame of the board. `board_time_us` is the board's clock, unwrapped. Returns the attitude for viewers.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn frame(
        &mut self,
        frame: &Telemetry,
        board_time_us: u64,
        host: SystemTime,
    ) -> Result<UnitQuaternion<f64>, LogError> {
        let time_s = self.log.board_time(board_time_us, host) as f64 * 1e-6;
        let message = self.converter.telemetry(frame, board_time_us, time_s);
        self.rates_dps = message.angular_velocity_dps.map_or(self.rates_dps, |Vector { x, y, z }| [x, y, z]);
        if frame.state == State::Running {
            self.rest.clear();
            self.still.clear();
        } else if let (Some(force), true) = (message.acceleration_mps2, frame.imu_fresh) {
            let force = [force.x, force.y, force.z];
            self.rest.push(force);
            self.still.push(time_s, message.angular_velocity_dps.unwrap_or_default().z, force);
        }
        self.clipped = Some([self.clipped.map_or(frame.clipped, |[first, _]| first), frame.clipped]);
        self.collect(|collector| collector.telemetry(&message));
        self.log.message(&message, host)?;
        let attitude = self.levelled(message.attitude.unwrap_or_default(), time_s);
        let log_time_ns = self.log.time_ns(time_s);
        self.log.message(&draw::attitude(&attitude, log_time_ns), host)?;
        // A model has the shape of the flagella; otherwise only their angles are known.
        if let (Some(drawing), None) = (&self.drawing, &self.records.model)
            && self.frames.is_multiple_of(FRAMES_A_DRAWING)
        {
            let angles = [&message.motor1, &message.motor2].map(|motor| motor.as_ref().map_or(0.0, |m| m.turns * TAU));
            self.log.message(&drawing.rigid(log_time_ns, angles), host)?;
        }
        self.frames = self.frames.wrapping_add(1);
        Ok(attitude)
    }

    fn collect(&mut self, add: impl FnOnce(&mut Collector)) {
        if let Some(collector) = &mut self.collector {
            add(collector);
        }
    }

    fn levelled(&mut self, q: Quaternion, time_s: f64) -> UnitQuaternion<f64> {
        let attitude = rotation([q.w, q.x, q.y, q.z]);
        self.leveller.as_mut().map_or(attitude, |leveller| leveller.levelled(attitude, time_s))
    }

    /// Records the unrounded state of a modelled robot.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn sample(&mut self, state: &Sample, host: SystemTime) -> Result<(), LogError> {
        let (truth, forces) = (sample::truth(state), sample::forces(state));
        self.collect(|collector| collector.truth(&truth));
        self.log.message_at(state.time_s, &truth, host)?;
        self.log.message_at(state.time_s, &forces, host)?;
        if let (Some(nodes), Some(lines)) = (sample::nodes(state), &state.shapes_m) {
            self.log.message_at(state.time_s, &nodes, host)?;
            // To place the flagella, viewers need the same clock as for the attitude.
            let log_time_ns = self.log.time_ns(state.time_s);
            if let Some(drawing) = &self.drawing {
                self.log.message_at(state.time_s, &drawing.deformed(log_time_ns, lines), host)?;
            }
            self.log.message_at(state.time_s, &draw::points(log_time_ns, lines), host)?;
        }
        Ok(())
    }

    /// Records an event at the trial's current time.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn event(&mut self, kind: EventKind, text: &str, host: SystemTime) -> Result<(), LogError> {
        let time_s = self.log.time_s();
        self.collect(|collector| collector.event(time_s, kind, text));
        self.log.event(kind, text, host)
    }

    /// Records a command and its reply.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn command(&mut self, record: &CommandRecord) -> Result<(), LogError> {
        let time_s = self.log.time_s();
        self.collect(|collector| collector.command(time_s, record.attempts));
        self.log.command(record)
    }

    /// Records that `count` frames were lost, starting with the sequence number `first_seq`.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn dropout(&mut self, first_seq: u16, count: u32, host: SystemTime) -> Result<(), LogError> {
        let time_s = self.log.time_s();
        self.collect(|collector| collector.dropout(time_s, count));
        self.log.dropout(first_seq, count, host)
    }

    /// Records the result of the gyroscope's calibration. Its bias is removed from all angular rates that follow.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn calibration(&mut self, calibration: &Calibration, host: SystemTime) -> Result<(), LogError> {
        self.converter.calibrate(calibration);
        // The bias of the rates changes here.
        self.still.clear();
        let time_s = self.log.time_s();
        self.collect(|collector| collector.event(time_s, EventKind::Calibration, ""));
        self.log.calibration(calibration, host)
    }

    /// Returns the bounds on the present motion of the robot with its motors off; `None` if they have been off for too
    /// short a time.
    pub fn motion(&self) -> Option<Motion> {
        self.still.motion()
    }

    /// Writes a metadata record, and keeps it in its place in memory.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn meta<M: Meta>(&mut self, meta: M, place: fn(&mut Records) -> &mut Option<M>) -> Result<(), LogError> {
        self.log.meta(place(&mut self.records).insert(meta))
    }

    /// Returns the sensor's state from the trial so far, while the motors were off.
    pub fn at_rest(&self) -> AtRest {
        let level = self.rest.level(STANDARD_GRAVITY_MPS2).map(|level| self.without_offset(level));
        AtRest {
            force_g: level.map(|level| level.force_g),
            mounted_askew_deg: level.filter(|level| !level.is_bias()).map(|level| level.tilt_deg()),
            clipped: self.clipped.map_or(0, |[first, last]| last.0.wrapping_sub(first.0)),
        }
    }

    /// Returns the vertical less the errors of the accelerometer that the sensor's file has measured.
    fn without_offset(&self, level: Level) -> Level {
        let file = self.records.measured_sensor.as_ref().and_then(MeasuredSensor::of);
        let force_g = file.and_then(|file| file.force_g((level.up * level.force_g).into()));
        force_g.and_then(|force_g| Level::of(force_g.into(), 1.0)).unwrap_or(level)
    }

    /// Measures the vertical while the robot hangs at rest, and records it. If the tilt is small enough to be the
    /// accelerometer's bias, the attitude for viewers is levelled from here on.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn level(&mut self, host: SystemTime) -> Result<(), LogError> {
        let Some(level) = self.rest.level(STANDARD_GRAVITY_MPS2) else { return Ok(()) };
        let (used, tilt_deg) = (self.without_offset(level).is_bias(), level.tilt_deg());
        let text = if used {
            format!("tilt at rest of {tilt_deg:.2}° removed as an offset of the accelerometer")
        } else {
            format!("tilt at rest of {tilt_deg:.2}° not removed: it is too large for an offset of the accelerometer")
        };
        self.event(EventKind::Note, &text, host)?;
        let meta = LevelMeta { up: level.up.into(), force_g: level.force_g, tilt_deg, used };
        self.meta(meta, |records| &mut records.level)?;
        self.leveller = used.then(|| Leveller::new(&level, self.filter_gain));
        Ok(())
    }

    /// Records a set-point of a steered trial. Its time is the board's clock at the observation.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn set_point(&mut self, times: &Times, set_point: &SetPoint, host: SystemTime) -> Result<(), LogError> {
        let time_s = self.log.time_of_board_s(times.observed_us);
        self.log.message_at(time_s, &message(time_s, times, set_point), host)
    }

    /// Ends the log with `summary`, after adding the angles of a trial of the rig to it. Returns the results.
    ///
    /// # Errors
    /// [`LogError::Write`].
    pub fn finish(self, summary: &mut Summary) -> Result<Measured, LogError> {
        let records = Records { summary: Some(summary.clone()), ..self.records };
        let measured = measured(self.collector, &self.path, records);
        if let Some(angles) = &measured.angles {
            angles.fill(summary);
        }
        self.log.finish(summary)?;
        Ok(measured)
    }

    /// Returns the results of a trial whose log cannot be completed.
    pub fn abandon(self) -> Measured {
        measured(self.collector, &self.path, self.records)
    }
}

/// The results of a trial of the rig; a model's results come from its solver.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Measured {
    /// Its steady angles; `None` if the run has no attitudes.
    pub angles: Option<Angles>,
    /// Start and end of its run, s; `None` if its motors never ran.
    pub run_s: Option<[f64; 2]>,
    /// All findings about it.
    pub findings: Vec<Finding>,
}

fn measured(collector: Option<Collector>, path: &Path, records: Records) -> Measured {
    let Some(collector) = collector else { return Measured::default() };
    let trial = Judged::of(collector.finish(path, records));
    Measured { angles: trial.steady_angles(), run_s: trial.data.times.run_s(), findings: trial.findings }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{AXES, Estimate};
    use biflag_log::MeasuredSensorMeta;
    use protocol::units::SensorCounts;

    /// Returns the force at rest that the preflight judges, and whether the tilt is small enough, for an upright board whose
    /// accelerometer has an offset, counts of g/16384.
    fn judged(offset: [i16; 3], file: Option<&MeasuredSensor>) -> (f64, bool) {
        let folder = tempfile::tempdir().unwrap();
        let sensor = file.map(|file| MeasuredSensorMeta { name: "sensor.toml".to_owned(), text: file.to_toml() });
        let start = Start { sensor, ..Start::default() };
        let path = folder.path().join("a.mcap");
        let mut recorder = Recorder::create(&path, &start, Settings::DEFAULT, SystemTime::UNIX_EPOCH).unwrap();
        let [x, y, z] = offset;
        let frame = Telemetry { accel: [x, y, 16384 + z].map(SensorCounts), imu_fresh: true, ..Telemetry::default() };
        for i in 0..u64::from(TICK_HZ) {
            recorder.frame(&frame, i * 5000, SystemTime::UNIX_EPOCH).unwrap();
        }
        recorder.level(SystemTime::UNIX_EPOCH).unwrap();
        let rest = recorder.at_rest();
        assert_eq!(rest.mounted_askew_deg.is_none(), recorder.records.level.as_ref().unwrap().used);
        (rest.force_g.unwrap(), rest.mounted_askew_deg.is_none())
    }

    #[test]
    fn a_measured_offset_of_the_accelerometer_does_not_count() {
        for offset in [[0, 0, 4915], [4915, 0, 0]] {
            let mut file = MeasuredSensor::new(&Settings::DEFAULT);
            for (axis, offset) in AXES.into_iter().zip(offset) {
                file.set("accel_offset_g", axis, Estimate { value: f64::from(offset) / 16384.0, u: 0.0002 });
            }
            let is_good = |(force_g, is_upright): (f64, bool)| (force_g - 1.0).abs() < 0.15 && is_upright;
            assert!((judged(offset, Some(&file)).0 - 1.0).abs() < 1e-4 && is_good(judged(offset, Some(&file))));
            assert!(!is_good(judged(offset, None)), "not measured");
            assert!(!is_good(judged([0; 3], Some(&file))), "the file of another sensor");
        }
    }
}
