//! One trial on the rig: calibrate, rest, run, decay, by the board's own clock.

use super::Progress;
use super::recorder::{Frame, RecordError, Recorder};
use crate::link::Link;
use crate::log::{End, EventKind, LogError, Start, Summary, Writer};
use crate::plan::Phases;
use protocol::units::CentiRpm;
use protocol::{Command, State, TICK_HZ};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// How a trial went.
#[derive(Debug)]
pub struct TrialRun {
    /// What its log says at its end.
    pub summary: Summary,
    /// Why it is not complete, where it is not.
    pub error: Option<RecordError>,
}

/// Runs a trial and writes its log to `path`. Whatever happens, the motors are stopped and the log is closed.
///
/// # Errors
/// [`LogError`] where the log cannot be begun or ended.
pub fn run(
    link: &Link,
    path: &Path,
    start: &Start,
    progress: &Progress,
    interrupted: &AtomicBool,
) -> Result<TrialRun, LogError> {
    let log = Writer::create(path, start)?;
    let mut recorder = Recorder::new(link, log, interrupted);
    let error = phases(&mut recorder, start, progress).err();
    // The board's own deadline does it where the link is gone.
    let _ = link.command(Command::Stop);
    let _ = link.command(Command::Stream { rate_hz: 0 });
    let kept = recorder.drain();
    let error = error.or(kept.err());
    if let Some(fit) = recorder.clock_fit() {
        recorder.log.clock(&fit)?;
    }
    let summary = summarise(&recorder, start.trial.phases, start.trial.speeds, error.as_ref());
    recorder.log.finish(&summary)?;
    Ok(TrialRun { summary, error })
}

fn phases(recorder: &mut Recorder, start: &Start, progress: &Progress) -> Result<(), RecordError> {
    let name = &start.trial.name;
    let Phases { calibrate_s, preroll_s, run_s, decay_s } = start.trial.phases;
    recorder.command(Command::ClearFault)?;
    recorder.command(Command::Stream { rate_hz: TICK_HZ })?;
    let begun = recorder.until(|_| true)?;
    let mut boundary = begun;
    let phase = |recorder: &mut Recorder, text: &str| {
        progress.phase(name, text);
        recorder.event(EventKind::Phase, text)
    };
    // A phase ends with the first frame at or after its boundary, and the boundaries lie on one grid of the board's
    // clock, so that every trial of a plan is equally long.
    let last = |recorder: &mut Recorder, boundary: u64| {
        recorder.until(|frame| {
            progress.within((frame.board_us - begun) as f64 * 1e-6);
            frame.board_us >= boundary
        })
    };

    if calibrate_s > 0.0 {
        phase(recorder, "calibrate")?;
        boundary += microseconds(calibrate_s);
        // The board takes some ticks to begin and to reckon; so it stops listening to the sensor a little earlier.
        let duration_ms = (calibrate_s * 1e3 - 50.0).clamp(100.0, 60_000.0) as u16;
        recorder.command(Command::CalibrateGyro { duration_ms })?;
        last(recorder, boundary)?;
        boundary = recorder.until(|frame| frame.telemetry.state != State::Calibrating)?;
        let calibration = recorder.calibration()?;
        recorder.log.calibration(&calibration, std::time::SystemTime::now())?;
        if !calibration.still {
            let text = "the board was moved during the calibration, so the gyroscope keeps the bias that it had";
            recorder.event(EventKind::Warning, text)?;
            progress.line(&format!("{name}: {text}"));
        }
    }
    if preroll_s > 0.0 {
        phase(recorder, "preroll")?;
        boundary += microseconds(preroll_s);
        last(recorder, boundary)?;
    }
    phase(recorder, "run")?;
    recorder.command(Command::SetSpeeds(start.trial.speeds))?;
    boundary += microseconds(run_s);
    last(recorder, boundary)?;
    phase(recorder, "decay")?;
    recorder.command(Command::Stop)?;
    boundary += microseconds(decay_s);
    last(recorder, boundary)?;
    recorder.event(EventKind::Phase, "end")
}

fn summarise(recorder: &Recorder, _phases: Phases, _speeds: [CentiRpm; 2], error: Option<&RecordError>) -> Summary {
    let end = match error {
        None => End::Complete,
        Some(RecordError::Interrupted) => End::Aborted,
        Some(RecordError::Faulted(_)) => End::Faulted,
        Some(_) => End::Failed,
    };
    let _frames: &[Frame] = &recorder.frames;
    Summary {
        end,
        reason: error.map(ToString::to_string).unwrap_or_default(),
        link: recorder.monitor.stats(),
        ..Summary::default()
    }
}

fn microseconds(seconds: f64) -> u64 {
    (seconds * 1e6).round() as u64
}
