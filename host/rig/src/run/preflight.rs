//! Checks before the motors turn. If a check fails, the trial is refused and the error names the remedy; `--resume`
//! continues.
//!
//! | when | what |
//! | --- | --- |
//! | before the first trial | the settings are in the board's EEPROM ([`settings`]) |
//! | before each trial | room on the disk for the rest of the plan ([`room`]), the board's supply ([`supply`]), the starting angles ([`park`](super::park)) |
//! | at the end of each calibration | enough readings, gyroscope still, 1 g, upright, no clipping, the board's clock ([`at_rest`]) |

pub use super::refusal::{LEAST_SUPPLY, PreflightError};

use super::board_copy::BoardCopies;
use super::error::RecordError;
use super::refusal::{RESERVE_BYTES, is_offset};
use super::stream;
use crate::link::Link;
use biflag_log::ClockMeta;
use protocol::units::Millivolts;
use protocol::{Calibration, Command, TICK_HZ};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use study::run::AtRest;

/// Largest deviation of the acceleration at rest, less a measured offset, from 1 g. The sensor's zero is within 0.08 g and its
/// scale within 3 % (MPU-6000/6050 product specification, section 6.2); the rest is for a sensor that is not quite still.
const FORCE_TOLERANCE_G: f64 = 0.15;

/// Largest rate error of the board's clock against this computer's. A Nano with a resonator instead of a crystal is within
/// half a per cent.
const DRIFT_LIMIT_PPM: f64 = 10_000.0;

/// Smallest number of pings for a known clock rate.
const LEAST_PINGS: u32 = 10;

/// Bytes of log per second, of the rig and of the emulated board with its robot's shapes: twice the measured values.
const RIG_BYTES_PER_S: f64 = 80e3;
const SIMULATED_BYTES_PER_S: f64 = 250e3;

/// The board measures its supply four times a second.
const SUPPLY_TIMEOUT: Duration = Duration::from_secs(3);

/// Checks that the settings were in the board's EEPROM when it started.
///
/// # Errors
/// [`PreflightError::NoSettings`].
pub fn settings(link: &Link, copies: Option<&BoardCopies>) -> Result<(), PreflightError> {
    if link.info().settings_stored {
        return Ok(());
    }
    let copies = copies.map(|copies| copies.ids().into_iter().map(|id| (id, copies.path(id))).collect());
    Err(PreflightError::NoSettings { port: link.path().to_owned(), copies: copies.unwrap_or_default() })
}

/// Checks that the disk of the session has room for logs of `seconds`, with the simulated robot's shapes or without.
///
/// # Errors
/// [`PreflightError::DiskFull`].
pub fn room(folder: &Path, seconds: f64, is_simulated: bool) -> Result<(), PreflightError> {
    // An unknown amount of free space is not a reason to stop.
    let Some(free_bytes) = system::disk::free_bytes(folder) else { return Ok(()) };
    let free_bytes = (free_bytes - RESERVE_BYTES).max(0.0);
    let needed_bytes = seconds * if is_simulated { SIMULATED_BYTES_PER_S } else { RIG_BYTES_PER_S };
    if needed_bytes <= free_bytes {
        return Ok(());
    }
    Err(PreflightError::DiskFull { folder: folder.to_owned(), free_bytes, needed_bytes })
}

/// Checks the board's supply. The motors must be off; the stream is off afterwards.
///
/// # Errors
/// [`PreflightError::SupplyLow`], also if the board has not measured it; or as [`Link::command`].
pub fn supply(link: &Link, interrupted: &AtomicBool) -> Result<(), RecordError> {
    let supply = measured_supply(link, interrupted)?;
    if supply < LEAST_SUPPLY { Err(PreflightError::SupplyLow(supply).into()) } else { Ok(()) }
}

/// Returns the board's own measurement of its supply; 0 if there is none. The stream is off afterwards.
///
/// # Errors
/// As [`Link::command`].
pub fn measured_supply(link: &Link, interrupted: &AtomicBool) -> Result<Millivolts, RecordError> {
    link.command(Command::Stream { rate_hz: TICK_HZ })?;
    let supply = first_supply(link, interrupted);
    stream::end(link)?;
    supply
}

fn first_supply(link: &Link, interrupted: &AtomicBool) -> Result<Millivolts, RecordError> {
    let mut frame = stream::next_frame(link, interrupted)?;
    let first = frame.time;
    while frame.supply.0 == 0 && u128::from(frame.time.since(first)) <= SUPPLY_TIMEOUT.as_micros() {
        frame = stream::next_frame(link, interrupted)?;
    }
    Ok(frame.supply)
}

/// Checks the sensor and the clock at the end of the calibration. `planned`: the planned number of readings; `clock`:
/// the clock fit of the trial so far; `port`: the board's port, because an emulated board, behind a pseudo-terminal,
/// has a clock with its own speed.
///
/// # Errors
/// [`PreflightError::Clipped`], [`PreflightError::FewReadings`], [`PreflightError::Moved`], [`PreflightError::NotGravity`],
/// [`PreflightError::MountedAskew`] or [`PreflightError::ClockDrift`].
pub fn at_rest(
    calibration: &Calibration,
    planned: u16,
    rest: AtRest,
    clock: Option<&ClockMeta>,
    port: &str,
) -> Result<(), PreflightError> {
    if rest.clipped > 0 {
        return Err(PreflightError::Clipped { count: rest.clipped });
    }
    if calibration.samples < planned / 2 {
        return Err(PreflightError::FewReadings { readings: calibration.samples, planned });
    }
    if !calibration.still {
        return Err(PreflightError::Moved);
    }
    if let Some(force_g) = rest.force_g.filter(|force_g| (force_g - 1.0).abs() > FORCE_TOLERANCE_G) {
        return Err(PreflightError::NotGravity { force_g });
    }
    if let Some(tilt_deg) = rest.mounted_askew_deg {
        return Err(PreflightError::MountedAskew { tilt_deg });
    }
    let is_known = |clock: &&ClockMeta| clock.pings >= LEAST_PINGS && !system::port::is_emulated(port);
    match clock.filter(is_known).map(|clock| clock.drift_ppm) {
        Some(drift_ppm) if drift_ppm.abs() > DRIFT_LIMIT_PPM => Err(PreflightError::ClockDrift { drift_ppm }),
        _ => Ok(()),
    }
}

impl PreflightError {
    /// Returns whether a push or a swing may be the cause, so that the same robot would pass at rest.
    pub fn may_pass_at_rest(&self) -> bool {
        matches!(self, Self::Moved | Self::Clipped { .. })
    }

    /// Returns whether the remedy may be another plan, with which `--resume` does not continue a session.
    pub fn changes_plan(&self) -> bool {
        match self {
            Self::MountedAskew { .. } => true,
            Self::NotGravity { force_g } => is_offset(*force_g),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use miette::Diagnostic;

    #[test]
    fn a_sensor_at_rest_passes_and_each_fault_is_refused() {
        const PORT: &str = "/dev/ttyUSB0";
        const PLANNED: u16 = 41;
        let still = Calibration { still: true, samples: 20, ..Calibration::default() };
        let at_rest = |calibration: &Calibration, rest, clock, port| at_rest(calibration, PLANNED, rest, clock, port);
        let good = AtRest { force_g: Some(1.08), ..AtRest::default() };
        let clock = ClockMeta { pings: 20, drift_ppm: 5000.0, ..ClockMeta::default() };
        assert_eq!(at_rest(&still, good, Some(&clock), PORT), Ok(()));
        assert_eq!(at_rest(&still, AtRest::default(), None, PORT), Ok(()), "too short a rest to know");
        assert_eq!(at_rest(&Calibration { still: false, ..still }, good, None, PORT), Err(PreflightError::Moved));
        let few = PreflightError::FewReadings { readings: 19, planned: PLANNED };
        assert_eq!(at_rest(&Calibration { samples: 19, ..still }, good, None, PORT), Err(few));
        for force_g in [0.84, 1.16, 1.3, 0.6, 0.5, 2.0] {
            let rest = AtRest { force_g: Some(force_g), ..good };
            let refused = at_rest(&still, rest, None, PORT).unwrap_err();
            assert_eq!(refused, PreflightError::NotGravity { force_g });
            let cure = refused.help().unwrap().to_string();
            // A wrong range halves or doubles the force.
            let is_range = [0.5, 2.0].contains(&force_g);
            let words =
                if is_range { "check accel_range_g" } else { "an offset: measure it with `biflag sensor poses`" };
            assert!(cure.contains(words), "{force_g} g: {cure}");
        }
        let askew = AtRest { mounted_askew_deg: Some(91.8), ..good };
        assert_eq!(at_rest(&still, askew, None, PORT), Err(PreflightError::MountedAskew { tilt_deg: 91.8 }));
        let clipped = AtRest { clipped: 3, ..good };
        assert_eq!(at_rest(&still, clipped, None, PORT), Err(PreflightError::Clipped { count: 3 }));
        let wrong = ClockMeta { drift_ppm: -20_000.0, ..clock };
        let refused = at_rest(&still, good, Some(&wrong), PORT).unwrap_err();
        assert_eq!(refused.to_string(), "the board's clock runs -2.0 % against this computer's");
        assert_eq!(at_rest(&still, good, Some(&wrong), "/dev/pts/3"), Ok(()));
        let few = ClockMeta { pings: 9, ..wrong };
        assert_eq!(at_rest(&still, good, Some(&few), PORT), Ok(()));
    }

    #[test]
    fn the_disk_must_have_room_for_the_whole_plan() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(room(folder.path(), 1.0, true), Ok(()));
        let refused = room(folder.path(), 1e15, false).unwrap_err();
        assert!(matches!(refused, PreflightError::DiskFull { .. }) && refused.help().is_some());
    }

    #[test]
    fn a_board_without_settings_is_told_from_a_new_one() {
        let refused = |copies| PreflightError::NoSettings { port: "/dev/ttyUSB0".into(), copies };
        let help = |copies| refused(copies).help().unwrap().to_string();
        assert!(help(vec![]).contains("biflag doctor --motors --port /dev/ttyUSB0"));
        let known = help(vec![(7, "/home/me/.config/biflag/boards/7.toml".into())]);
        assert!(known.contains("`biflag settings --restore 7 --port /dev/ttyUSB0`") && known.contains("7.toml"));
        assert!(known.contains("`biflag settings --new --port /dev/ttyUSB0`"));
    }
}
