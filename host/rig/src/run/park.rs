//! Turns the flagella to angles relative to their marks, which the board knows from its encoders.

use super::error::RecordError;
use super::refusal::PreflightError;
use super::stream;
use crate::link::{Link, LinkError};
use protocol::units::{CentiRpm, EncoderCounts};
use protocol::{Command, Fault, Info, MAX_TURN_SPEED, Reply, Settings, State};
use std::sync::atomic::AtomicBool;

/// Speed of a flagellum on the way to its starting angle.
const SPEED: CentiRpm = CentiRpm(1000);
const _: () = assert!(SPEED.0 <= MAX_TURN_SPEED.0);

/// Last part of the way, which is turned in the direction of the run, so the backlash of the gear is on the same side.
const RUN_UP_DEG: f64 = 15.0;

/// Time limit of a turn: half a turn at [`SPEED`] takes 3 s, and a sticking gear takes some attempts at the end.
const PATIENCE_US: u32 = 20_000_000;

/// Largest error of a starting angle with which a trial may begin.
const TOLERANCE_DEG: f64 = 3.0;

/// Asks the board for its identity and the positions of its shafts.
///
/// # Errors
/// [`LinkError`].
pub fn info(link: &Link) -> Result<Info, LinkError> {
    match link.ask(Command::Hello)? {
        Reply::Info(info) => Ok(info),
        other => Err(link.wrong_answer(&Command::Hello, &other)),
    }
}

/// Checks that the board knows the angles of its shafts.
///
/// # Errors
/// [`PreflightError::AnglesUnknown`], or as [`info`].
pub fn known(link: &Link) -> Result<Info, RecordError> {
    let info = info(link)?;
    if info.angles_known {
        return Ok(info);
    }
    Err(PreflightError::AnglesUnknown { port: link.path().to_owned() }.into())
}

/// Turns the flagella to these angles from their marks, in the directions of these speeds.
///
/// # Errors
/// [`PreflightError::AnglesUnknown`], [`PreflightError::NotParked`]; the board's faults.
pub fn park(
    link: &Link,
    angles_deg: [f64; 2],
    speeds: [CentiRpm; 2],
    settings: &Settings,
    interrupted: &AtomicBool,
) -> Result<(), RecordError> {
    let info = known(link)?;
    let per_turn = f64::from(settings.counts_per_turn);
    let goals = [0, 1].map(|k| nearest(angles_deg[k], info.encoder[k], per_turn));
    let run_up = RUN_UP_DEG / 360.0 * per_turn;
    let before = [0, 1].map(|k| goals[k] - if speeds[k].0 < 0 { -run_up } else { run_up });
    let reached = turn(link, before, SPEED, interrupted).and_then(|_| turn(link, goals, SPEED, interrupted))?;
    for (k, (goal, position)) in goals.into_iter().zip(reached).enumerate() {
        let off_deg = (f64::from(position.0) - goal) / per_turn * 360.0;
        if off_deg.abs() > TOLERANCE_DEG {
            return Err(PreflightError::NotParked { flagellum: k + 1, off_deg }.into());
        }
    }
    Ok(())
}

/// Returns the position with this angle that is nearest to a given position, counts.
fn nearest(angle_deg: f64, position: EncoderCounts, per_turn: f64) -> f64 {
    let counts = angle_deg / 360.0 * per_turn;
    counts + ((f64::from(position.0) - counts) / per_turn).round() * per_turn
}

/// Turns both flagella to positions, counts, and returns their final positions.
///
/// # Errors
/// The board's faults, and as [`Link::command`].
pub fn turn(
    link: &Link,
    position: [f64; 2],
    speed: CentiRpm,
    interrupted: &AtomicBool,
) -> Result<[EncoderCounts; 2], RecordError> {
    let position = position.map(|counts| EncoderCounts(counts.round() as i32));
    stream::with_motors(link, || {
        link.command(Command::TurnTo { position, speed })?;
        wait(link, interrupted)
    })
}

fn wait(link: &Link, interrupted: &AtomicBool) -> Result<[EncoderCounts; 2], RecordError> {
    let begun = link.now()?;
    loop {
        let frame = stream::next_frame(link, interrupted)?;
        let is_old = frame.time.since(begun).cast_signed() < 0;
        if is_old {
            continue;
        }
        if frame.fault != Fault::None {
            return Err(RecordError::Faulted(frame.fault));
        }
        if frame.state != State::Running || frame.time.since(begun) > PATIENCE_US {
            return Ok(frame.encoder);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_place_of_an_angle_is_within_half_a_turn() {
        for (angle_deg, position, wanted) in
            [(0.0, 10, 0.0), (90.0, 0, 150.0), (0.0, 599, 600.0), (-90.0, 1000, 1050.0), (270.0, -7, -150.0)]
        {
            assert_eq!(nearest(angle_deg, EncoderCounts(position), 600.0), wanted, "{angle_deg}° at {position}");
        }
    }
}
