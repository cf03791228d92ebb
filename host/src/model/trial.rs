//! One trial in the model: its samples go straight from the solver into the log.

use super::board::{Board, Order};
use super::bundling::{BundlingChange, BundlingHistory};
use super::{Model, ModelError, messages, shapes};
use crate::log::{End, EventKind, LogError, Origin, Start, SteadyMeta, Summary, Writer};
use crate::plan::{Phases, Plan, Trial};
use nalgebra::Vector3;
use protocol::units::CentiRpm;
use protocol::{Calibration, State, TICK_HZ};
use sim::profile::{self, SpeedProfile};
use sim::sample::Sample;
use sim::step::advance::StepError;
use std::path::Path;
use std::time::{Duration, SystemTime};

/// Called with the trial's time as it goes on; `false` ends the trial.
pub(super) type Watch<'a> = &'a dyn Fn(f64) -> bool;

/// How the motors of the model come to their speed: as in [`profile::Phases`].
fn speeds(trial: &Trial) -> Result<SpeedProfile, ModelError> {
    let Phases { calibrate_s: calibrate, preroll_s: preroll, run_s: run, decay_s: decay } = trial.phases;
    let reverse = trial.reverse.map(|r| profile::Reverse { motor: usize::from(r.motor) - 1, after: r.after_s });
    let phases = profile::Phases { calibrate, preroll, run, decay, reverse, ..profile::Phases::default() };
    SpeedProfile::phases(&phases, trial.speeds.map(CentiRpm::rpm))
        .map_err(|error| ModelError::Profile { trial: trial.name.clone(), error })
}

/// Computes a trial into a log at `path`, and closes it with what the trial came to. The log of a trial that the solver
/// could not end says so; that of an interrupted one has no end.
pub(super) fn run(
    model: &Model,
    plan: &Plan,
    trial: &Trial,
    attempt: u32,
    path: &Path,
    watch: Watch,
) -> Result<SteadyMeta, ModelError> {
    let profile = speeds(trial)?;
    let mut solved = sim::trial::Trial::new(&model.robot, model.closure, profile, model.options)?;
    let board = Board::new(&model.robot, model.settings);
    let start = Start {
        plan,
        trial,
        attempt,
        origin: Origin::Model,
        board: Some((board.info(), model.settings)),
        time: SystemTime::UNIX_EPOCH,
    };
    let mut log = Writer::create(path, &start)?;
    log.meta(model.meta())?;
    let mut recorder = Recorder {
        log,
        board,
        rod_radius_m: model.robot.flagellum.rod_radius_m,
        turns: turns(trial),
        taken: 0,
        bundling: BundlingHistory::default(),
        index: 0,
    };
    let failure = match recorder.record(&mut solved, trial, watch)? {
        Flow::Interrupted => return Err(ModelError::Interrupted),
        Flow::Failed(error) => Some(error),
        Flow::Done => None,
    };
    let steady = SteadyMeta::new(&solved.summary(), std::mem::take(&mut recorder.bundling.changes));
    let mut summary = Summary::default();
    summary.link.samples = recorder.index;
    if let Some(error) = failure {
        summary.reason = error.to_string();
        recorder.log.finish(&summary)?;
        return Err(ModelError::Step { trial: trial.name.clone(), error });
    }
    summary.end = End::Complete;
    summary.yaw_deg = Some(steady.yaw_deg);
    summary.pitch_deg = Some(steady.pitch_deg);
    summary.roll_deg = Some(steady.roll_deg);
    recorder.log.meta(&steady)?;
    recorder.log.finish(&summary)?;
    Ok(steady)
}

/// How the samples ended.
enum Flow {
    Done,
    Interrupted,
    Failed(StepError),
}

/// A moment at which the board is told something else.
struct Turn {
    start_s: f64,
    kind: EventKind,
    /// The phase that begins, or what else happens.
    text: String,
    order: Order,
}

/// The phases that a trial has, in their order, and the reversal in its run.
fn turns(trial: &Trial) -> Vec<Turn> {
    let Phases { calibrate_s, preroll_s, run_s, decay_s } = trial.phases;
    let still = [CentiRpm(0); 2];
    let mut start_s = 0.0;
    let mut turns = Vec::new();
    for (name, length_s, state, target) in [
        ("calibrate", calibrate_s, State::Calibrating, still),
        ("preroll", preroll_s, State::Idle, still),
        ("run", run_s, State::Running, trial.speeds),
        ("decay", decay_s, State::Idle, still),
    ] {
        if length_s > 0.0 {
            let order = Order { state, target };
            turns.push(Turn { start_s, kind: EventKind::Phase, text: name.to_owned(), order });
        }
        if let Some(reverse) = trial.reverse.filter(|_| state == State::Running) {
            turns.push(Turn {
                start_s: start_s + reverse.after_s,
                kind: EventKind::Note,
                text: reverse.text(target),
                order: Order { state, target: reverse.of(target) },
            });
        }
        start_s += length_s;
    }
    turns
}

struct Recorder {
    log: Writer,
    board: Board,
    rod_radius_m: f64,
    turns: Vec<Turn>,
    /// Those that have come.
    taken: usize,
    bundling: BundlingHistory,
    /// Samples that were kept.
    index: u64,
}

impl Recorder {
    fn record(&mut self, solved: &mut sim::trial::Trial, trial: &Trial, watch: Watch) -> Result<Flow, LogError> {
        let mut samples = solved.by_ref().peekable();
        let mut before: Option<(f64, Vector3<f64>)> = None;
        while let Some(sample) = samples.next() {
            let sample = match sample {
                Ok(sample) => sample,
                Err(error) => return Ok(Flow::Failed(error)),
            };
            if !watch(sample.time_s) {
                return Ok(Flow::Interrupted);
            }
            let now = (sample.time_s, Vector3::from(sample.rate_rad_s));
            let after = samples.peek().and_then(|next| next.as_ref().ok());
            let after = after.map(|next| (next.time_s, Vector3::from(next.rate_rad_s)));
            self.keep(&sample, change(before.unwrap_or(now), after.unwrap_or(now)))?;
            before = Some(now);
        }
        let end = trial.phases.total_s();
        self.event(end, EventKind::Phase, "end")?;
        Ok(Flow::Done)
    }

    fn keep(&mut self, sample: &Sample, turning: Vector3<f64>) -> Result<(), LogError> {
        while let Some(turn) = self.turns.get(self.taken).filter(|turn| turn.start_s <= sample.time_s + 1e-9) {
            let (start_s, kind, text) = (turn.start_s, turn.kind, turn.text.clone());
            if self.taken > 0 && self.turns[self.taken - 1].text == "calibrate" {
                self.calibrated(start_s)?;
            }
            self.event(start_s, kind, &text)?;
            self.taken += 1;
        }
        if let Some(BundlingChange { time_s, bundling }) = self.bundling.push(sample.time_s, sample.bundling) {
            let state = format!("{bundling:?}").to_lowercase();
            self.event(sample.time_s, EventKind::Note, &format!("flagella {state} since {time_s:.2} s"))?;
        }
        let order = self.turns[self.taken.saturating_sub(1)].order;
        let frame = self.board.telemetry(self.index, sample, turning, order);
        let host = instant(sample.time_s);
        self.log.telemetry(&frame, Board::clock_us(sample.time_s), host)?;
        self.log.message(&messages::truth(sample), host)?;
        self.log.message(&messages::forces(sample), host)?;
        if let Some(lines) = &sample.shapes_m {
            self.log.message(&shapes::scene(sample.time_s, lines, self.rod_radius_m), host)?;
            self.log.message(&shapes::points(sample.time_s, lines), host)?;
        }
        self.index += 1;
        Ok(())
    }

    /// The gyroscope has no bias to be found.
    fn calibrated(&mut self, time_s: f64) -> Result<(), LogError> {
        self.log.at(time_s);
        let samples = (time_s * f64::from(TICK_HZ)) as u16;
        self.log.calibration(&Calibration { still: true, samples, ..Calibration::default() }, instant(time_s))
    }

    fn event(&mut self, time_s: f64, kind: EventKind, text: &str) -> Result<(), LogError> {
        self.log.at(time_s);
        self.log.event(kind, text, instant(time_s))
    }
}

/// Change of a rate a second between two times; zero where they are one.
fn change(from: (f64, Vector3<f64>), to: (f64, Vector3<f64>)) -> Vector3<f64> {
    if to.0 > from.0 { (to.1 - from.1) / (to.0 - from.0) } else { Vector3::zeros() }
}

/// A modelled trial begins at the epoch.
fn instant(time_s: f64) -> SystemTime {
    SystemTime::UNIX_EPOCH + Duration::from_secs_f64(time_s)
}
