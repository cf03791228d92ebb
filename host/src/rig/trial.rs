//! One trial on the rig: calibrate, rest, run, decay, by the board's own clock.

use super::Progress;
use super::recorder::{RecordError, Recorder};
use crate::attitude::{Angles, Times};
use crate::link::Link;
use crate::log::{End, EventKind, LogError, Start, Summary, Writer};
use crate::plan::Phases;
use protocol::{Command, State, TICK_HZ};
use std::ops::Range;
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
}

/// What a trial runs on, and who follows it.
pub struct Bench<'a> {
    /// The board.
    pub link: &'a Link,
    /// Told of every phase.
    pub progress: &'a Progress,
    /// Set when the user wants to stop.
    pub interrupted: &'a AtomicBool,
    /// Called at the moment when the motors are to start.
    pub on_run: &'a mut dyn FnMut(),
}

/// Runs a trial and writes its log to `path`. Whatever happens, the motors are stopped and the log is closed.
///
/// # Errors
/// [`LogError`] where the log cannot be begun or ended.
pub fn run(bench: &mut Bench, path: &Path, start: &Start) -> Result<TrialRun, LogError> {
    let log = Writer::create(path, start)?;
    let link = bench.link;
    let mut recorder = Recorder::new(link, log, bench.interrupted);
    let mut times = Times::default();
    let error = phases(&mut recorder, bench, start, &mut times).err();
    // The board's own deadline does it where the link is gone.
    let _ = link.command(Command::Stop);
    let _ = link.command(Command::Stream { rate_hz: 0 });
    let kept = recorder.drain();
    let error = error.or(kept.err());
    if let Some(fit) = recorder.clock_fit() {
        recorder.log.clock(&fit)?;
    }
    let angles = Angles::of(&recorder.attitude, &times, start.trial.speeds);
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
    recorder.log.finish(&summary)?;
    Ok(TrialRun { summary, angles, error })
}

/// A phase ends with the first frame at or after its boundary, and the boundaries lie on one grid of the board's clock,
/// so that every trial of a plan is equally long.
fn phases(recorder: &mut Recorder, bench: &mut Bench, start: &Start, times: &mut Times) -> Result<(), RecordError> {
    let (progress, name) = (bench.progress, &start.trial.name);
    let Phases { calibrate_s, preroll_s, run_s, decay_s } = start.trial.phases;
    recorder.command(Command::ClearFault)?;
    recorder.command(Command::Stream { rate_hz: TICK_HZ })?;
    recorder.begin()?;
    let enter = |recorder: &mut Recorder, phase: &str| {
        progress.phase(name, phase);
        recorder.event(EventKind::Phase, phase)
    };
    let last = |recorder: &mut Recorder, range: &Range<f64>| {
        recorder.until(|frame| {
            progress.within(frame.time_s);
            frame.time_s >= range.end
        })
    };

    let mut begin = 0.0;
    if calibrate_s > 0.0 {
        enter(recorder, "calibrate")?;
        begin = calibrate(recorder, name, progress, calibrate_s)?;
    }
    times.preroll = begin..begin + preroll_s;
    times.run = times.preroll.end..times.preroll.end + run_s;
    times.decay = times.run.end..times.run.end + decay_s;
    if preroll_s > 0.0 {
        enter(recorder, "preroll")?;
        last(recorder, &times.preroll)?;
    }
    enter(recorder, "run")?;
    (bench.on_run)();
    recorder.command(Command::SetSpeeds(start.trial.speeds))?;
    last(recorder, &times.run)?;
    recorder.command(Command::Stop)?;
    if decay_s > 0.0 {
        enter(recorder, "decay")?;
        last(recorder, &times.decay)?;
    }
    recorder.event(EventKind::Phase, "end")
}

/// Has the board calibrate its gyroscope; answers when it was done.
fn calibrate(recorder: &mut Recorder, name: &str, progress: &Progress, length_s: f64) -> Result<f64, RecordError> {
    // The board takes some ticks to begin and to reckon; so it stops listening to the sensor a little earlier.
    let duration_ms = (length_s * 1e3 - 50.0).clamp(100.0, 60_000.0) as u16;
    recorder.command(Command::CalibrateGyro { duration_ms })?;
    let end = recorder.until(|frame| {
        progress.within(frame.time_s);
        frame.time_s >= length_s && frame.telemetry.state != State::Calibrating
    })?;
    let calibration = recorder.calibration()?;
    recorder.log.calibration(&calibration, SystemTime::now())?;
    if !calibration.still {
        let text = "the board was moved during the calibration, so the gyroscope keeps the bias that it had";
        recorder.event(EventKind::Warning, text)?;
        progress.line(&format!("{name}: {text}"));
    }
    Ok(end)
}
