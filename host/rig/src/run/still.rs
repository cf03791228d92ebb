//! Waits until the robot is still: before a trial, and after its run.
//!
//! The board's schedule starts after the first wait and is stopped after the second, so that neither takes longer than
//! the robot needs.

use super::error::RecordError;
use super::recorder::Recorder;
use biflag_log::{EventKind, RestMeta};
use study::attitude::{Motion, STILL_TILT_DPS, STILL_YAW_DPS};
use study::plan::{Phase, Phases, TICK_US, Trial, WAIT};
use study::progress::Progress;
use study::text::decimal;

/// Interval at which the motion is judged, µs. It is a multiple of the interval between the shapes of a simulated
/// robot, so its samples have the same times in every trial.
const CHECK_US: u64 = 500_000;
const GRID_S: f64 = 0.1;

/// Waits until the robot is still or the plan's longest wait is over, so that the calibration does not take place
/// during a motion. Returns whether the trial has begun with a wait: a plan without a calibration and a pre-roll needs
/// no rest.
pub(super) fn wait(recorder: &mut Recorder, progress: &Progress, trial: &Trial) -> Result<bool, RecordError> {
    let Phases { rest_at_most_s, calibrate_s, preroll_s, .. } = trial.phases;
    if rest_at_most_s == 0.0 || calibrate_s + preroll_s == 0.0 {
        return Ok(false);
    }
    let begun_us = recorder.rested_us;
    progress.phase(&trial.name, "wait until still");
    recorder.change(EventKind::Phase, WAIT, begun_us)?;
    recorder.recorded_phase = Some(Phase::Calibrate.number());
    let longest_us = (rest_at_most_s / GRID_S).ceil() as u64 * (GRID_S * 1e6) as u64;
    let mut waited_us = 0;
    let (still, motion) = loop {
        waited_us = (waited_us + CHECK_US).min(longest_us);
        record_until(recorder, begun_us + waited_us, |_| false)?;
        let motion = recorder.trial.motion();
        progress.figures(&motion.map_or_else(String::new, |motion| text(&motion)));
        let still = motion.is_some_and(|motion| motion.is_still());
        if still || waited_us == longest_us {
            break (still, motion);
        }
    };
    recorder.rested_us = begun_us + waited_us;
    let rest = RestMeta {
        still,
        waited_s: waited_us as f64 * 1e-6,
        at_most_s: rest_at_most_s,
        yaw_dps: motion.map(|motion| motion.yaw_dps),
        tilt_dps: motion.map(|motion| motion.tilt_dps),
    };
    recorder.trial.meta(rest, |records| &mut records.rest)?;
    Ok(true)
}

/// Records the decay, planned from `begun_us` to `end_us`, until the robot is still. Returns the time at which it was
/// still; `None` if it was not before `end_us`, or before the board's phase satisfied `is_over`.
pub(super) fn decay(
    recorder: &mut Recorder,
    progress: &Progress,
    [begun_us, end_us]: [u64; 2],
    is_over: impl Fn(u8) -> bool,
) -> Result<Option<u64>, RecordError> {
    let mut check_us = begun_us + CHECK_US;
    while check_us < end_us {
        if is_over(record_until(recorder, check_us, &is_over)?) {
            return Ok(None);
        }
        progress.within((check_us - recorder.rested_us) as f64 * 1e-6);
        if let Some(motion) = recorder.trial.motion() {
            progress.figures(&text(&motion));
            if motion.is_still() {
                return Ok(Some(check_us));
            }
        }
        check_us += CHECK_US;
    }
    Ok(None)
}

/// Records until a time of the board's clock, or until its phase satisfies `ends`. Returns the phase.
fn record_until(recorder: &mut Recorder, until_us: u64, ends: impl Fn(u8) -> bool) -> Result<u8, RecordError> {
    let is_due = |board_us: u64| board_us + TICK_US / 2 >= until_us;
    let frame = recorder.record_until(|frame, _| is_due(frame.board_us) || ends(frame.telemetry.phase))?;
    Ok(frame.telemetry.phase)
}

/// Formats the bounds on the motion with their limits.
fn text(motion: &Motion) -> String {
    let rate = |name: &str, dps: f64, limit: f64| format!("{name} {} of {limit} °/s", decimal(dps, 2));
    format!("{}  {}", rate("yaw", motion.yaw_dps, STILL_YAW_DPS), rate("tilt", motion.tilt_dps, STILL_TILT_DPS))
}
