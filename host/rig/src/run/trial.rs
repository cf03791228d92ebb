//! Runs one trial on the rig: waits until the robot is still, calibrates, sends the schedule of rest, run and decay to
//! the board, and records the trial.

use super::error::RecordError;
use super::recorder::{Frame, Notes, Recorder, first_failure};
use super::simulated::{SimulatedRobot, TruthRecorder};
use super::virtual_nano::VirtualNano;
use super::{preflight, schedule, still};
use crate::link::Link;
use biflag_log::{End, EventKind, LogError, Start, Summary, Tap};
use protocol::units::CentiRpm;
use protocol::{Calibration, Command, Fault, Settings, State, TICK_HZ};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, SystemTime};
use study::plan::line::Lines;
use study::plan::{Change, Phase, Schedule, TICK_US, Trial};
use study::progress::Progress;
use study::run::{self, Measured};
use study::trial::{Angles, Finding};

/// The result of a trial.
#[derive(Debug)]
pub struct RigRun {
    /// The summary in its log.
    pub summary: Summary,
    /// Its steady angles; `None` if the run has no attitudes.
    pub angles: Option<Angles>,
    /// Start and end of its run on the log's clock, s; `None` if its motors never ran.
    pub run_s: Option<[f64; 2]>,
    /// Why it did not complete.
    pub error: Option<RecordError>,
    /// Findings about it, also in its log.
    pub findings: Vec<Finding>,
    /// Notes about things that did not affect the data.
    pub notes: Vec<String>,
}

/// The board, the display and the viewers of a trial.
pub struct RunContext<'a> {
    /// The board.
    pub link: &'a Link,
    /// Shows every phase.
    pub progress: &'a Progress,
    /// Set when the user interrupts the program.
    pub interrupted: &'a AtomicBool,
    /// Called with every message of the log, for viewers.
    pub tap: Option<Tap>,
    /// The emulated board, if its sensor plays a recording during the run.
    pub player: Option<&'a mut VirtualNano>,
    /// The robot, if it is simulated.
    pub robot: Option<&'a SimulatedRobot>,
    /// The lines of motors without encoders.
    pub lines: Option<&'a Lines>,
    /// Notes of the user that are not in the log yet.
    pub typed: Notes,
}

impl<'a> RunContext<'a> {
    /// Returns the context of a robot with encoders on a rig, without viewers.
    pub fn new(link: &'a Link, progress: &'a Progress, interrupted: &'a AtomicBool) -> Self {
        let typed = Notes::default();
        Self { link, progress, interrupted, tap: None, player: None, robot: None, lines: None, typed }
    }
}

/// Runs a trial and writes its log to `path`. `settings` are the board's settings. In every case, stops the motors and
/// closes the log.
///
/// # Errors
/// [`LogError`] if the log cannot be started or completed.
pub fn run(
    context: &mut RunContext,
    path: &Path,
    start: &Start,
    trial: &Trial,
    settings: Settings,
) -> Result<RigRun, LogError> {
    record(context, path, start, settings, |recorder, context| phases(recorder, context, trial))
}

/// Records the trial run by `phases` in a log at `path`. Whatever its outcome, stops the motors and closes the log.
pub(super) fn record(
    context: &mut RunContext,
    path: &Path,
    start: &Start,
    settings: Settings,
    phases: impl FnOnce(&mut Recorder, &mut RunContext) -> Result<(), RecordError>,
) -> Result<RigRun, LogError> {
    let mut kept = run::Recorder::create(path, start, settings, SystemTime::now())?;
    if let Some(tap) = context.tap.take() {
        kept.tap(tap);
    }
    if let Some(robot) = context.robot {
        kept.meta(robot.model.clone(), |records| &mut records.model)?;
        kept.log.meta(&robot.sensor)?;
    }
    let truth = context.robot.map(TruthRecorder::new);
    let mut recorder = Recorder::new(context.link, kept, settings, context.interrupted, truth);
    recorder.typed = Notes::clone(&context.typed);
    let phases = phases(&mut recorder, context);
    // After a failed write, further writes to the log fail as well.
    let writable = !matches!(phases, Err(RecordError::Log(_)));
    let mut error = stop(&mut recorder, phases, writable).err();
    if writable {
        error = error.or(recorder.end_truth().err());
        for text in recorder.health.warnings() {
            recorder.trial.event(EventKind::Warning, &text, SystemTime::now())?;
        }
        error = error.or_else(|| recorder.health.disturbed_hz().map(RecordError::Disturbed));
        let slowest = recorder.trial.log.slowest_write();
        if slowest > SLOW_DISK {
            let text = format!("the disk was slow: a write took {:.1} s; nothing was lost", slowest.as_secs_f64());
            recorder.notes.push(text.clone());
            recorder.trial.event(EventKind::Note, &text, SystemTime::now())?;
        }
        if let Some(clock) = recorder.clock() {
            recorder.trial.meta(clock, |records| &mut records.clock)?;
        }
    }
    let mut summary = Summary {
        end: match error {
            None => End::Complete,
            Some(RecordError::Interrupted) => End::Aborted,
            Some(RecordError::Faulted(_)) => End::Faulted,
            Some(_) => End::Failed,
        },
        reason: error.as_ref().map(ToString::to_string).unwrap_or_default(),
        link: recorder.monitor.stats,
        ..Summary::default()
    };
    let Measured { angles, run_s, findings } =
        if writable { recorder.trial.finish(&mut summary)? } else { recorder.trial.abandon() };
    Ok(RigRun { summary, angles, run_s, error, findings, notes: recorder.notes })
}

/// Largest difference of a flagellum's speed from its target at the end of the run before a warning.
const SPEED_TOLERANCE_RPM: f64 = 3.0;

/// Time after which the mean speed over a second is judged, because the motors first catch up the angle lost at their
/// start.
const SETTLING_US: u64 = 3_000_000;

/// A longer write or sync is worth a note: if the power failed meanwhile, this much would be lost.
const SLOW_DISK: Duration = Duration::from_millis(500);

/// The gyroscope's calibration ends this long before its phase, to leave time for the requests that start the schedule.
const CALIBRATION_MARGIN_S: f64 = 0.2;

/// Shortest possible calibration, s.
const SHORTEST_CALIBRATION_S: f64 = 0.1;

/// Remaining tilt, degrees, at which the board's filter counts as settled after a calibration, and the longest time
/// allowed for it, s: a filter with a usual gain needs this for a bias of 20 °/s.
const SETTLED_DEG: f64 = 0.02;
const LONGEST_SETTLING_S: f64 = 7.0;

/// Stops the motors and the stream, and records everything received until then. If the link is gone, the board stops
/// the motors at its deadline. Returns the outcome of the trial; `phases`: the outcome of its phases.
fn stop(recorder: &mut Recorder, phases: Result<(), RecordError>, writable: bool) -> Result<(), RecordError> {
    let link = recorder.link;
    if !writable {
        let _ = link.command(Command::Stop).and_then(|()| link.command(Command::Stream { rate_hz: 0 }));
        return phases;
    }
    let has_failed = phases.is_err();
    recorder.recorded_phase = has_failed.then_some(u8::MAX);
    let (stopped, meanwhile) = recorder.exchange(Command::Stop);
    let mut outcome = first_failure(phases, meanwhile);
    if stopped.is_ok() {
        if has_failed {
            outcome = first_failure(outcome, recorder.hear_off());
        }
        let (_, meanwhile) = recorder.exchange(Command::Stream { rate_hz: 0 });
        outcome = first_failure(outcome, meanwhile);
        if let Err(RecordError::Silent { cause, .. } | RecordError::ClockJumped(cause)) = &mut outcome {
            *cause = recorder.restart();
        }
    }
    first_failure(outcome, recorder.drain(has_failed))
}

/// Returns a duration in whole ticks of the board, µs.
pub(super) fn ticks_us(seconds: f64) -> u64 {
    (seconds * f64::from(TICK_HZ)).round() as u64 * TICK_US
}

/// Waits until the robot is still, calibrates the gyroscope, and starts the schedule. Returns the board's clock at its start,
/// µs.
fn begin(
    recorder: &mut Recorder,
    context: &RunContext,
    trial: &Trial,
    schedule: &Schedule,
) -> Result<u64, RecordError> {
    let points = schedule.set_points(context.lines)?;
    schedule::send(recorder, &points)?;
    let count = points.len();
    recorder.begin()?;
    let waits = still::wait(recorder, context.progress, trial)?;
    let begun_us = recorder.rested_us;
    if trial.phases.calibrate_s <= 0.0 {
        let start_us = schedule::start(recorder, count, begun_us)?;
        if !waits {
            recorder.skip_to(start_us)?;
        }
        return Ok(start_us);
    }
    // Before the start: a refusal must come before the motors turn.
    let calibrated_s = calibrate(recorder, context, trial, trial.speeds != [CentiRpm(0); 2])?;
    let planned_us = begun_us + ticks_us(calibrated_s);
    let start_us = schedule::start(recorder, count, planned_us)?;
    if start_us > planned_us {
        let late_s = (start_us - planned_us) as f64 * 1e-6;
        let text = format!("all that follows the calibration began {late_s:.1} s late: this computer was busy");
        recorder.event(EventKind::Note, &text)?;
        recorder.notes.push(text);
    }
    Ok(start_us)
}

/// Runs the schedule of a trial. The board changes the speeds and numbers its phases; this function follows them.
fn phases(recorder: &mut Recorder, context: &mut RunContext, trial: &Trial) -> Result<(), RecordError> {
    let schedule = Schedule::planned(trial);
    let (progress, name) = (context.progress, &trial.name);
    if let Some(nano) = &mut context.player {
        let _ = nano.control("rewind");
    }
    let start_us = begin(recorder, context, trial, &schedule)?;
    let mut phase = Phase::Calibrate;
    let mut phase_us = start_us;
    let mut target = [CentiRpm(0); 2];
    for (tick, event) in schedule.ticks() {
        let tick_us = start_us + u64::from(tick) * TICK_US;
        if phase == Phase::Decay
            && trial.phases.rest_at_most_s > 0.0
            && let Some(still_us) =
                still::decay(recorder, context.progress, [phase_us, tick_us], |phase| phase != Phase::Decay.number())?
        {
            recorder.end_at(still_us)?;
            return recorder.change(EventKind::Phase, Phase::End.name(), still_us);
        }
        let begins = |frame: &Frame| match event.change {
            Change::Phase(next) => frame.telemetry.phase >= next.number(),
            Change::Reversal(_) => frame.board_us + TICK_US / 2 >= tick_us,
        };
        let first = record_until(recorder, context, |frame| {
            let Frame { telemetry, board_us, .. } = frame;
            let is_off = telemetry.phase == 0 && telemetry.fault == Fault::None && *board_us > start_us + TICK_US;
            begins(frame) || is_off
        })?;
        if !begins(&first) {
            return Err(RecordError::OffSchedule);
        }
        let is_settled = tick_us - phase_us >= SETTLING_US;
        if phase == Phase::Run && is_settled && matches!(event.change, Change::Phase(_)) {
            check_speeds(recorder, target)?;
        }
        match event.change {
            Change::Phase(next) => {
                if next == Phase::Run {
                    if let Some(nano) = &mut context.player {
                        // If the emulated board has ended, the link reports it.
                        let _ = nano.control("play");
                    }
                    recorder.level()?;
                }
                if next == Phase::End {
                    recorder.end_at(tick_us)?;
                } else {
                    progress.phase(name, next.name());
                }
                recorder.change(EventKind::Phase, next.name(), tick_us)?;
                (phase, phase_us) = (next, tick_us);
            }
            Change::Reversal(reverse) => recorder.change(EventKind::Note, &reverse.text(target), tick_us)?,
        }
        target = event.setpoint.target;
    }
    Ok(())
}

/// Interval between updates of a trial's figures, on the board's clock, µs.
const FIGURES_US: u64 = 200_000;

/// Records until `ends` returns `true` for a frame, showing the progress and the latest figures.
fn record_until(
    recorder: &mut Recorder,
    context: &RunContext,
    ends: impl Fn(&Frame) -> bool,
) -> Result<Frame, RecordError> {
    let rested_us = recorder.rested_us;
    let mut shown_us = 0;
    recorder.record_until(|frame, readout| {
        context.progress.within(frame.board_us.saturating_sub(rested_us) as f64 * 1e-6);
        if frame.board_us >= shown_us + FIGURES_US {
            shown_us = frame.board_us;
            context.progress.figures(&readout.to_string());
        }
        ends(frame)
    })
}

fn check_speeds(recorder: &mut Recorder, target: [CentiRpm; 2]) -> Result<(), RecordError> {
    for (flagellum, (target, measured)) in target.into_iter().zip(recorder.last_speeds()).enumerate() {
        if (target.rpm() - measured.rpm()).abs() > SPEED_TOLERANCE_RPM {
            let [measured, target] = [measured, target].map(CentiRpm::rpm);
            let text = format!("flagellum {} turned at {measured} rpm instead of {target}", flagellum + 1);
            recorder.event(EventKind::Warning, &text)?;
        }
    }
    Ok(())
}

/// Calibrates the gyroscope, and checks the result with [`preflight::at_rest`]. `turns`: whether the motors will turn.
/// Returns the time from the start of the phase until the board's filter has settled, s.
pub(super) fn calibrate(
    recorder: &mut Recorder,
    context: &RunContext,
    trial: &Trial,
    turns: bool,
) -> Result<f64, RecordError> {
    let phase_s = trial.phases.calibrate_s.max(SHORTEST_CALIBRATION_S + CALIBRATION_MARGIN_S);
    let duration_s = phase_s - CALIBRATION_MARGIN_S;
    context.progress.phase(&trial.name, Phase::Calibrate.name());
    recorder.change(EventKind::Phase, Phase::Calibrate.name(), recorder.rested_us)?;
    recorder.recorded_phase = Some(Phase::Calibrate.number());
    let duration_ms = (duration_s * 1e3).round().min(60_000.0) as u16;
    recorder.command(Command::CalibrateGyro { duration_ms })?;
    let asked_us = recorder.board_now_us()?;
    let is_over = |frame: &Frame| frame.board_us > asked_us && frame.telemetry.state != State::Calibrating;
    record_until(recorder, context, |frame| is_over(frame) && frame.telemetry.fault == Fault::None)?;
    let calibration = recorder.calibration()?;
    recorder.trial.calibration(&calibration, SystemTime::now())?;
    let (mut rest, clock) = (recorder.trial.at_rest(), recorder.clock());
    // A sensor turned by hand may lie in any position.
    rest.mounted_askew_deg = rest.mounted_askew_deg.filter(|_| turns);
    let planned = (duration_s * f64::from(TICK_HZ)) as u16;
    preflight::at_rest(&calibration, planned, rest, clock.as_ref(), recorder.link.path())?;
    Ok(phase_s + settling_s(&recorder.settings, &calibration))
}

/// Returns the time that the board's filter needs to forget its bias from before a calibration, in whole tenths of a
/// second. Until then the attitude is tilted by the change of the bias divided by the filter's gain.
fn settling_s(settings: &Settings, calibration: &Calibration) -> f64 {
    let changes = calibration.bias.iter().zip(settings.gyro_bias).map(|(now, before)| (now - before).powi(2));
    let change_dps = changes.sum::<f32>().sqrt() / settings.gyro_range.counts_per_dps();
    let tilt_deg = f64::from(change_dps / settings.attitude_kp);
    let settles_s = (tilt_deg / SETTLED_DEG).ln() / f64::from(settings.attitude_kp);
    // Without a change it settles at once; a filter without a gain never settles.
    let settles_s = if settles_s > 0.0 { settles_s.min(LONGEST_SETTLING_S) } else { 0.0 };
    (settles_s * 10.0).ceil() / 10.0
}
