//! Checks before the motors turn. If a check fails, the trial is refused and the error names the remedy; `--resume`
//! continues.
//!
//! | when | what |
//! | --- | --- |
//! | before the first trial | the settings are in the board's EEPROM ([`settings`]) |
//! | before each trial | room on the disk for the rest of the plan ([`room`]), the board's supply ([`supply`]), the starting angles ([`park`](super::park)) |
//! | at the end of each calibration | enough readings, gyroscope still, 1 g, upright, no clipping, the board's clock ([`at_rest`]) |

use super::board_copy::BoardCopies;
use super::{RecordError, stream};
use crate::link::Link;
use biflag_log::ClockMeta;
use miette::Diagnostic;
use protocol::units::Millivolts;
use protocol::{Calibration, Command, TICK_HZ};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use study::run::AtRest;
use thiserror::Error;

/// Lowest supply of the board with which a trial begins, with a margin above the 4.3 V at which the board stops the
/// motors.
pub const LEAST_SUPPLY: Millivolts = Millivolts(4500);

/// Largest deviation of the acceleration at rest from 1 g. The sensor's zero is within 0.08 g and its scale within 3 %
/// (MPU-6000/6050 product specification, section 6.2); the rest is for a sensor that is not quite still.
const FORCE_TOLERANCE_G: f64 = 0.15;

/// Largest rate error of the board's clock against this computer's. A Nano with a resonator instead of a crystal is within
/// half a per cent.
const DRIFT_LIMIT_PPM: f64 = 10_000.0;

/// Smallest number of pings for a known clock rate.
const LEAST_PINGS: u32 = 10;

/// Bytes of log per second, of the rig and of the emulated board with its robot's shapes: twice the measured values.
const RIG_BYTES_PER_S: f64 = 80e3;
const SIMULATED_BYTES_PER_S: f64 = 250e3;

/// Reserve of free disk space, bytes.
const RESERVE_BYTES: f64 = 50e6;

/// The board measures its supply once a second.
const SUPPLY_TIMEOUT: Duration = Duration::from_secs(3);

/// Returns a size on the disk as text.
fn size(bytes: f64) -> String {
    if bytes < 1e9 { format!("{:.0} MB", bytes * 1e-6) } else { format!("{:.1} GB", bytes * 1e-9) }
}

/// Why the motors may not turn.
#[derive(Debug, Error, Diagnostic, PartialEq)]
pub enum PreflightError {
    /// The settings are not in the board's EEPROM.
    #[error("the board on {port} has no settings in its EEPROM, so it does not know how its motors are wired")]
    #[diagnostic(help("{}", settings_cure(.port, .copies)))]
    NoSettings {
        /// The port.
        port: String,
        /// The boards for which this computer has settings, with the files.
        copies: Vec<(u16, PathBuf)>,
    },
    /// The disk is too small for the plan.
    #[error(
        "{} has room for {} of logs besides a reserve of {}, and the rest of the plan needs up to {}",
        .folder.display(), size(*.free_bytes), size(RESERVE_BYTES), size(*.needed_bytes)
    )]
    #[diagnostic(help("delete files on that disk, or choose another one with --out"))]
    DiskFull {
        /// The session folder.
        folder: PathBuf,
        /// The free space minus a reserve.
        free_bytes: f64,
        /// The space needed by the rest of the plan.
        needed_bytes: f64,
    },
    /// The board's supply is too low, or not measured.
    #[error("the board's supply is {:.2} V, and at least {:.1} V are needed", .0.volts(), LEAST_SUPPLY.volts())]
    #[diagnostic(help(
        "use a shorter USB cable or another port, and check that the motors have a supply of their own; if a meter at the \
         board's 5V pin reads more, `biflag settings --supply VOLTS` with its reading makes the board measure right"
    ))]
    SupplyLow(Millivolts),
    /// The board moved during the calibration.
    #[error("the board moved during the calibration of the gyroscope")]
    #[diagnostic(help("let the robot come to rest, or make the decay before it longer"))]
    Moved,
    /// The sensor was silent for most of the calibration.
    #[error("the sensor gave {readings} readings in the calibration of the gyroscope instead of {planned}")]
    #[diagnostic(help("check the sensor's cable and its pull-ups; `biflag doctor` tests them"))]
    FewReadings {
        /// Number of readings averaged.
        readings: u16,
        /// Number of readings planned.
        planned: u16,
    },
    /// The acceleration at rest is not gravity.
    #[error("the accelerometer reads {force_g:.2} g at rest instead of 1 g")]
    #[diagnostic(help(
        "check accel_range_g in the board's settings and the sensor's supply; a damaged sensor must be replaced"
    ))]
    NotGravity {
        /// The mean acceleration, in standard gravity.
        force_g: f64,
    },
    /// The sensor's axes differ from the settings.
    #[error("the sensor is tilted by {tilt_deg:.1} degrees at rest, too much for a robot that hangs upright")]
    #[diagnostic(help(
        "set accel_axes and gyro_axes in [board] of the plan to the mounting of the sensor, and let the robot hang freely"
    ))]
    MountedAskew {
        /// Angle between the mean acceleration and the robot's axis by the settings, degrees.
        tilt_deg: f64,
    },
    /// Readings at the end of the sensor's range.
    #[error("the sensor was at the end of its range in {count} readings of the calibration")]
    #[diagnostic(help(
        "check gyro_range_dps and accel_range_g in the board's settings, and that nothing shakes the robot"
    ))]
    Clipped {
        /// The number of readings.
        count: u16,
    },
    /// The plan sets starting angles, but the board does not know its angles.
    #[error(
        "the board on {port} does not know the angles of its flagella, and the plan sets the angles at which they start"
    )]
    #[diagnostic(help("bring both flagella to their marks with `biflag align --port {port}`"))]
    AnglesUnknown {
        /// The port.
        port: String,
    },
    /// A flagellum did not come to its starting angle.
    #[error("flagellum {flagellum} stopped {off_deg:+.1} degrees from its starting angle")]
    #[diagnostic(help("check that it turns freely and that its motor's 6 V supply is on"))]
    NotParked {
        /// Number of the flagellum.
        flagellum: usize,
        /// Where it stopped.
        off_deg: f64,
    },
    /// The board's clock or this computer's is wrong.
    #[error("the board's clock runs {:+.1} % against this computer's", *.drift_ppm * 1e-4)]
    #[diagnostic(help(
        "close programs that load this computer; if it stays so, the board's resonator is defective: use another board"
    ))]
    ClockDrift {
        /// [`ClockMeta::drift_ppm`].
        drift_ppm: f64,
    },
}

fn settings_cure(port: &str, copies: &[(u16, PathBuf)]) -> String {
    if copies.is_empty() {
        return format!("run `biflag doctor --motors --port {port}`, which tests the wiring and saves the settings");
    }
    let restore: Vec<_> = copies
        .iter()
        .map(|(id, path)| format!("`biflag settings --restore {id} --port {port}` for board {id} ({})", path.display()))
        .collect();
    format!(
        "give it back the settings that this computer has kept: {}; for a new board, `biflag settings --new --port \
         {port}` saves the defaults",
        restore.join(", ")
    )
}

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
}

#[cfg(test)]
mod tests {
    use super::*;

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
        for force_g in [0.84, 1.16, 0.5, 2.0] {
            let rest = AtRest { force_g: Some(force_g), ..good };
            assert_eq!(at_rest(&still, rest, None, PORT), Err(PreflightError::NotGravity { force_g }));
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
