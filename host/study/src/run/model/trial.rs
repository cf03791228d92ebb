//! Runs one trial in the simulator, writing the solver's samples into the log.

use super::log::{ModelLog, change, instant};
use super::{Model, ModelError, Motion};
use crate::plan::{Change, Phase, Phases, Plan, Schedule, Setpoint, Trial};
use biflag_log::{End, EventKind, LogError, ReplayMeta, SteadyMeta, Summary};
use nalgebra::Vector3;
use protocol::units::CentiRpm;
use protocol::{Calibration, State, TICK_HZ};
use sim::contact::history::{BundlingChange, BundlingHistory};
use sim::steady::{SolveError, Watch};
use sim::step::StepError;
use sim::trial::profile::{self, SpeedProfile};
use sim::trial::sample::Sample;
use std::path::Path;

/// The course of a modelled trial: its schedule, and the speeds of its motors.
#[derive(Clone, Debug)]
pub struct Course {
    /// The events.
    pub schedule: Schedule,
    /// The speeds. The trial starts at time 0; the model's settling before that is not recorded.
    pub profile: SpeedProfile,
    /// The recording that provides the speeds.
    pub replay: Option<ReplayMeta>,
}

impl Course {
    /// Returns the planned course of a trial. The motors reach their speeds as in [`profile::Phases`], and start at the
    /// planned angles, or at zero.
    ///
    /// # Errors
    /// [`ModelError::Profile`].
    pub fn planned(trial: &Trial) -> Result<Self, ModelError> {
        let Phases { calibrate_s: calibrate, preroll_s: preroll, run_s: run, decay_s: decay, .. } = trial.phases;
        let reverse = trial.reverse.map(|r| profile::Reverse { motor: usize::from(r.motor) - 1, after: r.after_s });
        let phases = profile::Phases { calibrate, preroll, run, decay, reverse, ..profile::Phases::default() };
        let profile = SpeedProfile::phases(&phases, trial.speeds.map(CentiRpm::rpm))
            .map_err(|error| ModelError::of(&trial.name, error.into()))?
            .from_angles(trial.phase_deg.unwrap_or_default().map(f64::to_radians));
        Ok(Self { schedule: Schedule::planned(trial), profile, replay: None })
    }
}

/// Computes a trial, writes its log to `path`, and ends it with the steady state. The log contains the samples of
/// [`Motion`]. If the solver fails, the log's summary states the reason; the log of an interrupted trial is left
/// incomplete.
pub(super) fn run(
    model: &Model,
    plan: &Plan,
    trial: &Trial,
    course: &Course,
    (attempt, path): (u32, &Path),
    watch: Watch,
) -> Result<SteadyMeta, ModelError> {
    let (speeds, start) = (trial.speeds.map(CentiRpm::rpm), trial.phase_deg.unwrap_or_default().map(f64::to_radians));
    let replay = course.replay.as_ref();
    let mut motion = match Motion::new(model, &course.profile, speeds, start, watch) {
        Ok(motion) => motion,
        Err(error) => {
            if let SolveError::Step(error) = &error {
                Recorder::start(model, plan, trial, (&course.schedule, replay), (attempt, path))?.fail(error)?;
            }
            return Err(ModelError::of(&trial.name, error));
        }
    };
    let recorded = motion.duration_s().map(|run_s| {
        let trial = Trial { phases: Phases::of_run(run_s), ..trial.clone() };
        (Schedule::planned(&trial), trial)
    });
    let (schedule, trial) = recorded.as_ref().map_or((&course.schedule, trial), |(schedule, trial)| (schedule, trial));
    let mut recorder = Recorder::start(model, plan, trial, (schedule, replay), (attempt, path))?;
    let simulated_s = motion.simulated_s();
    if let Err(error) = recorder.record(&mut motion, &|time_s| watch(simulated_s.max(time_s))) {
        if let ModelError::Step { error, .. } = &error {
            recorder.fail(error)?;
        }
        return Err(error);
    }
    let steady = motion.steady(std::mem::take(&mut recorder.bundling.changes));
    recorder.complete(&steady)?;
    Ok(steady)
}

/// Writes the log of an already computed planned trial to `path`, which must not exist. With
/// [`Method::Steady`](biflag_log::Method::Steady) the trial's run is the period or the last window.
///
/// # Errors
/// [`ModelError::Log`].
pub fn write_log(
    model: &Model,
    plan: &Plan,
    trial: &Trial,
    (samples, steady): (&[Sample], &SteadyMeta),
    path: &Path,
) -> Result<(), ModelError> {
    let schedule = Schedule::planned(trial);
    let mut recorder = Recorder::start(model, plan, trial, (&schedule, None), (1, path))?;
    recorder.record(samples.iter().cloned().map(Ok), &|_| true)?;
    Ok(recorder.complete(steady)?)
}

struct Recorder<'a> {
    log: ModelLog,
    /// The name of the trial.
    name: &'a str,
    schedule: &'a Schedule,
    /// Number of events that have passed.
    taken: usize,
    bundling: BundlingHistory,
}

impl<'a> Recorder<'a> {
    fn start(
        model: &Model,
        plan: &Plan,
        trial: &'a Trial,
        (schedule, replay): (&'a Schedule, Option<&ReplayMeta>),
        attempt: (u32, &Path),
    ) -> Result<Self, LogError> {
        let mut log = ModelLog::create(model, plan, trial, attempt)?;
        if let Some(replay) = replay {
            log.kept.log.meta(replay)?;
        }
        Ok(Self { log, name: &trial.name, schedule, taken: 0, bundling: BundlingHistory::default() })
    }

    /// Ends the log with the steady state.
    fn complete(mut self, steady: &SteadyMeta) -> Result<(), LogError> {
        self.log.kept.log.meta(steady)?;
        let known = |deg: f64| Some(deg).filter(|deg| deg.is_finite());
        let [yaw_deg, pitch_deg, roll_deg] = steady.values.angles_deg().map(known);
        self.log.finish(Summary { end: End::Complete, yaw_deg, pitch_deg, roll_deg, ..Summary::default() })
    }

    /// Ends the log with the failure of the solver.
    fn fail(self, error: &StepError) -> Result<(), LogError> {
        self.log.finish(Summary { reason: error.to_string(), ..Summary::default() })
    }

    fn record(
        &mut self,
        samples: impl Iterator<Item = Result<Sample, StepError>>,
        watch: Watch,
    ) -> Result<(), ModelError> {
        let mut samples = samples.peekable();
        let mut before: Option<(f64, Vector3<f64>)> = None;
        while let Some(sample) = samples.next() {
            let sample = sample.map_err(|error| ModelError::of(self.name, error.into()))?;
            if !watch(sample.time_s.max(0.0)) {
                return Err(ModelError::Interrupted);
            }
            // The sum of steps reaches zero only within rounding errors.
            if sample.time_s < -1e-6 {
                continue;
            }
            let sample = Sample { time_s: sample.time_s.max(0.0), ..sample };
            let now = (sample.time_s, Vector3::from(sample.rate_rad_s));
            let after = samples.peek().and_then(|next| next.as_ref().ok());
            let after = after.map(|next| (next.time_s, Vector3::from(next.rate_rad_s)));
            self.keep(&sample, change(before.unwrap_or(now), after.unwrap_or(now)))?;
            before = Some(now);
        }
        Ok(self.log.event(self.schedule.end_s(), EventKind::Phase, Phase::End.name())?)
    }

    fn keep(&mut self, sample: &Sample, angular_acceleration: Vector3<f64>) -> Result<(), LogError> {
        self.take_events(sample.time_s)?;
        if let Some(BundlingChange { time_s, bundling }) = self.bundling.push(sample.time_s, sample.bundling) {
            let state = format!("{bundling:?}").to_lowercase();
            self.log.event(sample.time_s, EventKind::Note, &format!("flagella {state} since {time_s:.2} s"))?;
        }
        let still = Setpoint { state: State::Idle, target: [CentiRpm(0); 2] };
        let setpoint = self.taken.checked_sub(1).map_or(still, |last| self.schedule.events[last].setpoint);
        self.log.sample(sample, angular_acceleration, setpoint)
    }

    /// Records the events up to a time, except the end of the trial, which follows the last sample.
    fn take_events(&mut self, time_s: f64) -> Result<(), LogError> {
        let schedule = self.schedule;
        while let Some(event) = schedule.events.get(self.taken).filter(|event| event.start_s <= time_s + 1e-9) {
            let before = self.taken.checked_sub(1).map(|last| &schedule.events[last]);
            if before.is_some_and(|before| before.change == Change::Phase(Phase::Calibrate)) {
                self.calibrated(event.start_s)?;
            }
            match event.change {
                Change::Phase(Phase::End) => return Ok(()),
                Change::Phase(phase) => self.log.event(event.start_s, EventKind::Phase, phase.name())?,
                Change::Reversal(reverse) => {
                    let target = before.map_or([CentiRpm(0); 2], |before| before.setpoint.target);
                    self.log.event(event.start_s, EventKind::Note, &reverse.text(target))?;
                }
            }
            self.taken += 1;
        }
        Ok(())
    }

    /// Records the calibration of an ideal gyroscope, which has no bias.
    fn calibrated(&mut self, time_s: f64) -> Result<(), LogError> {
        self.log.kept.log.at(time_s);
        let samples = (time_s * f64::from(TICK_HZ)) as u16;
        self.log.kept.calibration(&Calibration { still: true, samples, ..Calibration::default() }, instant(time_s))
    }
}
