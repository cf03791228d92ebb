//! Sends a trial's schedule to the board, which then keeps time by itself.

use super::error::RecordError;
use super::recorder::Recorder;
use crate::link::LinkError;
use protocol::units::Micros;
use protocol::{Command, Refusal, SetPoint};
use study::plan::TICK_US;

/// A late schedule is delayed by a multiple of this, µs. It is the interval between the shapes of a simulated robot, so
/// its samples have the same times in every trial.
const GRID_US: u64 = 100_000;

/// Time for a request to reach the board, by its clock, µs, and the longest that is tried.
const LEAD_US: u32 = 40_000;
const MAX_LEAD_US: u32 = 20_000_000;

/// Sends the set-points to the board.
///
/// # Errors
/// [`RecordError::Restarted`] if the board has restarted since the link was opened; the link's errors.
pub(super) fn send(recorder: &mut Recorder, points: &[SetPoint]) -> Result<(), RecordError> {
    refuse_restart(recorder)?;
    (0..).zip(points).try_for_each(|(index, point)| recorder.command(Command::SetPoint { index, point: *point }))
}

/// Fails if the board has restarted, and so lost the plan's settings and the set-points.
fn refuse_restart(recorder: &mut Recorder) -> Result<(), RecordError> {
    recorder.restart().map_or(Ok(()), |cause| Err(RecordError::Restarted(cause)))
}

/// Starts the first `count` set-points at `planned_us` of the board's clock, or as soon as possible afterwards. Returns
/// the start.
pub(super) fn start(recorder: &mut Recorder, count: usize, planned_us: u64) -> Result<u64, RecordError> {
    let mut start_us = planned_us;
    in_time(LEAD_US, |lead_us| {
        if lead_us > LEAD_US {
            refuse_restart(recorder)?;
        }
        let late_us = (recorder.board_now_us()? + u64::from(lead_us)).saturating_sub(start_us);
        start_us += late_us.next_multiple_of(GRID_US);
        // Half a tick early, so that the tick at that time is the first one at or after it.
        let at = Micros((start_us - TICK_US / 2) as u32);
        recorder.command(Command::StartSchedule { count: count as u8, at })
    })?;
    Ok(start_us)
}

/// Starts a schedule early enough for the request to reach the board in time: first `lead_us` before its beginning, by the
/// board's clock, then twice as early after each late request. This computer may be busy, and an emulated board faster than real
/// time.
pub(super) fn in_time(
    mut lead_us: u32,
    mut start: impl FnMut(u32) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    loop {
        let started = start(lead_us);
        let is_late =
            matches!(started, Err(RecordError::Link(LinkError::Refused { refusal: Refusal::NotASchedule, .. })));
        if !is_late || lead_us >= MAX_LEAD_US {
            return started;
        }
        lead_us *= 2;
    }
}
