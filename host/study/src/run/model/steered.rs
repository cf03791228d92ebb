//! A steered trial in the model, with the delay of a rig and the ramp of its motors.

use super::log::{ModelLog, change, instant};
use super::motors::Motors;
use super::{Model, ModelError};
use crate::plan::{Phase, Plan, Setpoint, Trial};
use crate::steer::{Measured, PERIOD_US, SteerError, Steering, Tally, Times};
use biflag_log::{End, EventKind, SteerMeta, Summary};
use miette::Diagnostic;
use nalgebra::Vector3;
use protocol::State;
use protocol::units::CentiRpm;
use sim::trial::sample::Sample;
use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::time::Duration;
use thiserror::Error;

/// Delay from an observation until its set-point is in force: half a tick plus the next tick (2.5 + 5 ms), the frame
/// and the request on the serial line (1.6 ms), and on average half of USB's default timer of 16 ms.
pub const DELAY_S: f64 = 0.020;

const PERIOD_S: f64 = PERIOD_US as f64 * 1e-6;

/// Time before the last step for which forces and attitude are kept, s.
const REACH_S: f64 = 0.1;

/// Why a steered trial in the model ends early.
#[derive(Error, Diagnostic, Debug)]
pub enum SteeredError {
    /// The model failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Model(#[from] ModelError),
    /// The pilot failed.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Steer(#[from] SteerError),
}

/// A steered trial in the model.
#[derive(Debug)]
pub struct Steered {
    /// Its steps.
    pub tally: Tally,
    /// Why it ended early.
    pub error: Option<SteeredError>,
}

/// Steers the model from rest for the run of the trial and writes its log to `path`, which must not exist. If the run
/// ends early, the log is kept up to that point. The model waits for its pilot.
///
/// # Errors
/// [`ModelError`] if the log cannot be written or the model cannot start.
pub fn steer(
    model: &Model,
    plan: &Plan,
    trial: &Trial,
    (steering, meta): (&mut Steering, &SteerMeta),
    (attempt, path): (u32, &Path),
    goes_on: &dyn Fn(f64) -> bool,
) -> Result<Steered, ModelError> {
    let mut run = Run::start(model, plan, trial, meta, (attempt, path))?;
    let steps = (trial.phases.run_s / PERIOD_S).round().max(1.0) as u64;
    let error = (0..steps).find_map(|step| run.step(step, steering, goes_on).err());
    let error = error.filter(|error| !matches!(error, SteeredError::Steer(SteerError::Over)));
    let summary = Summary {
        end: match &error {
            None => End::Complete,
            Some(SteeredError::Model(ModelError::Interrupted)) => End::Aborted,
            Some(_) => End::Failed,
        },
        reason: error.as_ref().map(ToString::to_string).unwrap_or_default(),
        ..Summary::default()
    };
    run.log.event(run.log.kept.log.time_s(), EventKind::Phase, Phase::End.name())?;
    run.log.finish(summary)?;
    Ok(Steered { tally: run.tally, error })
}

struct Run<'a> {
    name: &'a str,
    robot: sim::trial::Trial,
    log: ModelLog,
    tally: Tally,
    motors: Motors,
    /// The set-point in force.
    target: [CentiRpm; 2],
    /// Time and rate of the last sample.
    last: Option<(f64, Vector3<f64>)>,
}

impl<'a> Run<'a> {
    fn start(
        model: &Model,
        plan: &Plan,
        trial: &'a Trial,
        meta: &SteerMeta,
        attempt: (u32, &Path),
    ) -> Result<Self, ModelError> {
        let robot = sim::trial::Trial::open(&model.robot, model.closure, model.options, REACH_S)?;
        let mut log = ModelLog::create(model, plan, trial, attempt)?;
        log.kept.meta(meta.clone(), |records| &mut records.steer)?;
        log.event(0.0, EventKind::Phase, Phase::Run.name())?;
        let (tally, motors) = (Tally::default(), Motors::default());
        Ok(Self { name: &trial.name, robot, log, tally, motors, target: [CentiRpm(0); 2], last: None })
    }

    /// Asks the pilot, and advances the model by one period.
    fn step(&mut self, step: u64, steering: &mut Steering, goes_on: &dyn Fn(f64) -> bool) -> Result<(), SteeredError> {
        let time_us = step * PERIOD_US;
        let time_s = time_us as f64 * 1e-6;
        steering.ask(time_s, self.measured())?;
        let set_point = loop {
            if !goes_on(time_s) {
                return Err(ModelError::Interrupted.into());
            }
            if let Some(set_point) = steering.answer(Duration::from_millis(20))? {
                break set_point;
            }
        };
        self.turn(time_s + DELAY_S, DELAY_S)?;
        self.target = set_point.speeds;
        let end_s = (time_us + PERIOD_US) as f64 * 1e-6;
        self.turn(end_s, PERIOD_S - DELAY_S)?;
        let in_force_us = Some(time_us + (DELAY_S * 1e6) as u64);
        let times = Times { due_us: time_us, observed_us: time_us, in_force_us };
        self.record()?;
        self.log.kept.set_point(&times, &set_point, instant(time_s)).map_err(ModelError::from)?;
        self.tally.add(&times);
        Ok(())
    }

    /// Extends the motion to a time.
    fn turn(&mut self, until_s: f64, passed_s: f64) -> Result<(), ModelError> {
        let speeds = self.motors.turn(self.target.map(CentiRpm::rad_per_s), passed_s);
        let failed = |error| ModelError::Profile { trial: self.name.to_owned(), error };
        self.robot.extend(until_s, speeds).map_err(failed)
    }

    /// Records the samples up to the end of the motion.
    fn record(&mut self) -> Result<(), ModelError> {
        let name = self.name;
        let failed = |error| ModelError::Step { trial: name.to_owned(), error };
        while let Some(sample) = self.robot.next() {
            self.keep(&sample.map_err(failed)?)?;
        }
        self.robot.finish().map(drop).map_err(failed)
    }

    fn keep(&mut self, sample: &Sample) -> Result<(), ModelError> {
        let now = (sample.time_s, Vector3::from(sample.rate_rad_s));
        let before = self.last.replace(now).unwrap_or(now);
        let state = if self.target == [CentiRpm(0); 2] { State::Idle } else { State::Running };
        Ok(self.log.sample(sample, change(before, now), Setpoint { state, target: self.target })?)
    }

    /// Returns the robot's present state.
    fn measured(&self) -> Measured {
        let state = self.robot.state();
        let body = &state.body;
        let [_, pitch, roll] = sim::body::attitude::euler_zyx(&body.attitude);
        let motors = self.robot.motors(state.time);
        Measured {
            yaw_deg: body.yaw.to_degrees(),
            pitch_deg: pitch.to_degrees(),
            roll_deg: roll.to_degrees(),
            rates_dps: body.rate.map(f64::to_degrees).into(),
            speeds_rpm: motors.map(|motor| motor.speed * 30.0 / PI),
            turns: motors.map(|motor| motor.angle / TAU),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aim::shipped;
    use crate::steer::{Controller, Held, Map, PATIENCE_OF_MODEL, Pilot, Policy, RATE_HZ, Wanted};
    use crate::trial::{Judged, Want};
    use biflag_log::{Body, Method, Reader};
    use protocol::Settings;
    use sim::body::closure::Closure;
    use sim::params::Robot;
    use sim::trial::Options;

    /// The board's motors follow the angles of their targets, so flagella lose no phase when they start.
    #[test]
    fn started_flagella_make_up_for_their_start() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("steered.mcap");
        let plan = Plan::of_speeds([CentiRpm(0); 2], "calibrate = 0\npreroll = 0\nrun = 4\ndecay = 0", "").unwrap();
        let options = Options { rate_hz: RATE_HZ, shapes: false };
        let model = Model::new(Robot::default(), Settings::DEFAULT, Closure::Full, Method::Trial, options);
        let command = "while read line; do echo '{\"speeds_rpm\": [50, -10]}'; done";
        let policy = Policy::start(command, PATIENCE_OF_MODEL).unwrap();
        let mut steering = Steering::new(Wanted { yaw_deg: 0.0, pitch_deg: 0.0 }, Pilot::Policy(policy));
        steer(&model, &plan, &plan.trials[0], (&mut steering, &SteerMeta::default()), (1, &path), &|_| true).unwrap();
        let set_points = Reader::open(&path).unwrap().flatten();
        let behind: Vec<[f64; 2]> = set_points
            .filter_map(|message| if let Body::Steering(set_point) = message.body { Some(set_point) } else { None })
            .map(|s| {
                let turned_s = s.observed_us as f64 * 1e-6 - DELAY_S;
                [50.0 / 60.0 * turned_s - s.turns1, -10.0 / 60.0 * turned_s - s.turns2]
            })
            .collect();
        let largest = behind.iter().fold(0.0_f64, |largest, [first, _]| largest.max(*first));
        assert!((0.08..0.12).contains(&largest), "{largest}");
        assert!(behind.last().unwrap().iter().all(|turns| turns.abs() < 1e-3), "{behind:?}");
    }

    /// Steers a robot that differs from the controller's map. Returns the log's folder and the attitude that was held.
    #[test]
    fn robot_of_another_viscosity_holds_the_attitude_and_its_log_says_how() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("steered.mcap");
        let map = Map::of_table(&shipped().unwrap(), -40.0, 3.0).unwrap();
        let (wanted, rpm) = (map.wanted, map.rpm.map(CentiRpm::from_rpm));
        let plan = Plan::of_speeds(rpm, "calibrate = 0\npreroll = 0\nrun = 100\ndecay = 0", "").unwrap();
        let mut robot = Robot::default();
        robot.fluid.viscosity_pa_s *= 0.85;
        let options = Options { rate_hz: RATE_HZ, shapes: false };
        let model = Model::new(robot, Settings::DEFAULT, Closure::Full, Method::Trial, options);
        let meta = SteerMeta { yaw_deg: wanted.yaw_deg, pitch_deg: wanted.pitch_deg, ..SteerMeta::default() };
        let mut steering = Steering::new(wanted, Pilot::Controller(Controller::new(map).into()));
        let run = steer(&model, &plan, &plan.trials[0], (&mut steering, &meta), (1, &path), &|_| true).unwrap();
        assert!(run.error.is_none() && run.tally.late == 0 && run.tally.steps == 2000, "{run:?}");
        assert!(steering.reached_s.is_some_and(|reached_s| reached_s < 60.0), "{:?}", steering.reached_s);

        let trial = Judged::read(&path, Want::default()).unwrap();
        let (held, data) = (Held::of(&trial).unwrap(), trial.data);
        assert!((held.mean_yaw_deg + 40.0).abs() < 0.5 && (held.mean_pitch_deg - 3.0).abs() < 0.5, "{held:?}");
        // The controller's map is wrong for this robot, and the speeds compensated for the difference.
        assert!(data.is_complete() && data.speeds() != data.planned_speeds());
        let set_points = Reader::open(&path)
            .unwrap()
            .filter(|message| matches!(message, Ok(of) if matches!(of.body, Body::Steering(_))));
        assert_eq!(set_points.count(), 2000);
    }
}
