//! Runs one trial on the rig: calibrate, rest, run, decay, timed by the board's clock.

use super::recorder::{Keep, Recorder};
use super::simulated::{SimulatedRobot, TruthRecorder};
use super::{RecordError, VirtualNano, preflight};
use crate::link::Link;
use crate::plan::{Change, Phase, Phases, Schedule, ScheduledEvent, Trial};
use crate::progress::Progress;
use crate::run;
use crate::trial::Angles;
use biflag_log::{End, EventKind, LogError, Start, Summary, Tap};
use protocol::units::CentiRpm;
use protocol::{Command, Settings, State, TICK_HZ};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::SystemTime;

/// A trial that was run.
#[derive(Debug)]
pub struct RigRun {
    /// The summary in its log.
    pub summary: Summary,
    /// Its steady angles; `None` if there is no attitude in the run.
    pub angles: Option<Angles>,
    /// Why it did not complete.
    pub error: Option<RecordError>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
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
}

/// Runs a trial and writes its log to `path`. `settings` are those of the board. The motors are stopped and the log is
/// closed in every case.
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
    let mut kept = run::Recorder::create(path, start, settings, SystemTime::now())?;
    if let Some(tap) = context.tap.take() {
        kept.tap(tap);
    }
    if let Some(robot) = context.robot {
        kept.model(&robot.model)?;
        kept.log.meta(&robot.sensor)?;
    }
    let link = context.link;
    let mut recorder = Recorder::new(link, kept, context.interrupted, context.robot.map(TruthRecorder::new));
    let mut warnings = Vec::new();
    let mut error = phases(&mut recorder, context, trial, &mut warnings).err();
    // If the link is gone, the board stops the motors at its deadline.
    let _ = link.command(Command::Stop);
    let _ = link.command(Command::Stream { rate_hz: 0 });
    // After a failed write, further writes to the log fail as well.
    let writable = !matches!(error, Some(RecordError::Log(_)));
    if writable {
        let keep = if error.is_some() { Keep::Frames } else { Keep::Answers };
        match recorder.drain(keep) {
            // A fault explains the failure better than a lost stream.
            Err(fault @ RecordError::Faulted(_)) if !matches!(error, Some(RecordError::Faulted(_))) => {
                error = Some(fault)
            }
            Err(failure) if error.is_none() => error = Some(failure),
            _ => {}
        }
        if let Err(failure) = recorder.end_truth() {
            error.get_or_insert(failure);
        }
        if let Some(clock) = recorder.clock() {
            recorder.trial.log.meta(&clock)?;
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
        link: recorder.monitor.stats(),
        ..Summary::default()
    };
    let angles = if writable { recorder.trial.finish(&mut summary)? } else { recorder.trial.abandon() };
    Ok(RigRun { summary, angles, error, warnings })
}

/// Half of a tick. The times of frames deviate from the grid of ticks by some microseconds.
const HALF_TICK_S: f64 = 0.5 / TICK_HZ as f64;

/// The motors start late if this computer is busy. A longer delay extends the run, with a warning.
const LATE_S: f64 = 0.1;

/// Largest difference of a flagellum's speed from its target at the end of the run before a warning.
const SPEED_TOLERANCE_RPM: f64 = 3.0;

/// Runs the schedule of a trial. A phase ends with the first frame at or after its boundary, and all boundaries are on
/// one grid of the board's clock, so that every trial of a plan has the same length.
fn phases(
    recorder: &mut Recorder,
    context: &mut RunContext,
    trial: &Trial,
    warnings: &mut Vec<String>,
) -> Result<(), RecordError> {
    let (progress, name) = (context.progress, &trial.name);
    if let Some(cause) = recorder.restart() {
        return Err(RecordError::Restarted(cause));
    }
    if let Some(nano) = &mut context.player {
        let _ = nano.control("rewind");
    }
    recorder.begin()?;
    let mut phase = None;
    let mut target = [CentiRpm(0); 2];
    // Delay relative to the plan: a long calibration or a late start of the motors delays everything that follows.
    let mut shift_s = 0.0;
    for ScheduledEvent { start_s, change, setpoint } in Schedule::planned(trial).events {
        let due_s = start_s + shift_s;
        let reached_s = recorder.record_until(|frame| {
            progress.within(frame.time_s);
            let is_calibrating = phase == Some(Phase::Calibrate) && frame.telemetry.state == State::Calibrating;
            frame.time_s >= due_s - HALF_TICK_S && !is_calibrating
        })?;
        match phase {
            Some(Phase::Calibrate) => {
                shift_s = reached_s - start_s;
                end_calibration(recorder)?;
            }
            Some(Phase::Run) if change == Change::Phase(Phase::Decay) || change == Change::Phase(Phase::End) => {
                recorder.command(Command::Stop)?;
                check_speeds(recorder, target, warnings)?;
            }
            _ => {}
        }
        match change {
            Change::Phase(Phase::Run) => {
                recorder.level()?;
                if let Some(nano) = &mut context.player {
                    // If the emulated board has ended, the link reports it.
                    let _ = nano.control("play");
                }
                recorder.phase(Phase::Run.name())?;
                recorder.command(Command::SetSpeeds(setpoint.target))?;
                // The terminal may block, so the command is sent first.
                progress.phase(name, Phase::Run.name());
                let running_s = recorder.record_until(|frame| frame.telemetry.target == setpoint.target)?;
                let late_s = running_s - (start_s + shift_s);
                if late_s > LATE_S {
                    shift_s += late_s;
                    warn(
                        recorder,
                        warnings,
                        format!("the motors started {late_s:.2} s late; the run was extended by that"),
                    )?;
                }
            }
            Change::Phase(next) => {
                if next != Phase::End {
                    progress.phase(name, next.name());
                }
                recorder.phase(next.name())?;
                if next == Phase::Calibrate {
                    begin_calibration(recorder, &trial.phases)?;
                }
            }
            Change::Reversal(reverse) => {
                recorder.event(EventKind::Note, &reverse.text(target))?;
                recorder.command(Command::SetSpeeds(setpoint.target))?;
            }
        }
        if let Change::Phase(next) = change {
            phase = Some(next);
        }
        target = setpoint.target;
    }
    Ok(())
}

fn warn(recorder: &mut Recorder, warnings: &mut Vec<String>, text: String) -> Result<(), RecordError> {
    recorder.event(EventKind::Warning, &text)?;
    warnings.push(text);
    Ok(())
}

fn check_speeds(recorder: &mut Recorder, target: [CentiRpm; 2], warnings: &mut Vec<String>) -> Result<(), RecordError> {
    for (flagellum, (target, measured)) in target.into_iter().zip(recorder.last_speeds()).enumerate() {
        if (target.rpm() - measured.rpm()).abs() > SPEED_TOLERANCE_RPM {
            let [measured, target] = [measured, target].map(CentiRpm::rpm);
            warn(
                recorder,
                warnings,
                format!("flagellum {} turned at {measured} rpm instead of {target}", flagellum + 1),
            )?;
        }
    }
    Ok(())
}

/// Starts the gyroscope's calibration.
fn begin_calibration(recorder: &mut Recorder, phases: &Phases) -> Result<(), RecordError> {
    // The board needs some ticks to begin and to compute, so it averages for slightly less than the phase.
    let duration_ms = (phases.calibrate_s * 1e3 - 50.0).clamp(100.0, 60_000.0) as u16;
    recorder.command(Command::CalibrateGyro { duration_ms })
}

fn end_calibration(recorder: &mut Recorder) -> Result<(), RecordError> {
    let calibration = recorder.calibration()?;
    recorder.trial.calibration(&calibration, SystemTime::now())?;
    let (rest, clock) = (recorder.trial.at_rest(), recorder.clock());
    Ok(preflight::at_rest(&calibration, rest, clock.as_ref(), recorder.link.path())?)
}
