//! One trial on the rig: calibrate, rest, run, decay, by the board's own clock.

use super::recorder::{RecordError, Recorder};
use super::simulated::{SimulatedRobot, Truth};
use super::{Progress, VirtualNano};
use crate::attitude::Angles;
use crate::link::Link;
use crate::live::Live;
use crate::log::{End, EventKind, LogError, Start, Summary, Writer};
use crate::plan::Phases;
use protocol::{Command, State, TICK_HZ};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::SystemTime;

/// How a trial went.
#[derive(Debug)]
pub struct TrialRun {
    /// What its log says at its end.
    pub summary: Summary,
    /// Its angles, as far as it has any.
    pub angles: Option<Angles>,
    /// Why it is not complete, where it is not.
    pub error: Option<RecordError>,
    /// What whoever uses it should know.
    pub warnings: Vec<String>,
}

/// What a trial runs on, and who follows it.
pub struct Bench<'a> {
    /// The board.
    pub link: &'a Link,
    /// Told of every phase.
    pub progress: &'a Progress,
    /// Set when the user wants to stop.
    pub interrupted: &'a AtomicBool,
    /// Who may watch.
    pub live: Option<&'a Live>,
    /// The emulated board, where its sensor plays a recording in the run.
    pub player: Option<&'a mut VirtualNano>,
    /// The robot, where it is simulated.
    pub robot: Option<&'a SimulatedRobot>,
}

/// Runs a trial and writes its log to `path`. Whatever happens, the motors are stopped and the log is closed.
///
/// # Errors
/// [`LogError`] where the log cannot be begun or ended.
pub fn run(bench: &mut Bench, path: &Path, start: &Start) -> Result<TrialRun, LogError> {
    let mut log = Writer::create(path, start)?;
    if let Some(live) = bench.live {
        log.tap(live.tap());
    }
    if let Some(robot) = bench.robot {
        log.meta(&robot.model)?;
        log.meta(&robot.sensor)?;
    }
    let link = bench.link;
    let mut recorder = Recorder::new(link, log, bench.interrupted, bench.robot.map(Truth::new));
    if let Some((_, settings)) = &start.board {
        recorder.attitude.filtered_with(settings);
    }
    let mut warnings = Vec::new();
    let mut error = phases(&mut recorder, bench, start, &mut warnings).err();
    // The board's own deadline does it where the link is gone.
    let _ = link.command(Command::Stop);
    let _ = link.command(Command::Stream { rate_hz: 0 });
    // A log that failed once says no more of why.
    let writable = !matches!(error, Some(RecordError::Log(_)));
    if writable {
        match recorder.drain(error.is_some()) {
            // The fault says more than that the board fell silent.
            Err(fault @ RecordError::Faulted(_)) if !matches!(error, Some(RecordError::Faulted(_))) => {
                error = Some(fault)
            }
            Err(failure) if error.is_none() => error = Some(failure),
            _ => {}
        }
        if let Err(failure) = recorder.end_truth() {
            error.get_or_insert(failure);
        }
        if let Some(fit) = recorder.clock_fit() {
            recorder.log.clock(&fit)?;
        }
    }
    let angles = Angles::of(&recorder.attitude, &recorder.times.times(), start.trial.speeds);
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
    if let Some(angles) = &angles {
        angles.fill(&mut summary);
    }
    if writable {
        recorder.log.finish(&summary)?;
    }
    Ok(TrialRun { summary, angles, error, warnings })
}

/// Half of a tick: frames bear the time at which their tick really began, some microseconds about its grid.
const HALF_TICK_S: f64 = 0.5 / TICK_HZ as f64;

/// The motors start late when this computer is busy; by more than this, and the run is drawn out and a warning given.
const LATE_S: f64 = 0.1;

/// A flagellum's speed is off by more than this at the end of the run: something holds it.
const SPEED_TOLERANCE_RPM: f64 = 3.0;

/// A phase ends with the first frame at or after its boundary, and the boundaries lie on one grid of the board's clock,
/// so that every trial of a plan is equally long.
fn phases(
    recorder: &mut Recorder,
    bench: &mut Bench,
    start: &Start,
    warnings: &mut Vec<String>,
) -> Result<(), RecordError> {
    let (progress, name) = (bench.progress, &start.trial.name);
    let Phases { calibrate_s, preroll_s, run_s, decay_s } = start.trial.phases;
    let speeds = start.trial.speeds;
    if let Some(cause) = recorder.restart() {
        return Err(RecordError::Restarted(cause));
    }
    if let Some(nano) = &mut bench.player {
        let _ = nano.control("rewind");
    }
    recorder.begin()?;
    let last = |recorder: &mut Recorder, end_s: f64| {
        recorder.until(|frame| {
            progress.within(frame.time_s);
            frame.time_s >= end_s - HALF_TICK_S
        })
    };

    let mut begin = 0.0;
    if calibrate_s > 0.0 {
        progress.phase(name, "calibrate");
        recorder.phase("calibrate")?;
        begin = calibrate(recorder, progress, calibrate_s, warnings)?;
    }
    let run_start = begin + preroll_s;
    if preroll_s > 0.0 {
        progress.phase(name, "preroll");
        recorder.phase("preroll")?;
        last(recorder, run_start)?;
    }
    recorder.level()?;
    if let Some(nano) = &mut bench.player {
        // An emulated board that has gone is a port that has gone, which the trial sees for itself.
        let _ = nano.control("play");
    }
    recorder.phase("run")?;
    recorder.command(Command::SetSpeeds(speeds))?;
    // A terminal may keep the writer waiting, the motors not.
    progress.phase(name, "run");
    let running = recorder.until(|frame| frame.telemetry.target == speeds)?;
    let late = running - run_start;
    let run_end = run_s + if late > LATE_S { running } else { run_start };
    if late > LATE_S {
        warn(recorder, warnings, format!("the motors started {late:.2} s late, and ran that much longer"))?;
    }
    let mut speeds = speeds;
    if let Some(reverse) = start.trial.reverse {
        last(recorder, run_end - run_s + reverse.after_s)?;
        recorder.event(EventKind::Note, &reverse.text(speeds))?;
        speeds = reverse.of(speeds);
        recorder.command(Command::SetSpeeds(speeds))?;
    }
    last(recorder, run_end)?;
    recorder.command(Command::Stop)?;
    for (flagellum, (asked, measured)) in speeds.into_iter().zip(recorder.last_speeds()).enumerate() {
        if (asked.rpm() - measured.rpm()).abs() > SPEED_TOLERANCE_RPM {
            let text =
                format!("flagellum {} turned at {} rpm instead of {}", flagellum + 1, measured.rpm(), asked.rpm());
            warn(recorder, warnings, text)?;
        }
    }
    if decay_s > 0.0 {
        recorder.phase("decay")?;
        progress.phase(name, "decay");
        last(recorder, run_end + decay_s)?;
    }
    recorder.phase("end")
}

fn warn(recorder: &mut Recorder, warnings: &mut Vec<String>, text: String) -> Result<(), RecordError> {
    recorder.event(EventKind::Warning, &text)?;
    warnings.push(text);
    Ok(())
}

/// Has the board calibrate its gyroscope; answers when it was done.
fn calibrate(
    recorder: &mut Recorder,
    progress: &Progress,
    length_s: f64,
    warnings: &mut Vec<String>,
) -> Result<f64, RecordError> {
    // The board takes some ticks to begin and to reckon; so it stops listening to the sensor a little earlier.
    let duration_ms = (length_s * 1e3 - 50.0).clamp(100.0, 60_000.0) as u16;
    recorder.command(Command::CalibrateGyro { duration_ms })?;
    let end = recorder.until(|frame| {
        progress.within(frame.time_s);
        frame.time_s >= length_s - HALF_TICK_S && frame.telemetry.state != State::Calibrating
    })?;
    let calibration = recorder.calibration()?;
    recorder.log.calibration(&calibration, SystemTime::now())?;
    recorder.restart_attitude();
    if !calibration.still {
        let text = "the board was moved during the calibration, so the gyroscope keeps the bias that it had";
        warn(recorder, warnings, text.to_owned())?;
    }
    Ok(end)
}
